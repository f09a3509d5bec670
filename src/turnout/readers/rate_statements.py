"""All statements of a file about its sampling rate, compared with each other and with the layout.

A reader hands over every entry of the metadata that belongs to a record, each with its place. Entries whose name or
value speaks of a rate, a step or an interval become statements (``rate_vocabulary``), with the precision of their
printed numbers (``precision``); time axes and evenly rising columns are statements as well. The most precise statement
holds. A statement that contradicts it beyond rounding, and an entry that may be a rate and is not understood, are
errors.
"""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.entries import MAX_ENTRIES, Entry, entries_of_text
from turnout.readers.metadata_subjects import STRONG, subject_of
from turnout.readers.precision import NUMBER, Interval, around, readings
from turnout.readers.rate_units import RateUnit, rate_unit
from turnout.readers.rate_vocabulary import CERTAIN, NOT, POSSIBLY, name_meaning, reduction_of_name
from turnout.readers.texts import decode_text

MAX_CLOCK_DRIFT = 1e-4  # relative: two clocks of one logger with separate crystals may differ by this much
PLAUSIBLE_RATES = (10.0, 1e8)  # Hz: no vibration is sampled outside; a possible statement outside means something else
USUAL_RATES = (100.0, 1e6)  # Hz: "25.600" is 25600 and not 25.6; a number without unit outside may have another one
MIN_EPOCH = 10**8  # s since 1970
PREFIXES_ALONE = tuple("kKMGnuµ\u03bc")  # without their unit, as in "20k"; "m" would be metres
PLACEHOLDERS = {
    "",
    "-",
    "none",
    "n/a",
    "n.a.",
    "na",
    "?",
    "unknown",
    "nan",
    "null",
    "undefined",
    "not set",
    "unset",
    "[]",
}
ANY_UNIT = tuple(
    RateUnit(is_step, scale)
    for is_step, scale in (
        (False, Fraction(1)), (True, Fraction(1)), (True, Fraction(1, 10**3)), (True, Fraction(1, 10**6)),
        (False, Fraction(10**3)), (True, Fraction(1, 10**9)),
    )
)  # fmt: skip
# s per unit of a time column that does not state its unit
TIME_SCALES = (1.0, 1e-3, 1e-6, 1e-9, 60.0, 3600.0, 86400.0)


@dataclass(frozen=True)
class Statement:
    """A statement about the sampling rate: where it is, as it is written, and the intervals it may mean.

    The first of ``intervals`` is the usual meaning; without any it is not understood. ``certainty`` is CERTAIN or
    POSSIBLY. ``is_clock`` marks a time axis, whose clock may drift. ``factor`` above 1 is one by which the file states
    that samples were left out: its rate may be the one before. ``is_defined`` marks the step that the format defines:
    one of 0 says nothing beside another statement.
    """

    place: str
    text: str
    intervals: tuple[Interval, ...]
    certainty: int = CERTAIN
    is_clock: bool = False
    factor: int = 1
    is_defined: bool = False

    @property
    def usual(self) -> Interval:
        """The usual meaning."""
        return self.intervals[0]

    def meaning_near(self, other: Interval) -> Interval | None:
        """The meaning that agrees with another statement.

        Parameters
        ----------
        other : Interval
            Interval of the other statement.

        Returns
        -------
        Interval or None
            The first meaning that overlaps with it, None without one.
        """
        drift = MAX_CLOCK_DRIFT if self.is_clock else 0.0
        return next((i for i in self.intervals if i.widen(drift).overlaps(other)), None)

    def agrees_with(self, other: Interval) -> bool:
        """Whether both can be the same rate if numbers that may be exact were rounded.

        Parameters
        ----------
        other : Interval
            A more precise statement of the same file.

        Returns
        -------
        bool
            True if one of the meanings overlaps with it.
        """
        drift = MAX_CLOCK_DRIFT if self.is_clock else 0.0
        return any(i.loose.widen(drift).overlaps(other.loose) for i in self.intervals)

    def __str__(self) -> str:
        rate = f" ({self.usual.rate:.9g} Hz)" if self.intervals else ""
        return f"{self.text!r}{rate} in {self.place}"


def statements_of(entries: Iterable[Entry], k: int = 0, n: int = 1) -> list[Statement]:
    """Statements about the sampling rate among the entries of a record.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata that belong to the record.
    k : int
        Number of the record, from 0.
    n : int
        Number of records: of a list of that length only value ``k`` belongs to the record.

    Returns
    -------
    list of Statement
        Without repetitions.

    Examples
    --------
    >>> (statement,) = statements_of([Entry("line 2", "Abtastintervall", "39,0625 µs"), Entry("line 3", "Gleis", "2")])
    >>> statement.usual.rate
    25600.0
    """
    statements: dict[tuple[str, str], tuple[Statement, Entry, bool]] = {}
    factors: dict[str, int] = {}  # by name: each channel may state the same one
    for entry in entries:
        reduction = reduction_of_name(entry.name)
        values = (entry.value,) if isinstance(entry.value, PLAIN_TYPES) else _values(entry.value, k, n)
        for value in values:
            if isinstance(value, (bool, np.bool_)) or not isinstance(value, (str, int, float, np.number)):
                continue
            if reduction == "factor":
                factors[entry.name.strip().casefold()] = reduction_factor(value)
            for statement in statements_of_value(entry.name, value, type(value).__name__):
                is_final = bool(reduction) or entry.is_defined
                statements.setdefault((entry.place, statement.text), (statement, entry, is_final))
    factor = math.prod(factors.values())
    return [
        replace(_at_place(statement, entry.place, 1 if is_final else factor), is_defined=entry.is_defined)
        for statement, entry, is_final in statements.values()
    ]


PLAIN_TYPES = (str, float, int)


def _at_place(statement: Statement, place: str, factor: int) -> Statement:
    """The statement at its place, with the rate behind a reduction as a further meaning."""
    if factor == 1 or statement.certainty != CERTAIN:
        return replace(statement, place=place)
    reduced = tuple(i.divide(factor) for i in statement.intervals)
    return replace(statement, place=place, intervals=statement.intervals + reduced, factor=factor)


@lru_cache(maxsize=4096)
def statements_of_value(name: str, value: Any, kind: str = "str") -> tuple[Statement, ...]:
    """Statements of one value, without its place: records share most entries. Equal numbers of other types differ.

    Parameters
    ----------
    name : str
        Name of the entry.
    value : any
        Its value, a number or a text.
    kind : str
        Name of the value's type.

    Returns
    -------
    tuple of Statement
        Empty for a value about something else.
    """
    return tuple(_statements(Entry("", name, value), value))


def _values(value: Any, k: int, n: int) -> list[Any]:
    if isinstance(value, np.ndarray):
        value = list(value.ravel()[:MAX_ENTRIES]) if value.dtype.kind in "fiuSU" else []
    if isinstance(value, (list, tuple)):
        values = [value[k]] if n > 1 and len(value) == n else list(dict.fromkeys(v for v in value if np.isscalar(v)))
    else:
        values = [value]
    return [decode_text(v) if isinstance(v, bytes) else v for v in values]


MAX_FACTOR = 10**5  # samples of the converter for each sample of the file


def reduction_factor(value: Any) -> int:
    """The factor of a reduction of the sampling rate, as in 4, "4", "4x" or "1:4".

    Parameters
    ----------
    value : any
        Value of an entry.

    Returns
    -------
    int
        1 for any other value.

    Examples
    --------
    >>> reduction_factor(4.0), reduction_factor("1:8"), reduction_factor("none"), reduction_factor("6400 Hz")
    (4, 8, 1, 1)
    """
    match = re.fullmatch(r"(?:x|1[:/])?\s*(\d+)(?:[.,]0*)?\s*(?:x|:1|fold)?", str(value).strip().casefold())
    factor = int(match[1]) if match else 1
    return factor if 1 <= factor <= MAX_FACTOR else 1


def _statements(entry: Entry, value: Any) -> Iterator[Statement]:
    """The statements of one value of an entry."""
    meaning = name_meaning(entry.name)
    if meaning.certainty != CERTAIN and subject_of(entry.name) == STRONG:
        return
    text = str(value).strip()
    quoted_entry = f"{entry.name}: {text[:40]}"
    number, unit_text = _split(text) if isinstance(value, str) else (value, "")
    if number is None:
        if meaning.certainty == CERTAIN and text.casefold() not in PLACEHOLDERS and not _is_dated(text):
            yield Statement(entry.place, quoted_entry, (), CERTAIN)
        elif meaning.certainty != CERTAIN and isinstance(value, str):
            pieces = [e for e in entries_of_text(text, entry.place) if (e.name, e.value) != (entry.name, text)]
            for piece in pieces:
                yield from _statements_of_piece(piece)
        return
    unit = rate_unit(unit_text) if unit_text else meaning.unit
    if unit is None and unit_text in PREFIXES_ALONE and meaning.certainty == CERTAIN and meaning.is_step is not None:
        unit = rate_unit(unit_text + ("s" if meaning.is_step else "Hz"))
    certainty = meaning.certainty
    if certainty == NOT and unit is not None:
        with_unit = name_meaning(f"{entry.name} [{unit_text}]") if unit_text else meaning
        certainty = with_unit.certainty
    if certainty == NOT:
        return
    if unit is not None and unit.is_sampling and certainty == POSSIBLY:
        certainty = CERTAIN  # nothing else is counted in samples per second
    is_unknown = bool(unit_text or meaning.unknown_unit) and unit is None
    intervals = () if is_unknown else _intervals(number, unit, meaning.is_step, certainty)
    if not intervals and meaning.is_step and any(r.value >= MIN_EPOCH for r in readings(number)):
        return  # "ts: 1715587200" is a time of day
    if certainty == CERTAIN and not isinstance(value, str) and not np.isfinite(value):
        yield Statement(entry.place, quoted_entry, (), CERTAIN)
    elif intervals or certainty == CERTAIN:
        yield Statement(entry.place, quoted_entry, intervals, certainty)


def _statements_of_piece(piece: Entry) -> Iterator[Statement]:
    """Statement of a piece of a free text; it must be understood, for a free text is no entry."""
    for statement in _statements(piece, piece.value):
        if statement.intervals:
            yield statement


def _split(text: str) -> tuple[str | None, str]:
    """(number, unit) of a text; no number if the text is none."""
    match = re.match(NUMBER.pattern, text)
    if spaced := re.match(r"[+-]?[1-9]\d{0,2}(?: \d{3})+(?![\d.,])", text):
        match = spaced
    if not match:
        return None, ""
    number, unit_text = match[0].rstrip(".,' "), text[match.end() :].strip()
    if rate_unit(unit_text) is None and (
        unit_text[:1].isdigit()
        or (unit_text[:1] in ("-", ":", "/") and unit_text[1:2].isdigit())
        or len(unit_text) > 40
    ):
        return None, ""
    unit_text = re.split(r"[;,(]", unit_text)[0].strip() if rate_unit(unit_text) is None else unit_text
    return number, unit_text


def _is_dated(text: str) -> bool:
    return bool(re.match(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}|\d{1,2}:\d{2}", text))


def _intervals(number: Any, unit: RateUnit | None, is_step: bool | None, certainty: int) -> tuple[Interval, ...]:
    """What a number may mean, the usual meaning first."""
    if unit is not None:
        units: tuple[RateUnit, ...] = (unit,)
    elif certainty == CERTAIN and is_step is not None:
        units = (RateUnit(is_step, Fraction(1)),)
        first = [i for r in readings(number) if (i := r.interval(Fraction(1), is_step))]
        if not any(USUAL_RATES[0] <= i.rate <= USUAL_RATES[1] for i in first):
            units = tuple(u for u in ANY_UNIT if u.is_step == is_step)
    else:
        units = tuple(u for u in ANY_UNIT if is_step is None or u.is_step == is_step)
    intervals = [i for u in units for r in readings(number) if (i := r.interval(u.scale, u.is_step))]
    if len(readings(number)) > 1:
        intervals = [i for i in intervals if USUAL_RATES[0] <= i.rate <= USUAL_RATES[1]] or intervals
    if unit is None and len(units) > 1:
        intervals = [i for i in intervals if PLAUSIBLE_RATES[0] <= i.rate <= PLAUSIBLE_RATES[1]]
    if unit is not None and certainty == POSSIBLY:
        intervals = [i for i in intervals if USUAL_RATES[0] <= i.rate <= USUAL_RATES[1]]
    return tuple(intervals)


def time_statement(
    place: str, rate: float, tolerance: float, is_in_seconds: bool, certainty: int = CERTAIN
) -> Statement:
    """Statement of a time axis.

    Parameters
    ----------
    place : str
        Which column it is.
    rate : float
        Samples per unit of the column.
    tolerance : float
        Relative precision that its digits allow.
    is_in_seconds : bool
        Whether the unit is known to be seconds; else it may be any unit of time.
    certainty : int
        CERTAIN for a column that is named like a time, POSSIBLY for one that only rises evenly.

    Returns
    -------
    Statement
        Its rate.
    """
    scales = TIME_SCALES[:1] if is_in_seconds else TIME_SCALES
    rates = [rate / scale for scale in scales]
    intervals = tuple(around(r, tolerance) for r in rates)
    return Statement(
        place, f"{rate:.9g} samples per {'second' if is_in_seconds else 'unit of time'}", intervals, certainty, True
    )
