"""Check of the entries of the metadata of all records of a file: errors and remarks on what nothing explains."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.directions import opposite_directions
from turnout.readers.entries import Entry, UnreadObject
from turnout.readers.entry_candidates import DURATION, RATE, SCALE, UNIT, Candidate
from turnout.readers.entry_owners import named_channels
from turnout.readers.exponential_windows import WINDOW_PROBLEM, WINDOW_REMEDY, window_entries
from turnout.readers.measured_entries import is_statistic, screen_names
from turnout.readers.metadata_names import START_NAMES
from turnout.readers.overload_flags import overload_entries
from turnout.readers.rate_statements import PLAIN_TYPES
from turnout.readers.scale_vocabulary import is_time_per_division
from turnout.readers.sensitivity_comparison import other_sensitivities, uncompared_sensitivities
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_scales import without_checked_signs
from turnout.readers.stated_starts import is_start_name
from turnout.readers.stated_units import with_stated_units
from turnout.readers.stated_zones import OR
from turnout.readers.time_texts import stated_time
from turnout.readers.unexplained_entries import MAX_SHOWN, RecordFacts, shown_text, text_of_value, unexplained_entries
from turnout.readers.whole_numbers import converting_entries
from turnout.records import RawDescription
from turnout.units import IGNORED

UNCOMPARED = "cannot be compared with the sensitivity of the layout"
OTHER_SENSITIVITY = "names no channel and is not the sensitivity of the layout"
MAX_LISTED = 5  # entries in one message
MAX_NAMES = 40  # entries that the remedy names, so that one correction of the layout explains them
MAX_PROBLEM = 200  # characters of all of them
REASONS_OF = {RATE: "wrong_rate", DURATION: "wrong_rate", SCALE: "scale_unknown", UNIT: "unit_unknown"}


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
        self.checked = frozenset(name.strip().rstrip(": ").casefold() for name in description.checked_entries)
        units = [c.unit for c in description.channels if c.quantity != IGNORED and c.unit]
        self._is_hammer_test = description.kind == "hammer"
        self._channels = [c for c in description.channels if c.quantity != IGNORED]
        self._units = tuple(unit.rstrip("!") for unit in units)
        self._are_certain = any(unit.endswith("!") for unit in units)
        self._last: tuple[Sequence[Entry], tuple] | None = None  # entries of the last record, and their key
        self._key: tuple = ()  # what entries are compared with
        self._seen: set[tuple] = set()  # entries that agree with it
        self._reported: set[tuple[str, str]] = set()

    def is_checked(self, text: str) -> bool:
        """Whether a text, "name: value", begins with the name of an entry that the layout declares checked.

        Parameters
        ----------
        text : str
            An entry, as a message quotes it.

        Returns
        -------
        bool
        """
        return text.partition(": ")[0].strip().casefold() in self.checked

    def without_checked(self, record: RawRecord) -> RawRecord:
        """The record without entries that state nothing about it: by the layout, or about divisions of a screen.

        Parameters
        ----------
        record : RawRecord
            The record as it is in the file.

        Returns
        -------
        RawRecord
            The same record if there are none.
        """
        screen = {e.name.strip().casefold() for e in record.entries if is_time_per_division(e.name, e.value)}
        screen |= screen_names(record)
        if not self.checked and not screen:
            return record
        undecided = {i: without_checked_signs(text, self.checked) for i, text in record.undecided.items()}
        if undecided != dict(record.undecided):
            record = replace(record, undecided={i: text for i, text in undecided.items() if text})
        names = self.checked | screen
        entries = tuple(e for e in record.entries if e.name.strip().casefold() not in names)
        if len(entries) == len(record.entries):
            return record
        dropped = {" ".join(str(e.value).split()) for e in record.entries if e.name.strip().casefold() in names}
        zones = [text for text in record.unread_zone.split(OR) if text not in dropped and not self.is_checked(text)]
        return replace(record, entries=entries, unread_zone=OR.join(zones))

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
            If an entry with the unit of a rate, or with words of a scale or a unit that may be those of a channel in
            use, is not explained.
        """
        n_sample = len(record.samples[0])
        key = (record.units, rate, n_sample)
        if self._last is not None and self._last[0] is record.entries and self._last[1] == key:
            return []
        directions = [*self._direction_errors(where, record), *self._sensitivity_errors(where, record)]
        if self._key != key:
            self._key, self._seen = key, set()
        new_entries = [
            e
            for e in record.entries
            if not e.is_defined
            and self._is_new(e)
            and not _is_start(e, record.started_at)
            and not is_statistic(e, record)
        ]
        if not new_entries:
            self._last = record.entries, key
            return directions
        units = self._units + with_stated_units(record).units
        facts = RecordFacts(rate, n_sample, len(record.names), n_record, units, record.names)
        unexplained = [
            (entry, candidate)
            for entry, candidate in unexplained_entries(new_entries, facts, self._are_certain)
            if not (candidate.unit and candidate.unit in self._units_of_unused(entry, record))
        ]
        for entry, candidate in unexplained:
            if not self._is_remark(entry, candidate, record, is_rate_stated):
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
            if (channel, text) in self._reported or name.strip().casefold() in self.checked:
                continue
            self._reported.add((channel, text))
            statement = f"its direction is {text!r} by its name" if name == channel else f"its {name!r} is {text!r}"
            problem = f"{statement}, so its numbers may point the other way; they are taken as they are"
            remedy = f"Set 'sign: -1' for it in the layout; if its numbers are right, 'checked_entries: {name}'"
            yield self.source.error(f"{where}, channel {channel!r}", problem, remedy, reason="entry_unknown")

    def _sensitivity_errors(self, where: str, record: RawRecord) -> Iterator[ReadError]:
        """Remark on each entry about a sensitivity that cannot be compared with those of the layout."""
        uncompared = ((e, UNCOMPARED) for e in uncompared_sensitivities(record, self._channels))
        others = ((e, OTHER_SENSITIVITY) for e in other_sensitivities(record, self._channels))
        for entry, statement in (*uncompared, *others):
            text = text_of_value(entry.value)[:MAX_SHOWN]
            if (entry.name, text) in self._reported:
                continue
            self._reported.add((entry.name, text))
            problem = f"'{entry.name}: {text}' in {entry.place} {statement}"
            remedy = (
                "Compare it with 'sensitivity' and 'sensitivity_unit' of the layout; if they agree, name it there, "
                f"'checked_entries: {entry.name}'"
            )
            yield self.source.error(where, problem, remedy, reason="entry_unknown")

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
            if (entry.place, text_of_value(entry.value)) in self._reported:
                continue
            self._reported.add((entry.place, text_of_value(entry.value)))
            problem = f"'{entry.name}: {text_of_value(entry.value)[:MAX_SHOWN]}' in {entry.place} may say {statement}"
            remedy = f"{remedy}; if it means something else, name it in the layout, 'checked_entries: {entry.name}'"
            yield self.source.error(where, problem, remedy, reason="entry_unknown")

    def _converter_errors(self, where: str, record: RawRecord) -> Iterator[ReadError]:
        """Remark on each channel with whole numbers and on what may convert them; each name once."""
        stated: dict[int, list[Entry]] = {}
        for i, entry in converting_entries(record, self._channels):
            if (entry.name, text_of_value(entry.value)) not in self._reported:
                stated.setdefault(i, []).append(entry)
        for i, entries in stated.items():
            self._reported.update((entry.name, text_of_value(entry.value)) for entry in entries)
            listed = ", ".join(
                dict.fromkeys(f"{entry.name}: {text_of_value(entry.value)[:MAX_SHOWN]}" for entry in entries)
            )
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

    def _is_remark(self, entry: Entry, candidate: Candidate, record: RawRecord, is_rate_stated: bool) -> bool:
        """Whether the record is used although nothing explains an entry."""
        if candidate.is_weak or candidate.statement not in (SCALE, UNIT):
            return candidate.is_weak or (candidate.statement == RATE and is_rate_stated)
        return bool(self._unused_owners(entry, record))

    def _units_of_unused(self, entry: Entry, record: RawRecord) -> set[str]:
        """Units, as the reader found them, of the unused channels at which an entry stands."""
        return {record.units[i] for i in self._unused_owners(entry, record) if i < len(record.units)}

    def _unused_owners(self, entry: Entry, record: RawRecord) -> frozenset[int]:
        """Channels, and behind them other columns, at which an entry stands if the layout uses none of them."""
        owners = named_channels(entry.place, (*record.names, *record.not_numbers))
        return owners if owners.isdisjoint(record.row_of(c.source) for c in self._channels) else frozenset()

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
