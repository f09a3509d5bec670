"""Times that a file states as one number: a count of days, seconds or parts of them since some origin.

One rule serves all formats. A number is a time if exactly one usual count puts it into the years of digital loggers.
What the file declares beside the number selects among the counts: its unit, an origin ("days since 1899-12-30"), the
year of an origin, or the program that counts so. A number that fits several counts is reported, never guessed.
"""

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from fractions import Fraction

from turnout.readers.rate_statements import PLAUSIBLE_RATES
from turnout.readers.rate_units import rate_unit, words_of

FIRST_YEAR = 1990  # of a digital logger; earlier years are epochs of counters (1601, 1904, 1970, 1980)
EPOCHS = (6.3e8, 2.9e9)  # s since 1970: years 1990 to 2061
DAY = Fraction(86400)  # s
TICK = Fraction(1, 10**7)  # s, of Windows


@dataclass(frozen=True)
class Count:
    """A way to count time: ``unit`` [s] since ``origin``; ``at_1970`` is the count at 1970-01-01.

    ``is_utc`` is False for counts of local time. ``words`` beside a number declare the count.
    """

    origin: str
    unit: Fraction
    at_1970: Fraction
    is_utc: bool
    words: frozenset[str]

    def time_of(self, value: Fraction) -> datetime | None:
        """Time of a number, None outside the calendar.

        Parameters
        ----------
        value : Fraction
            The number.

        Returns
        -------
        datetime or None
            To a microsecond.
        """
        try:
            start = datetime(1970, 1, 1) + timedelta(microseconds=round((value - self.at_1970) * self.unit * 10**6))
        except OverflowError:
            return None
        return start.replace(tzinfo=UTC) if self.is_utc else start

    def __str__(self) -> str:
        return f"{UNIT_NAMES[self.unit]} since {self.origin}"


UNIT_NAMES = {
    DAY: "days", Fraction(1): "s", Fraction(1, 10**3): "ms", Fraction(1, 10**6): "µs", Fraction(1, 10**9): "ns",
    TICK: "0.1 µs",
}  # fmt: skip


def _count(origin: str, unit: Fraction, at_1970: float, is_utc: bool, words: str) -> Count:
    return Count(origin, unit, Fraction(at_1970), is_utc, frozenset(words.split()))


COUNTS = (
    *(_count("1970-01-01", Fraction(1, 10**power), 0, True, "unix posix epoch") for power in (0, 3, 6, 9)),
    _count("the year 0 (MATLAB)", DAY, 719529, False, "matlab datenum"),
    _count("1899-12-30", DAY, 25569, False, "excel ole"),
    _count("1904-01-01", DAY, 24107, False, "excel"),
    _count("1904-01-01", Fraction(1), 2082844800, True, "labview"),
    _count("the Julian day 0", DAY, 2440587.5, True, "julian jd"),
    _count("1601-01-01", TICK, 116444736 * 10**9, True, "filetime windows"),
    _count("the year 1 (.NET)", TICK, 621355968 * 10**9, False, "ticks"),
)
# Counts whose numbers are also those of others: only the word declares them.
DECLARED_ONLY = (_count("the modified Julian day 0", DAY, 40587, True, "mjd"),)
UNREADABLE_WORDS = frozenset(("gps", "tai"))  # scales of time without leap seconds
MAX_OFFSET = 14 * 3600  # s: no time zone is further from UTC, and each by whole quarters of an hour
ORIGIN_YEARS = {"1601": "1601", "1899": "1899", "1900": "1899", "1904": "1904", "1970": "1970"}
SINCE = re.compile(r"([^\W\d_]+) +(?:since|seit|depuis|siden|sedan|sinds|desde|dal|od) +(.+?)[\])]?$")
ORIGIN = re.compile(
    r"(\d{4})(?:-(\d{1,2})-(\d{1,2}))?(?:[ T](\d{1,2}):(\d{1,2})(?::(\d{1,2})(\.\d*)?)?)?"
    r" ?(?:Z|UTC)?(?:([+-]\d{1,2})(?::?(\d{2}))?)?",
)
# Digits that begin with a day of these years and go on: of 13 or 16 digits they may count ms or µs as well.
DATE_IN_FRONT = re.compile(r"(?:199\d|20[0-5]\d)(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])\d")
DIGITS_OF_TIME = re.compile(r"(\d{4})(\d\d)(\d\d)(\d\d)(\d\d)(\d\d)(?:\.0*)?")


def time_of_number(value: float, declared: str = "", step: float | None = None) -> tuple[datetime | None, str]:
    """Time that a number states, or what is unclear about it.

    Parameters
    ----------
    value : float or int
        The number.
    declared : str
        What stands beside it: its name and unit.
    step : float or None
        Step to the next number if the number is the first of a time axis; None for a single number.

    Returns
    -------
    tuple of (datetime or None, str)
        The time, in UTC or without a zone; without a time, the counts that are possible, "" if there is none.

    Examples
    --------
    >>> time_of_number(1.7786664e12)
    (datetime.datetime(2026, 5, 13, 10, 0, tzinfo=datetime.timezone.utc), '')
    >>> time_of_number(46155.5)
    (None, '46155.5: days since 1899-12-30 or days since 1904-01-01?')
    >>> time_of_number(46155.5, "Date [days since 1899-12-30]")[0].isoformat(), time_of_number(12.5)
    ('2026-05-13T12:00:00+00:00', (None, ''))
    """
    if isinstance(value, bool) or not math.isfinite(value):
        return None, ""
    number = Fraction(value)
    if number.denominator == 1 and step is None and (date := DATE_IN_FRONT.match(str(number.numerator))):
        written = time_of_digits(date.string)
        return written, "" if written else f"{value}: a date or a count?"
    counts = _declared_counts(declared)
    if counts is None:
        return None, f"{value} ({declared})"
    times = _possible_times(counts, value, step)
    if len(times) == 1:
        return next(iter(times.values())), ""
    return None, f"{value}: {' or '.join(map(str, times))}?" if times else ""


def is_unset(stamp: datetime | None) -> bool:
    """Whether a time stamp is that of a clock that was never set: it counts from an epoch, and states no start.

    Parameters
    ----------
    stamp : datetime or None
        The time stamp.

    Returns
    -------
    bool
        False without one.

    Examples
    --------
    >>> is_unset(datetime(1904, 1, 1)), is_unset(datetime(1970, 1, 1, 0, 12, 34)), is_unset(datetime(2026, 5, 13))
    (True, True, False)
    """
    return stamp is not None and stamp.year < FIRST_YEAR


def unit_of_axis(first: float, declared: str, step: float) -> Fraction | None:
    """Unit of a time axis of numbers, if exactly one usual count puts its first number into the years of loggers.

    Parameters
    ----------
    first : float or int
        First number of the axis.
    declared : str
        Name and unit of the axis.
    step : float
        Step to the next number.

    Returns
    -------
    Fraction or None
        The unit; None for an axis that counts from another origin, or that fits several counts. [s]

    Examples
    --------
    >>> unit_of_axis(1778666400000000, "timestamp", 1000), unit_of_axis(0.0, "time", 0.001)
    (Fraction(1, 1000000), None)
    """
    times = _possible_times(_declared_counts(declared) or (), first, step) if math.isfinite(first) else {}
    return next(iter(times)).unit if len(times) == 1 else None


def _possible_times(counts: tuple[Count, ...], value: float, step: float | None) -> dict[Count, datetime]:
    """Time of a number by each count that is possible."""
    number = Fraction(value)
    return {count: time for count in counts if (time := _time(count, number, value)) and _is_axis(count, step)}


def is_declared(declared: str) -> bool:
    """Whether the words beside a number say how it counts time: an origin, or the program that counts so.

    Parameters
    ----------
    declared : str
        Name and unit of the number.

    Returns
    -------
    bool
        False for a unit alone.
    """
    known = frozenset().union(*(count.words for count in (*COUNTS, *DECLARED_ONLY))) | UNREADABLE_WORDS
    return bool(SINCE.search(declared)) or not known.isdisjoint(words_of(declared))


def _time(count: Count, number: Fraction, value: float) -> datetime | None:
    """Time of a number by one count, to the digits that it has; None outside the years of loggers."""
    seconds = (number - count.at_1970) * count.unit
    if not EPOCHS[0] <= seconds <= EPOCHS[1]:
        return None
    if isinstance(value, float) and (resolution := math.ulp(value) * float(count.unit)) > 1e-6:
        seconds = Fraction(round(float(seconds), -math.ceil(math.log10(resolution))))
    return count.time_of(seconds / count.unit + count.at_1970)


def _is_axis(count: Count, step: float | None) -> bool:
    """Whether a step is that of a sampled record; rounded times may stand still."""
    return step is None or 0.0 <= step * float(count.unit) * PLAUSIBLE_RATES[0] <= 1.0


def _declared_counts(declared: str) -> tuple[Count, ...] | None:
    """The counts that the words beside a number leave; none if it counts from an event, None if it is not readable."""
    if since := SINCE.search(declared):
        unit = rate_unit(since[1])
        origin = ORIGIN.fullmatch(since[2].strip())
        if unit is None or not unit.is_step or not origin:
            return None if re.search(r"\d", since[2]) else ()
        return _count_since(unit.scale, origin)
    words = words_of(declared)
    if not UNREADABLE_WORDS.isdisjoint(words):
        return None
    counts = tuple(count for count in (*COUNTS, *DECLARED_ONLY) if not count.words.isdisjoint(words)) or COUNTS
    years = {ORIGIN_YEARS[year] for year in re.findall(r"(?<!\d)\d{4}(?!\d)", declared) if year in ORIGIN_YEARS}
    counts = tuple(count for count in counts if not years or count.origin[:4] in years)
    unit = rate_unit(words[-1]) if words else None
    return tuple(count for count in counts if unit is None or not unit.is_step or count.unit == unit.scale)


def _count_since(unit: Fraction, origin: re.Match[str]) -> tuple[Count, ...]:
    """The count of a unit [s] since a declared time, which is in UTC or has an offset from it."""
    *day_and_time, fraction, hours, minutes = origin.groups()
    offset = 3600 * int(hours or 0) + 60 * int(f"{(hours or '+')[0]}{minutes or 0}")
    fields = [int(field or default) for field, default in zip(day_and_time, (0, 1, 1, 0, 0, 0))]
    if abs(offset) > MAX_OFFSET or offset % 900:
        return ()
    try:
        start = datetime(*fields)  # type: ignore[misc, arg-type]
    except ValueError:
        return ()
    seconds = Fraction(round((datetime(1970, 1, 1) - start).total_seconds()) + offset)
    seconds -= Fraction(f"0{fraction or '.'}0")
    return (Count(origin[0], unit, seconds / unit, True, frozenset()),)


def time_of_digits(text: str) -> datetime | None:
    """Time of a text of 14 digits, YYYYMMDDhhmmss; None for any other.

    Parameters
    ----------
    text : str
        The digits.

    Returns
    -------
    datetime or None
        Without a zone.

    Examples
    --------
    >>> time_of_digits("20260513100000"), time_of_digits("20260513106000")
    (datetime.datetime(2026, 5, 13, 10, 0), None)
    """
    match = DIGITS_OF_TIME.fullmatch(text)
    try:
        return datetime(*map(int, match.groups())) if match else None  # type: ignore[arg-type]
    except ValueError:
        return None
