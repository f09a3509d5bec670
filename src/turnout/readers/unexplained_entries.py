"""Entries of the metadata that may state a rate, a scale or a unit and that nothing explains.

Other modules look for statements whose words they know. This one is the reverse: a value that could change the samples
or their rate must be explained, else it is reported by name, with the key of the layout that declares it checked
(``checked_entries``). It is explained if

- another module has compared it with the layout,
- its name, its group or the words beside it speak of something else (``metadata_subjects``),
- it agrees with the record: rate, step, number of samples, duration, units, a neutral scale, or
- it can be none of these: a length, a temperature, a small whole number (``entry_candidates``).

What may convert whole numbers of a physical unit is reported as well (``whole_numbers``).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.channel_delays import is_delay_name
from turnout.readers.directions import opposite_directions
from turnout.readers.entries import MAX_ENTRIES, Entry, UnreadObject
from turnout.readers.entry_candidates import (
    DURATION,
    MAX_TEXT,
    RATE,
    SCALE,
    SCALE_OR_OFFSET,
    UNIT,
    Candidate,
    candidates,
)
from turnout.readers.entry_owners import container_of, owners_of
from turnout.readers.exponential_windows import WINDOW_PROBLEM, WINDOW_REMEDY, window_entries
from turnout.readers.metadata_names import START_NAMES
from turnout.readers.overload_flags import overload_entries
from turnout.readers.precision import EXACT_PRECISION, around
from turnout.readers.rate_agreement import is_near_rate
from turnout.readers.rate_statements import PLAIN_TYPES
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_starts import is_start_name
from turnout.readers.stated_units import same_unit, with_stated_units
from turnout.readers.time_texts import stated_time
from turnout.readers.whole_numbers import converting_entries
from turnout.records import RawDescription
from turnout.units import IGNORED

MAX_DURATION_RATIO = 8.0  # a time that differs more from the record's duration is one of something else
DURATION_TOLERANCE = 0.02  # relative
# Ratios of a wrong rate or duration to the right one that a wrong setting or unit gives.
PLAIN_MULTIPLES = (0.1, 0.5, 2.0, 10.0)
MULTIPLES = (*PLAIN_MULTIPLES, *(2.0**k for k in range(-6, 7) if abs(k) > 1), 1e-3, 1e-2, 1e2, 1e3)
MULTIPLE_TOLERANCE = 1e-4  # relative
OVERRULED = (SCALE, SCALE_OR_OFFSET, UNIT)  # by a unit of the layout that ends with "!"
MAX_LISTED = 5  # entries in one message
MAX_NAMES = 40  # entries that the remedy names, so that one correction of the layout explains them
MAX_SHOWN = 40  # characters of a value in a message
MAX_PROBLEM = 200  # characters of all of them
REASONS_OF = {RATE: "wrong_rate", DURATION: "wrong_rate", SCALE: "scale_unknown", UNIT: "unit_unknown"}


@dataclass(frozen=True)
class RecordFacts:
    """Facts of a record: rate [Hz], numbers of samples, channels and records, the units in use, names of channels."""

    rate: float
    n_sample: int
    n_channel: int
    n_record: int
    units: tuple[str, ...]
    names: tuple[str, ...] = ()

    def explains(self, candidate: Candidate) -> bool:
        """Whether a candidate agrees with the record, or is too far from it to be about it.

        Parameters
        ----------
        candidate : Candidate
            A value of the metadata.

        Returns
        -------
        bool
            False for a statement that contradicts the facts.
        """
        n = self.n_sample
        counts = (n, n - 1, n * self.n_record, n * self.n_channel, self.n_channel, self.n_record)
        if candidate.text.isdigit() and candidate.number in counts:
            return True
        if candidate.unit:
            return any(same_unit(candidate.unit, unit) for unit in self.units)
        if candidate.is_of_other:
            cycles = candidate.number / self.rate, candidate.number * self.rate  # as a rate, and as a step
            return not any(_is_multiple(ratio, PLAIN_MULTIPLES) for ratio in cycles)
        rate = around(self.rate, EXACT_PRECISION)
        if any(interval.loose.overlaps(rate) for interval in candidate.rates):
            return True
        ratios = [seconds * self.rate / n for seconds in candidate.seconds]
        if any(abs(ratio - 1.0) <= max(DURATION_TOLERANCE, 2.0 / n) for ratio in ratios):
            return True
        if any(1 / MAX_DURATION_RATIO <= r <= MAX_DURATION_RATIO or _is_multiple(r, MULTIPLES) for r in ratios):
            return False
        if ratios and not candidate.rates:
            return not candidate.is_of_record
        if np.isnan(candidate.number):  # its unit is known
            return bool(candidate.rates) and not any(is_near_rate(i.rate, self.rate) for i in candidate.rates)
        return abs(candidate.number * self.rate / n - 1.0) <= DURATION_TOLERANCE


def _is_multiple(ratio: float, multiples: Sequence[float]) -> bool:
    """Whether a ratio is one of the multiples, to within rounding."""
    return any(abs(ratio / multiple - 1.0) <= MULTIPLE_TOLERANCE for multiple in multiples)


def unexplained_entries(
    entries: Iterable[Entry], facts: RecordFacts, are_units_certain: bool = False
) -> Iterator[tuple[Entry, Candidate]]:
    """Entries of a record that may state its rate, scale or unit and that nothing explains.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of the record.
    facts : RecordFacts
        Facts of the record.
    are_units_certain : bool
        Whether units of the layout overrule the file, so that scales and units are explained.

    Yields
    ------
    tuple of (Entry, Candidate)
        Each such entry with the first of its candidates.

    Examples
    --------
    >>> facts = RecordFacts(25600.0, 64, 2, 1, ("N", "m/s²"))
    >>> entries = [Entry("head", "Mode", "20 kS/s"), Entry("head", "Mode 2", "25.6 kS/s"), Entry("head", "Gleis", "2")]
    >>> [entry.name for entry, _ in unexplained_entries(entries, facts)]
    ['Mode']
    """
    for entry in entries:
        if entry.is_defined or entry.is_piece or _is_of_delay(entry, facts.names):
            continue
        group = container_of(entry).rpartition("/")[2] if "/" in entry.place else ""
        texts = tuple(text[:MAX_TEXT] for text in _texts(entry.value, facts.n_sample))
        texts = tuple(text for text in texts if text not in facts.names)  # ``stated_units`` compares these
        if candidate := _unexplained_candidate(entry.name, group, texts, facts, are_units_certain):
            yield entry, candidate


def _is_of_delay(entry: Entry, names: Sequence[str]) -> bool:
    """Whether an entry states the delay of a channel, which ``channel_delays`` compares with those of the others."""
    return is_delay_name(entry.name) and bool(owners_of(entry, (entry,), names))


@lru_cache(maxsize=4096)
def _unexplained_candidate(
    name: str, group: str, texts: tuple[str, ...], facts: RecordFacts, are_units_certain: bool
) -> Candidate | None:
    """The first candidate of an entry that nothing explains; files of one logger share most entries and facts."""
    is_unit_list = len(texts) > 1 and any(same_unit(text, unit) for text in texts for unit in facts.units)
    for candidate in (c for text in texts for c in candidates(name, group, text)):
        is_overruled = are_units_certain and candidate.statement in OVERRULED
        is_overruled |= is_unit_list and candidate.statement == UNIT  # of all channels, assigned by the reader
        if not is_overruled and not facts.explains(candidate):
            return candidate
    return None


def _texts(value: Any, n_sample: int) -> tuple[str, ...]:
    """The texts of a value; none of one number per sample, or of samples of several channels."""
    if isinstance(value, str):
        return (value,)
    values = value.ravel() if isinstance(value, np.ndarray) else value
    if not isinstance(values, (list, tuple, np.ndarray)):
        return (_text(value),) if np.isscalar(value) else ()
    is_list = len(values) <= MAX_ENTRIES and n_sample not in getattr(value, "shape", (len(values),))
    return tuple(_text(v) for v in values if np.isscalar(v)) if is_list else ()


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


class EntryCheck:
    """Check of the entries of all records of a file; records that share their entries are checked once.

    Parameters
    ----------
    description : RawDescription
        What the layout states: units of the channels, names of entries that somebody has checked.
    source : Source
        The raw file.
    """

    def __init__(self, description: RawDescription, source: Source):
        self.source = source
        self._checked = frozenset(name.strip().casefold() for name in description.checked_entries)
        units = [c.unit for c in description.channels if c.quantity != IGNORED and c.unit]
        self._is_hammer_test = description.kind == "hammer"
        self._channels = [c for c in description.channels if c.quantity != IGNORED]
        self._units = tuple(unit.rstrip("!") for unit in units)
        self._are_certain = any(unit.endswith("!") for unit in units)
        self._last: tuple[Sequence[Entry], tuple] | None = None  # entries of the last record, and their key
        self._key: tuple = ()  # what entries are compared with
        self._seen: set[tuple] = set()  # entries that agree with it
        self._reported: set[tuple[str, str]] = set()

    def without_checked(self, record: RawRecord) -> RawRecord:
        """The record without the entries that the layout declares checked: they state nothing about it.

        Parameters
        ----------
        record : RawRecord
            The record as it is in the file.

        Returns
        -------
        RawRecord
            The same record if there are none.
        """
        if not self._checked:
            return record
        entries = tuple(e for e in record.entries if e.name.strip().casefold() not in self._checked)
        return record if len(entries) == len(record.entries) else replace(record, entries=entries)

    def remarks(
        self, record: RawRecord, rate: float, n_record: int, where: str, is_rate_stated: bool
    ) -> list[ReadError]:
        """Check the entries of one record.

        Parameters
        ----------
        record : RawRecord
            The record as it is in the file.
        rate : float
            Its sampling rate. [Hz]
        n_record : int
            Number of records of the file.
        where : str
            The record, for the message.
        is_rate_stated : bool
            Whether the file states the rate in known words: another rate is then a remark.

        Returns
        -------
        list of ReadError
            Remarks on entries that may state a rate, scale or unit, and on objects that cannot be read, with the reason
            ``entry_unknown``.

        Raises
        ------
        ReadError
            If an entry with the unit of a rate, or words of a scale or a unit, is not explained.
        """
        n_sample = len(record.samples[0])
        key = (record.units, rate, n_sample)
        if self._last is not None and self._last[0] is record.entries and self._last[1] == key:
            return []
        directions = list(self._direction_errors(where, record))
        if self._key != key:
            self._key, self._seen = key, set()
        new_entries = [
            e for e in record.entries if not e.is_defined and self._is_new(e) and not _is_start(e, record.started_at)
        ]
        if not new_entries:
            self._last = record.entries, key
            return directions
        units = self._units + with_stated_units(record).units
        facts = RecordFacts(rate, n_sample, len(record.names), n_record, units, record.names)
        unexplained = list(unexplained_entries(new_entries, facts, self._are_certain))
        for entry, candidate in unexplained:
            if not candidate.is_weak and not (is_rate_stated and candidate.statement == RATE):
                self._seen.difference_update(_key_of(e) for e in new_entries if _is_plain(e))  # for the next records
                raise self._error(where, [(entry, candidate)], REASONS_OF[candidate.statement])
        of_converter = list(self._converter_errors(where, record))
        flags = list(self._flag_errors(where, new_entries, record.names))
        self._last = record.entries, key
        new = [(e, c) for e, c in unexplained if (e.name, c.text) not in self._reported]
        self._reported.update((e.name, c.text) for e, c in new)
        objects = [e for e in new_entries if isinstance(e.value, UnreadObject) and e.name.lower() not in START_NAMES]
        return [
            *directions,
            *self._object_errors(where, objects),
            *of_converter,
            *flags,
            *([self._error(where, new, "entry_unknown")] if new else []),
        ]

    def _direction_errors(self, where: str, record: RawRecord) -> Iterator[ReadError]:
        """Remark on each response that was measured against an axis, while the layout has the sign +1 for it."""
        for i, name, text in opposite_directions(record, self._channels):
            channel = record.names[i]
            if (channel, text) in self._reported or name.strip().casefold() in self._checked:
                continue
            self._reported.add((channel, text))
            statement = f"its direction is {text!r} by its name" if name == channel else f"its {name!r} is {text!r}"
            problem = f"{statement}, so its numbers may point the other way; they are taken as they are"
            remedy = f"Set 'sign: -1' for it in the layout; if its numbers are right, 'checked_entries: {name}'"
            yield self.source.error(f"{where}, channel {channel!r}", problem, remedy, reason="entry_unknown")

    def _object_errors(self, where: str, entries: Sequence[Entry]) -> Iterator[ReadError]:
        """Remarks on objects whose content cannot be read, each name once."""
        for entry in entries:
            key = entry.place, str(entry.value)
            if key in self._reported:
                continue
            self._reported.add(key)
            problem = f"{entry.place!r} is an {entry.value}, so its content is not read"
            remedy = (
                f"{entry.value.remedy(entry.place.replace('/', '.'))}; if it states nothing about the samples, name it "
                f"in the layout, 'checked_entries: {entry.name}'"
            )
            yield self.source.error(where, problem, remedy, reason="entry_unknown")

    def _flag_errors(self, where: str, entries: Sequence[Entry], names: Sequence[str]) -> Iterator[ReadError]:
        """Remark on each entry by which the logger says that a channel left its range, or of an exponential window."""
        flags = [
            (entry, "that a channel left its range", "Look at its peaks") for entry in overload_entries(entries, names)
        ]
        if self._is_hammer_test:
            flags += [(entry, WINDOW_PROBLEM, WINDOW_REMEDY) for entry in window_entries(entries)]
        for entry, statement, remedy in flags:
            if (entry.place, _text(entry.value)) in self._reported:
                continue
            self._reported.add((entry.place, _text(entry.value)))
            problem = f"'{entry.name}: {_text(entry.value)[:MAX_SHOWN]}' in {entry.place} may say {statement}"
            remedy = f"{remedy}; if it means something else, name it in the layout, 'checked_entries: {entry.name}'"
            yield self.source.error(where, problem, remedy, reason="entry_unknown")

    def _converter_errors(self, where: str, record: RawRecord) -> Iterator[ReadError]:
        """Remark on each channel with whole numbers and on what may convert them; each name once."""
        stated: dict[int, list[Entry]] = {}
        for i, entry in converting_entries(record, self._channels):
            if (entry.name, _text(entry.value)) not in self._reported:
                stated.setdefault(i, []).append(entry)
        for i, entries in stated.items():
            self._reported.update((entry.name, _text(entry.value)) for entry in entries)
            listed = ", ".join(dict.fromkeys(f"{entry.name}: {_text(entry.value)[:MAX_SHOWN]}" for entry in entries))
            unit = record.units[i].strip() or "the unit of the layout"
            problem = (
                f"its samples are whole numbers, and {listed[:MAX_PROBLEM]!r} may convert them to {unit}; they "
                "are taken as they are"
            )
            names = "; ".join(dict.fromkeys(entry.name for entry in entries[:MAX_NAMES]))
            remedy = (
                "Compare a value with what the logger's own program shows; if it differs, write the value of one step "
                f"into the layout, such as unit: '0.4 N!', else 'checked_entries: {names}'"
            )
            channel = f"{where}, channel {record.names[i]!r}"
            yield self.source.error(channel, problem, remedy, reason="entry_unknown")

    def _is_new(self, entry: Entry) -> bool:
        """Whether an equal entry has not been checked; arrays are always new."""
        if not _is_plain(entry):
            return True
        is_new = _key_of(entry) not in self._seen
        self._seen.add(_key_of(entry))
        return is_new

    def _error(self, where: str, unexplained: Sequence[tuple[Entry, Candidate]], reason: str) -> ReadError:
        listed = [f"{entry.name}: {shown_text(entry, candidate)}" for entry, candidate in unexplained[:MAX_LISTED]]
        more = f" and {len(unexplained) - MAX_LISTED} more" if len(unexplained) > MAX_LISTED else ""
        statements = " or ".join(dict.fromkeys(candidate.statement for _, candidate in unexplained))
        names = "; ".join(dict.fromkeys(entry.name for entry, _ in unexplained[:MAX_NAMES]))
        problem = (
            f"{', '.join(dict.fromkeys(listed))[:MAX_PROBLEM]!r}{more} in {unexplained[0][0].place} may state a "
            f"{statements}, and nothing explains it"
        )
        remedy = (
            "Correct rate and units of the layout; if such an entry means something else, name it there, "
            f"'checked_entries: {names}'"
        )
        return self.source.error(where, problem, remedy, reason=reason)


def _is_start(entry: Entry, started_at: datetime | None) -> bool:
    """Whether an entry is the time that was read as the start of the record."""
    if started_at is None or not np.isscalar(entry.value) or not is_start_name(entry.name):
        return False
    time = stated_time(entry.value, entry.name)[0]
    return time is not None and time.replace(tzinfo=None) == started_at.replace(tzinfo=None)


def _is_plain(entry: Entry) -> bool:
    return type(entry.value) in PLAIN_TYPES


def _key_of(entry: Entry) -> tuple[str, str, Any]:
    return entry.place, entry.name, entry.value


def shown_text(entry: Entry, candidate: Candidate) -> str:
    """Value of an entry for a message: all of it, or the part that may be a statement.

    Parameters
    ----------
    entry : Entry
        Entry of the metadata.
    candidate : Candidate
        What it may state.

    Returns
    -------
    str
    """
    text = _text(entry.value)
    return text if len(text) <= MAX_SHOWN else f"... {candidate.text} ..."
