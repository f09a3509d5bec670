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

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.channel_delays import is_delay_name
from turnout.readers.entries import MAX_ENTRIES, Entry
from turnout.readers.entry_candidates import (
    MAX_TEXT,
    QUANTITY,
    SCALE,
    SCALE_OR_OFFSET,
    UNIT,
    Candidate,
    candidates,
)
from turnout.readers.entry_owners import container_of, owners_of
from turnout.readers.precision import EXACT_PRECISION, around
from turnout.readers.rate_agreement import is_near_rate
from turnout.readers.scale_vocabulary import INVERSIONS, scale_meaning
from turnout.readers.stated_units import known_unit, same_unit
from turnout.readers.time_texts import time_of_vector
from turnout.units import conversion

MAX_DURATION_RATIO = 8.0  # a time that differs more from the record's duration is one of something else
DURATION_TOLERANCE = 0.02  # relative
# Ratios of a wrong rate or duration to the right one that a wrong setting or unit gives.
PLAIN_MULTIPLES = (0.1, 0.5, 2.0, 10.0)
MULTIPLES = (*PLAIN_MULTIPLES, *(2.0**k for k in range(-6, 7) if abs(k) > 1), 1e-3, 1e-2, 1e2, 1e3)
MULTIPLE_TOLERANCE = 1e-4  # relative
OVERRULED = (SCALE, SCALE_OR_OFFSET, UNIT)  # by a unit of the layout that ends with "!"
MAX_SHOWN = 40  # characters of a value in a message


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
        if candidate.statement in (SCALE, SCALE_OR_OFFSET) and _states_factor_of(candidate.text, self.units):
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


def _states_factor_of(text: str, units: Sequence[str]) -> bool:
    """Whether a text states the factor of a unit of the layout, as "Full scale ±10 V" does of "10 V"."""
    factors = {conversion(unit) for unit in units if FACTOR_AND_UNIT.match(unit) and known_unit(unit)}
    quantities = (f"{match[1].lstrip('+-')} {match[2]}" for match in QUANTITY.finditer(text) if match[2])
    return bool(factors) and any(known_unit(quantity) in factors for quantity in quantities)


FACTOR_AND_UNIT = re.compile(r"\s*[+-]?[\d.]")  # "10 V", full scale or a step


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
        if scale_meaning(entry.name) != INVERSIONS:
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
    """The texts of a value; none of a date vector, of one number per sample, or of samples of several channels."""
    if isinstance(value, str):
        return (value,)
    values = value.ravel() if isinstance(value, np.ndarray) else value
    if time_of_vector(value):
        return ()
    if not isinstance(values, (list, tuple, np.ndarray)):
        return (text_of_value(value),) if np.isscalar(value) else ()
    is_list = len(values) <= MAX_ENTRIES and n_sample not in getattr(value, "shape", (len(values),))
    return tuple(text_of_value(v) for v in values if np.isscalar(v)) if is_list else ()


def text_of_value(value: Any) -> str:
    """Text of a value of the metadata.

    Parameters
    ----------
    value : any
        Value of an entry.

    Returns
    -------
    str
        Bytes decoded, anything else as Python prints it.
    """
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


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
    text = text_of_value(entry.value)
    return text if len(text) <= MAX_SHOWN else f"... {candidate.text} ..."
