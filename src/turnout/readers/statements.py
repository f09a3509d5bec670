"""All statements of a file about its sampling rate, compared with each other and with the layout.

A reader hands over every entry of the metadata that belongs to a record, each with its place. Entries whose name or
value speaks of a rate, a step or an interval become statements (``rate_words``), with the precision of their printed
numbers (``precision``); time axes and evenly rising columns are statements as well. The most precise statement holds.
A statement that contradicts it beyond rounding, and an entry that may be a rate and is not understood, are errors.
"""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.other_subjects import STRONG, subject_of
from turnout.readers.precision import EXACT_PRECISION, NUMBER, Interval, around, readings
from turnout.readers.rate_words import CERTAIN, NOT, POSSIBLY, RateUnit, name_meaning, rate_unit, reduction_of_name
from turnout.readers.scale_words import is_of_drawing, scale_meaning, value_of_word
from turnout.readers.source import Source

MAX_CLOCK_DRIFT = 1e-4  # relative: two clocks of one logger with separate crystals may differ by this much
PLAUSIBLE_RATES = (10.0, 1e8)  # Hz: no vibration is sampled outside; a possible statement outside means something else
USUAL_RATES = (100.0, 1e6)  # Hz: "25.600" is 25600 and not 25.6; a number without unit outside may have another one
MIN_EPOCH = 10**8  # s since 1970
MAX_WIDTH = 1e-3  # relative: a statement of fewer digits does not tell the rate; the layout or another one must
MAX_ENTRIES = 64  # numbers of a list: longer ones are samples
MAX_TEXT = 4000  # characters of a text that are searched
PLACEHOLDERS = {"", "-", "none", "n/a", "na", "?", "unknown", "nan", "null", "undefined", "not set", "unset", "[]"}
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
class Entry:
    """An entry of the metadata: ``value`` (text, number, list, mapping) under ``name``; ``place`` is where it is.

    ``is_defined`` is True if the format defines it: then it is about the samples as they are in the file. ``is_piece``
    is True for a part of a free text that is an entry as well.
    """

    place: str
    name: str
    value: Any
    is_defined: bool = False
    is_piece: bool = False


FREE_TEXT = "text"  # name of an entry that holds a whole text, beside the entries of its pieces


@dataclass(frozen=True)
class Statement:
    """A statement about the sampling rate: where it is, as it is written, and the intervals it may mean.

    The first of ``intervals`` is the usual meaning; without any it is not understood. ``certainty`` is CERTAIN or
    POSSIBLY. ``is_clock`` marks a time axis, whose clock may drift. ``factor`` above 1 is one by which the file states
    that samples were left out: its rate may be the one before.
    """

    place: str
    text: str
    intervals: tuple[Interval, ...]
    certainty: int = CERTAIN
    is_clock: bool = False
    factor: int = 1

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


def rate_entry(place: str, rate: Any) -> Entry:
    """Entry of a rate [Hz] that the format itself defines.

    Parameters
    ----------
    place : str
        Where the format states it.
    rate : any
        Number, or text as it is printed. [Hz]

    Returns
    -------
    Entry
        Under a name that is understood.
    """
    return Entry(place, "sampling rate [Hz]", rate, is_defined=True)


def step_entry(place: str, step: Any, unit: str = "s") -> Entry:
    """Entry of a time step that the format itself defines.

    Parameters
    ----------
    place : str
        Where the format states it.
    step : any
        Number, or text as it is printed.
    unit : str
        A unit of time; any other text counts as seconds.

    Returns
    -------
    Entry
        Under a name that is understood.
    """
    known = rate_unit(unit)
    return Entry(place, f"sampling interval [{unit if known and known.is_step else 's'}]", step, is_defined=True)


def entries_of(variables: Mapping[Any, Any], place: str) -> Iterator[Entry]:
    """Entries of nested metadata: mappings, lists of them, and texts that hold JSON.

    Parameters
    ----------
    variables : mapping
        Name -> value.
    place : str
        Where it is in the file, for messages, "" for the file itself.

    Yields
    ------
    Entry
        Every text, number and short list of numbers.
    """
    for name, value in variables.items():
        name = str(name)
        path = f"{place}/{name}" if place else name
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if isinstance(value, (str, bytes)):
            text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
            value = _decode_json(text)
        if isinstance(value, Mapping):
            yield from entries_of(value, path)
        elif isinstance(value, (list, tuple)) and any(isinstance(v, Mapping) for v in value):
            for i, v in enumerate(value):
                if isinstance(v, Mapping):
                    yield from entries_of(v, f"{path}[{i}]")
        elif value is not None and not isinstance(value, ReadError) and getattr(value, "size", 1) <= MAX_ENTRIES:
            yield Entry(path, name, value)


def _decode_json(text: str) -> Any:
    """The mapping or list that a text holds as JSON, else the text."""
    if not text.lstrip().startswith(("{", "[")):
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text


# "name: value" with a word, numbers without unit, or a ratio as its value.
NAMED_PIECE = re.compile(
    r"(?:[^\d:=]*:)?\s*([^\W\d][^:=]{1,40}?)\s*[:=]\s*"
    r"([+-]?[.,]?\d[^:=]{0,30}?|[^\W\d]{1,20}\.?|[-+]|[x×]\s?\d+|\d+\s?:\s?\d+)\s*"
)

RATIO_PIECE = re.compile(  # "scale 1:500 map"
    r"(?:([^\d:=]*):)?([^\d:=]*[^\W\d])[\s:=]+(1\s?[:/]\s?\d+[^\d:=]{0,30})"
)
MAX_RATIO_PIECE = 100  # characters: a longer piece is a description


def entries_of_text(text: str, place: str) -> Iterator[Entry]:
    """Entries of a free text such as a comment: its pieces with a number, "sampled at 25.6 kHz; tip: steel".

    Parameters
    ----------
    text : str
        One or several lines.
    place : str
        Where it is, for messages.

    Yields
    ------
    Entry
        Words before (else after) the number as the name; the number with its unit as the value.

    Examples
    --------
    >>> [(e.name, e.value) for e in entries_of_text("hammer 3; sampled at 25.6 kHz, tip=steel", "comment")]
    [('hammer', '3'), ('sampled at', '25.6 kHz')]
    """
    for piece in map(str.strip, re.split(r"[;\n\r|]|,\s", text[:MAX_TEXT])):
        ratio = RATIO_PIECE.fullmatch(piece) if len(piece) <= MAX_RATIO_PIECE else None
        if ratio and scale_meaning(ratio[2]):
            subject = f"{ratio[1]} " if is_of_drawing(ratio[1] or "") else ""
            yield Entry(place, subject + ratio[2].strip(), ratio[3].strip(), is_piece=True)
            continue
        named = NAMED_PIECE.fullmatch(piece)
        if named and (re.search(r"\d", named[2]) or value_of_word(scale_meaning(named[1]), named[2]) is not None):
            yield Entry(place, named[1].strip(), named[2].strip(), is_piece=True)
            continue
        match = re.fullmatch(rf"\s*([^\d]*?)[\s:=,@~≈#]*({NUMBER.pattern})\s*([^\d]*?)[\s.]*", piece)
        if not match or not (match[1] or match[3]):
            continue
        words = match[3].split()
        n_unit = next((n for n in (3, 2, 1) if rate_unit(" ".join(words[:n])) and len(words) >= n), 1)
        name = match[1].strip() or " ".join(words[n_unit:]) or "number"
        yield Entry(place, name, f"{match[2]} {' '.join(words[:n_unit])}".strip(), is_piece=True)


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
    found: dict[tuple[str, str], tuple[Statement, str, bool]] = {}
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
                found.setdefault((entry.place, statement.text), (statement, entry.place, is_final))
    factor = math.prod(factors.values())
    return [_at_place(statement, place, 1 if is_final else factor) for statement, place, is_final in found.values()]


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
    return [v.decode("utf-8", "replace") if isinstance(v, bytes) else v for v in values]


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
    shown = f"{entry.name}: {text[:40]}"
    number, unit_text = _split(text) if isinstance(value, str) else (value, "")
    if number is None:
        if meaning.certainty == CERTAIN and text.casefold() not in PLACEHOLDERS and not _is_dated(text):
            yield Statement(entry.place, shown, (), CERTAIN)
        elif meaning.certainty != CERTAIN and isinstance(value, str):
            pieces = [e for e in entries_of_text(text, entry.place) if (e.name, e.value) != (entry.name, text)]
            for piece in pieces:
                yield from _statements_of_piece(piece)
        return
    unit = rate_unit(unit_text) if unit_text else meaning.unit
    certainty = meaning.certainty
    if certainty == NOT and unit is not None:
        other = name_meaning(f"{entry.name} [{unit_text}]") if unit_text else meaning
        certainty = other.certainty
    if certainty == NOT:
        return
    if unit is not None and unit.is_sampling and certainty == POSSIBLY:
        certainty = CERTAIN  # nothing else is counted in samples per second
    is_unknown = bool(unit_text or meaning.unknown_unit) and unit is None
    intervals = () if is_unknown else _intervals(number, unit, meaning.is_step, certainty)
    if not intervals and meaning.is_step and any(r.value >= MIN_EPOCH for r in readings(number)):
        return  # "ts: 1715587200" is a time of day
    if certainty == CERTAIN and not isinstance(value, str) and not np.isfinite(value):
        yield Statement(entry.place, shown, (), CERTAIN)
    elif intervals or certainty == CERTAIN:
        yield Statement(entry.place, shown, intervals, certainty)


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
    number, rest = match[0].rstrip(".,' "), text[match.end() :].strip()
    if rest[:1].isdigit() or (rest[:1] in ("-", ":", "/") and rest[1:2].isdigit()) or len(rest) > 40:
        return None, ""
    rest = re.split(r"[;,(]", rest)[0].strip() if rate_unit(rest) is None else rest
    return number, rest


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


def resolve(statements: Sequence[Statement], promised: float | None, where: str, source: Source) -> float:
    """The sampling rate on which all statements of a record and the layout agree to within rounding.

    Parameters
    ----------
    statements : sequence of Statement
        All statements of the file about the record.
    promised : float or None
        Rate that the layout states, or None. [Hz]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    float
        Rate of the layout; without one, that of the most precise statement. [Hz]

    Raises
    ------
    ReadError
        If nothing states the rate, a statement is not understood, or two contradict each other beyond rounding.
    """
    for statement in statements:
        if not statement.intervals:
            problem = f"{statement.text!r} in {statement.place} may state the sampling rate and is not understood"
            remedy = "Write it as a number with its unit (Hz, kHz, s, ms, µs), or remove it if it means something else"
            raise source.error(where, problem, remedy, reason="wrong_rate")
    certain = [s for s in statements if s.certainty == CERTAIN]
    layout = None if promised is None else around(promised, EXACT_PRECISION)
    holding = _most_precise(certain, layout, where, source)
    if holding is None:
        if layout is None:
            raise _no_rate_error(statements, where, source)
        _check_axes(statements, layout, where, source)
        _check_possible(statements, layout, where, source)
        return float(layout.rate)
    statement, interval = holding
    _check_axes(statements, interval.widen(MAX_CLOCK_DRIFT if statement.is_clock else 0.0), where, source)
    if layout is None and len(_common_meanings(certain)) > 1 and statement.factor > 1:
        raise source.error(where, _reduction_problem(statement), RATE_REMEDY, reason="wrong_rate")
    if layout is not None:
        drift = MAX_CLOCK_DRIFT if statement.is_clock else 0.0
        if not interval.widen(drift).overlaps(layout):
            raise source.error(
                where,
                f"sampled at {interval.rate:.9g} Hz instead of {layout.rate:.9g} Hz, by {statement}",
                "Correct the rate in the layout, or find out why the logger was set differently",
                reason="wrong_rate",
            )
        return float(layout.rate)
    if interval.width > MAX_WIDTH:
        problem = (
            f"{statement.text!r} in {statement.place} has too few digits: {interval.low:.6g} to {interval.high:.6g} Hz"
        )
        raise source.error(where, problem, RATE_REMEDY, reason="wrong_rate")
    whole = round(interval.rate)
    is_unique = interval.rate * interval.width < 0.5
    is_within = max(interval.low, whole * (1 - 1e-12)) <= min(interval.high, whole * (1 + 1e-12))
    return float(whole) if is_unique and is_within else interval.rate


def _common_meanings(certain: Sequence[Statement]) -> list[Interval]:
    """The meanings of the first statement with which all others agree."""
    return [i for i in certain[0].intervals if all(s.agrees_with(i) for s in certain[1:])]


def _reduction_problem(statement: Statement) -> str:
    before, after = statement.intervals[0].rate, statement.intervals[-1].rate
    return (
        f"{statement} may be the rate before a reduction by {statement.factor}, which the file states as well: its "
        f"samples may be at {before:.9g} or {after:.9g} Hz"
    )


def rate_remark(statements: Sequence[Statement], rate: float, where: str, source: Source) -> ReadError | None:
    """Remark on a record whose file states a rate before a reduction that nothing else confirms.

    Parameters
    ----------
    statements : sequence of Statement
        All statements of the file about the record.
    rate : float
        Rate with which it is read. [Hz]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    ReadError or None
        None if nothing is in doubt.
    """
    certain = [s for s in statements if s.certainty == CERTAIN and s.intervals]
    if not any(s.factor > 1 for s in certain) or len(meanings := _common_meanings(certain)) < 2:
        return None
    if meanings[-1].loose.overlaps(around(rate, EXACT_PRECISION)):
        return None
    problem = f"{_reduction_problem(certain[0])}; {rate:.9g} Hz is used"
    return source.error(
        where, problem, "Find out which it is, and correct the rate in the layout", reason="rate_ambiguous"
    )


RATE_REMEDY = "Give the rate in the layout, or as hammer_rate_hz or passage_rate_hz in turnouts.tsv"


def _most_precise(
    certain: Sequence[Statement], layout: Interval | None, where: str, source: Source
) -> tuple[Statement, Interval] | None:
    """The most precise statement and its meaning; ReadError if another one contradicts it."""
    if not certain:
        return None

    def width(statement: Statement) -> float:
        return statement.usual.loose_width + (MAX_CLOCK_DRIFT if statement.is_clock else 0.0)

    ordered = sorted(certain, key=width)
    first = ordered[0]
    interval = first.meaning_near(layout) if layout is not None else None
    if interval is None:
        agreeing = [i for i in first.intervals if all(s.agrees_with(i) for s in ordered[1:])]
        interval = agreeing[0] if agreeing else first.usual
        is_usual = first.is_clock and USUAL_RATES[0] <= interval.rate <= USUAL_RATES[1]
        if layout is None and len(first.intervals) > 1 and not is_usual and len(ordered) == 1:
            meanings = " or ".join(f"{i.rate:.9g} Hz" for i in first.intervals)
            problem = f"{first.text!r} in {first.place} may mean {meanings}"
            problem = _reduction_problem(first) if first.factor > 1 else problem
            raise source.error(where, problem, RATE_REMEDY, reason="wrong_rate")
    drift = MAX_CLOCK_DRIFT if first.is_clock else 0.0
    for other in ordered[1:]:
        if not other.agrees_with(interval.widen(drift)):
            remedy = "Find out which of them is right and export the record again with that one alone"
            if first.is_clock and other.is_clock:
                remedy = (
                    "If its columns were sampled at two rates, export all at one rate, or each rate to its own file"
                )
            raise source.error(where, f"two rates: {first}, and {other}", remedy, reason="wrong_rate")
    return first, interval


def _check_axes(statements: Sequence[Statement], interval: Interval, where: str, source: Source) -> None:
    """ReadError if a column that rises evenly does so at another rate than ``interval``, in every unit of time."""
    for statement in statements:
        if statement.is_clock and statement.certainty == POSSIBLY and not statement.agrees_with(interval):
            problem = (
                f"{statement.place} may be a time axis of {statement.usual.rate:.9g} samples per unit of time, which "
            )
            problem += f"is {interval.rate:.9g} Hz in no unit"
            remedy = (
                "Correct the rate in the layout; if the column is no time, give it a unit in the layout or the file"
            )
            raise source.error(where, problem, remedy, reason="wrong_rate")


MAX_RATE_RATIO = 64.0  # a frequency or a time that differs more from the rate in use is one of something else


def is_near_rate(rate: float, reference: float) -> bool:
    """Whether a stated frequency may be meant as the sampling rate.

    Parameters
    ----------
    rate : float
        The frequency. [Hz]
    reference : float
        Rate in use. [Hz]

    Returns
    -------
    bool
        False if they differ by a factor above ``MAX_RATE_RATIO``.
    """
    return reference / MAX_RATE_RATIO <= rate <= reference * MAX_RATE_RATIO


def _check_possible(statements: Sequence[Statement], layout: Interval, where: str, source: Source) -> None:
    """ReadError if statements that may be about the rate exist and none of them agrees with the layout."""
    possible = [s for s in statements if s.certainty == POSSIBLY and not s.is_clock]
    possible = [s for s in possible if any(is_near_rate(i.rate, layout.rate) for i in s.intervals)]
    if possible and not any(s.meaning_near(layout) for s in possible):
        entry = f"{possible[0].text!r} in {possible[0].place}"
        problem = f"{entry} may be a sampling rate, and the layout's is {layout.rate:.9g} Hz"
        remedy = (
            f"Correct the rate in the layout; if that entry means something else, write 'rate: {layout.rate:.9g}' "
            "into the file"
        )
        raise source.error(where, problem, remedy, reason="wrong_rate")


def _no_rate_error(statements: Sequence[Statement], where: str, source: Source) -> ReadError:
    problem = "neither the file nor the layout says the sampling rate"
    if statements:
        problem += f"; {statements[0].text!r} in {statements[0].place} may"
    return source.error(where, problem, RATE_REMEDY, reason="wrong_rate")
