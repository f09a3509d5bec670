"""The sampling rate on which all statements of a record and the layout agree, or the error that they do not."""

from collections.abc import Sequence

from turnout.errors import ReadError
from turnout.readers.precision import EXACT_PRECISION, Interval, around
from turnout.readers.rate_statements import MAX_CLOCK_DRIFT, USUAL_RATES, Statement
from turnout.readers.rate_vocabulary import CERTAIN, POSSIBLY
from turnout.readers.source import RawRecord, Source

MAX_WIDTH = 1e-3  # relative: a statement of fewer digits does not tell the rate; the layout or another one must


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
    certain = [s for s in statements if s.certainty == CERTAIN]
    is_stated = any(s.intervals for s in certain)
    for statement in statements:
        if not statement.intervals and statement.is_defined and not is_stated:
            problem = f"{statement.text!r} in {statement.place} states no rate, and nothing else does"
            name = statement.text.partition(": ")[0]
            remedy = f"{STEP_REMEDY}, 'checked_entries: {name}'"
            raise source.error(where, problem, remedy, reason="wrong_rate")
        if not statement.intervals and not statement.is_defined:
            problem = f"{statement.text!r} in {statement.place} may state the sampling rate and is not understood"
            remedy = "Write it as a number with its unit (Hz, kHz, s, ms, µs), or remove it if it means something else"
            raise source.error(where, problem, remedy, reason="wrong_rate")
    certain = [s for s in certain if s.intervals]
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


STEP_REMEDY = (
    "Export the record again with its rate or a column of the time; if the layout's rate is right, name the entry there"
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
                "Correct the rate in the layout; if the column is no time, give it the unit of its quantity in the "
                "layout, or name it under 'checked_entries'"
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


ABSCISSA_REMEDY = "Export the channel over the time, in s"


def check_unknown_step(
    record: RawRecord, statements: Sequence[Statement], promised: float | None, where: str, source: Source
) -> None:
    """Check that a step in a unit that is not known is one in s: the layout or another statement has that rate.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    statements : sequence of Statement
        All statements of the file about the sampling rate; they are compared with each other elsewhere.
    promised : float or None
        Rate that the layout states, or None. [Hz]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If the layout has another rate, or nothing else states one.
    """
    steps = [s for s in statements if s.is_defined and s.intervals]
    if not record.unknown_step or not steps:
        return
    problem = f"the unit {record.unknown_step!r} of its step is not known"
    if promised is None:
        if not any(s.certainty == CERTAIN and s.intervals and not s.is_defined for s in statements):
            remedy = f"{ABSCISSA_REMEDY}, or give the rate in the layout"
            raise source.error(where, f"{problem}, and nothing else states the rate", remedy, "wrong_rate")
        return
    layout = around(promised, EXACT_PRECISION)
    if other := next((s for s in steps if not s.agrees_with(layout)), None):
        problem = f"{problem}: in s it is {other.usual.rate:.9g} Hz, instead of {promised:.9g} Hz of the layout"
        raise source.error(where, problem, ABSCISSA_REMEDY, "wrong_rate")
