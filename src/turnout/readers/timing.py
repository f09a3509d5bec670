"""Timing of records: rate and evenness of a time column, start times and the simultaneity of channels."""

import math
import re
import unicodedata
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np

from turnout.errors import ReadError
from turnout.readers.precision import TEXT_PRECISION
from turnout.readers.source import BLOCK_SIZE, Source
from turnout.readers.statements import MAX_CLOCK_DRIFT

STEP_SAMPLES = 2**21  # samples whose median step is the usual step


def rate_of_time(time: np.ndarray) -> tuple[float, float, int | None]:
    r"""Sampling rate of a time column, and the relative precision its digits allow.

    .. math:: f_s = \frac{n - 1}{t_{n-1} - t_0}, \quad
        \mathrm{tolerance} = 2 \max_k \frac{|t_k - t_0 - k / f_s|}{t_{n-1} - t_0}

    Parameters
    ----------
    time : (n,) array of float
        Increasing. [s]

    Returns
    -------
    rate : float
        [Hz]
    tolerance : float
    gap : int or None
        Sample after which time jumps by more than half a step (samples are missing), None if there is none.

    Examples
    --------
    >>> rate, tolerance, gap = rate_of_time(np.array([0.0, 0.01, 0.02, 0.05, 0.06]))
    >>> gap
    2
    """
    time = np.asarray(time, dtype=float)
    span = time[-1] - time[0]
    step = float(np.median(np.diff(time[:STEP_SAMPLES])))
    for start, block in _blocks(time):
        jumps = np.abs(np.diff(block) - step) > 0.5 * step
        if jumps.any():
            return 1.0 / step, 1e-9, start + int(np.argmax(jumps))
    rate = (time.size - 1) / span
    deviation = max(
        np.abs(block - time[0] - np.arange(start, start + block.size) / rate).max() for start, block in _blocks(time)
    )
    return float(rate), float(max(2 * deviation / span, 1e-9)), None


def _blocks(time: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """(first index, samples) of consecutive blocks that share one sample; so hours need little memory."""
    for start in range(0, max(time.size - 1, 1), BLOCK_SIZE):
        yield start, time[start : start + BLOCK_SIZE + 1]


def check_time(time: np.ndarray, where: str, source: Source) -> None:
    """Check that a time column increases evenly.

    Parameters
    ----------
    time : (n,) array of float
        The time column. [s]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If it runs backwards, is not finite, jumps over missing samples, or is not even.
    """
    for start, block in _blocks(time):
        if not np.isfinite(block).all():
            problem = f"the time of sample {start + int(np.argmin(np.isfinite(block)))} is not a number"
            raise source.error(where, problem, reason="not_finite")
    backwards = (start + int(np.argmax(b)) for start, block in _blocks(time) if (b := np.diff(block) <= 0).any())
    if (k := next(backwards, None)) is not None:
        problem = (
            f"the clock runs backwards or stands still: sample {k} at {time[k]:.9g} s, the next at {time[k + 1]:.9g} s"
        )
        remedy = "Check the logger's clock and export the record again"
        raise source.error(where, problem, remedy, reason="clock_backwards")
    rate, _, gap = rate_of_time(time)
    if gap is not None:
        raise source.error(
            where,
            f"time jumps from {time[gap]:.9g} s to {time[gap + 1]:.9g} s at {rate:.6g} Hz: samples are missing",
            "Copy the file again from the logger; if the gap is there too, the logger lost samples",
            reason="truncated",
        )
    _check_even(time, rate, where, source)


def _check_even(time: np.ndarray, rate: float, where: str, source: Source) -> None:
    """ReadError if time deviates from a straight line by more than one step plus the drift of a crystal.

    Rounding to printed digits stays within one step, or time would stand still. Each block has its own line, because
    over hours the temperature shifts a crystal by many steps.
    """
    for start, block in _blocks(time):
        steps = np.arange(block.size)
        offsets = np.abs((block - block[0]) * rate - steps)
        if (is_uneven := offsets > 1.0 + MAX_CLOCK_DRIFT * steps).any():
            k = int(np.argmax(is_uneven))
            problem = (
                f"its time column is not even: sample {start + k}, at {block[k]:.9g} s, is {offsets[k]:.3g} steps from "
                f"where {rate:.6g} Hz put it"
            )
            remedy = "Check the logger's clock, or export the record at an even rate"
            raise source.error(where, problem, remedy, reason="wrong_rate")


TIME_FORMAT = "%Y-%m-%d %H:%M:%S.%f"


def to_utc(stamp: datetime | None, time_zone: str) -> datetime | None:
    """Naive UTC of a file's start time; a time stamp without a zone is in ``time_zone`` (IANA name).

    Parameters
    ----------
    stamp : datetime or None
        Start time that the file states, or None.
    time_zone : str
        IANA name of the zone of a time stamp without one.

    Returns
    -------
    datetime or None
        Naive UTC; None without a time stamp, or for one that no calendar has.

    Examples
    --------
    >>> from datetime import datetime
    >>> to_utc(datetime(2024, 5, 13, 12, 0), "Europe/Zurich")
    datetime.datetime(2024, 5, 13, 10, 0)
    """
    if stamp is None:
        return None
    if stamp.tzinfo is None:
        stamp = stamp.replace(tzinfo=ZoneInfo(time_zone))
    try:
        return stamp.astimezone(UTC).replace(tzinfo=None)
    except OverflowError:  # a damaged stamp in the year 1 or 9999
        return None


def start_times(stamps: Iterable[tuple[int, datetime | None]], time_zone: str) -> list[tuple[int, datetime | None]]:
    """Start times of the records of one file in UTC.

    In the hour that comes twice in autumn a stamp means the first one, unless the record would precede its predecessor.

    Parameters
    ----------
    stamps : iterable of tuple of (int, datetime or None)
        (record, time stamp) in the order of the file.
    time_zone : str
        IANA name of the zone of time stamps without one.

    Returns
    -------
    list of tuple of (int, datetime or None)
        (record, naive UTC) in the same order.

    Examples
    --------
    >>> from datetime import datetime
    >>> stamps = enumerate([datetime(2024, 10, 27, 2, 55), datetime(2024, 10, 27, 2, 5)])
    >>> [f"{start:%H:%M}" for _, start in start_times(stamps, "Europe/Copenhagen")]
    ['00:55', '01:05']
    """
    starts: list[tuple[int, datetime | None]] = []
    latest: datetime | None = None
    for record, stamp in stamps:
        start = to_utc(stamp, time_zone)
        if stamp and start and latest and start < latest and stamp.tzinfo is None:
            second = to_utc(stamp.replace(fold=1), time_zone)
            start = second if second is not None and second >= latest else start
        starts.append((record, start))
        latest = start if latest is None or (start is not None and start > latest) else latest
    return starts


def check_order(starts: Sequence[tuple[int, datetime | None]], source: Source) -> dict[int, ReadError]:
    """Errors of the fewest records without which all others are in order of time.

    Parameters
    ----------
    starts : sequence of tuple of (int, datetime or None)
        (record, naive UTC) in the order of the file.
    source : Source
        The raw file.

    Returns
    -------
    dict of int to ReadError
        Number of the record -> its error.
    """
    errors: dict[int, ReadError] = {}
    timed = [(record, start) for record, start in starts if start is not None]
    ordered = _longest_ordered([start for _, start in timed])
    for i, (record, start) in enumerate(timed):
        n = bisect_left(ordered, i)
        if n < len(ordered) and ordered[n] == i:
            continue
        if n and start < (previous := timed[ordered[n - 1]][1]):
            where = f"before the record in front of it ({previous:{TIME_FORMAT}})"
        else:
            where = f"after a record behind it ({timed[ordered[n]][1]:{TIME_FORMAT}})"
        problem = f"it began at {start:{TIME_FORMAT}}, {where}"
        remedy = "Check the logger's clock and the time zone in the layout"
        errors[record] = source.error(f"record {record + 1}", problem, remedy, reason="clock_backwards")
    return errors


def _longest_ordered(starts: Sequence[Any]) -> list[int]:
    """Indices of the longest non-decreasing subsequence of ``starts``; of several, the earliest.

    >>> _longest_ordered([2099, 2001, 2002, 1970, 2002])
    [1, 2, 4]
    """
    rank = {start: -k for k, start in enumerate(sorted(set(starts)))}
    ends: list[int] = []  # ends[n]: rank of the latest first start of all subsequences of n + 1 starts
    n_following = [0] * len(starts)  # length of the longest subsequence from here on, this start included
    for i in reversed(range(len(starts))):
        k = bisect_right(ends, rank[starts[i]])
        ends[k : k + 1] = [rank[starts[i]]]
        n_following[i] = k + 1
    ordered: list[int] = []
    for i, start in enumerate(starts):
        if n_following[i] == len(ends) - len(ordered) and (not ordered or start >= starts[ordered[-1]]):
            ordered.append(i)
    return ordered


PLAUSIBLE_YEARS = (1990, 2060)  # of a digital logger; other years are epochs of counters (1904, 1970, 1980)
CLOCK_REMEDY = "Check the logger's clock; give the campaign or the time in the file's name"
NO_START = {"", "-", "none", "n/a", "?", "unknown", "nan", "nat", "null", "0", "0.0"}


def start_fields(*values: Any) -> dict[str, Any]:
    """Fields ``started_at`` and ``unread_start`` of a RawRecord.

    Parameters
    ----------
    *values : any
        Time stamps as a library returns them, the preferred one first.

    Returns
    -------
    dict of str to any
        The first time stamp that can be read; without one, the text of the first that is stated.

    Examples
    --------
    >>> start_fields(None, "2024-02-30 10:00")
    {'started_at': None, 'unread_start': '2024-02-30 10:00'}
    """
    stated = [value for value in values if _text_of(value).casefold() not in NO_START]
    started_at = next((stamp for value in stated if (stamp := parse_time(value)) is not None), None)
    is_unread = started_at is None and bool(stated)
    return {"started_at": started_at, "unread_start": _text_of(stated[0])[:60] if is_unread else ""}


def _text_of(value: Any) -> str:
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return "" if text is None else " ".join(str(text).split())


def is_plausible(stamp: datetime) -> bool:
    """Whether a digital logger can have written a time stamp.

    Parameters
    ----------
    stamp : datetime
        The time stamp.

    Returns
    -------
    bool
        False for the epoch of a counter, such as 1904-01-01.
    """
    return PLAUSIBLE_YEARS[0] <= stamp.year <= PLAUSIBLE_YEARS[1]


def clock_change(stamp: datetime, time_zone: str) -> str:
    """What a clock change does to a time stamp without a zone.

    Parameters
    ----------
    stamp : datetime
        Time stamp of a file.
    time_zone : str
        IANA name of the zone.

    Returns
    -------
    str
        "twice" for the hour that comes twice in autumn, "never" for the one that is left out in spring, else "".

    Examples
    --------
    >>> clock_change(datetime(2026, 3, 29, 2, 30), "Europe/Copenhagen")
    'never'
    """
    if stamp.tzinfo is not None:
        return ""
    zone = ZoneInfo(time_zone)
    try:
        first, second = (stamp.replace(tzinfo=zone, fold=fold).utcoffset() for fold in (0, 1))
    except OverflowError:
        return ""
    if first is None or second is None or first == second:
        return ""
    return "twice" if first > second else "never"


def start_errors(
    stamps: Sequence[tuple[int, datetime | None]], unread: Mapping[int, str], time_zone: str, source: Source
) -> Iterator[ReadError]:
    """Errors about start times that are unreadable, implausible, or in an hour of a clock change: one for each kind.

    The records stay usable. An hour that comes twice is no error if the order of the records tells which is meant.

    Parameters
    ----------
    stamps : sequence of tuple of (int, datetime or None)
        (record, time stamp) in the order of the file.
    unread : mapping of int to str
        Record -> start time that cannot be read, as it is written.
    time_zone : str
        IANA name of the zone of time stamps without one.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        With the reason ``start_unknown``, a remark.
    """
    stated = dict(stamps)
    if other := [(k, text) for k, text in unread.items() if stated.get(k) is not None]:
        problem = f"two start times: {stated[other[0][0]]:{TIME_FORMAT}}, which is used, and {other[0][1]!r}"
        yield _start_error([k for k, _ in other], problem, source)
    if no_time := [(k, text) for k, text in unread.items() if stated.get(k) is None]:
        problem = f"the start time {no_time[0][1]!r} cannot be read"
        yield _start_error([k for k, _ in no_time], problem, source)
    timed = [(k, stamp) for k, stamp in stamps if stamp is not None]
    if strange := [(k, stamp) for k, stamp in timed if not is_plausible(stamp)]:
        problem = (
            f"the start time {strange[0][1]:{TIME_FORMAT}} is no time of a recording: the logger's clock was not set"
        )
        yield _start_error([k for k, _ in strange], problem, source)
    never = [(k, stamp) for k, stamp in timed if clock_change(stamp, time_zone) == "never"]
    if never:
        problem = (
            f"the start time {never[0][1]:%Y-%m-%d %H:%M} does not exist in {time_zone}: the clock is put forward then"
        )
        yield _start_error([k for k, _ in never], problem, source)
    twice = [(k, stamp) for k, stamp in timed if clock_change(stamp, time_zone) == "twice"]
    starts = dict(start_times(stamps, time_zone))
    if twice and not any(starts[k] == to_utc(stamp.replace(fold=1), time_zone) for k, stamp in twice):
        problem = f"the start time {twice[0][1]:%Y-%m-%d %H:%M} comes twice in {time_zone}: the first one is assumed"
        yield _start_error([k for k, _ in twice], problem, source)


def _start_error(records: Sequence[int], problem: str, source: Source) -> ReadError:
    numbers = [k + 1 for k in records]
    where = f"record {numbers[0]}" if len(numbers) == 1 else f"records {numbers[0]} to {numbers[-1]}"
    return source.error(where, problem, CLOCK_REMEDY, reason="start_unknown")


MATLAB_EPOCH = 719529  # datenum of 1970-01-01
DATED = re.compile(
    r"\d{1,4}[-./]\s?\d{1,2}[-./]\s?\d{1,4}\D+\d{1,2}[:.h-]\d{2}|\d{8}[T _-]?\d{4,6}|\d{4}-?(?:W\d\d|\d{3}T)|\d{4}年"
)
ISO_CHARACTERS = re.compile(r"[\dTtWZz:+.,_ -]+")
WORDED_DATE = re.compile(r"[^\W\d]{3,}\.?.*\d{1,2}:\d{2}")
CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d{1,9})?))?")
DOTTED_DATE = re.compile(r"(\d{1,2})\.\s?(\d{1,2})\.\s?(\d{4})[\sT,;]+(\d{1,2}):(\d{2}(?::\d{2}(?:[.,]\d{1,9})?)?)")
MONTHS = {m: i for i, m in enumerate("jan feb mar apr may jun jul aug sep oct nov dec".split(), start=1)}


# Beginnings of months in English, German, French, Danish, Italian and Spanish.
MONTH_WORDS = {
    1: "jan gen ene", 2: "feb fev", 3: "mar mrz maer", 4: "apr avr abr", 5: "may mai maj mag", 6: "jun juin giu",
    7: "jul juil lug", 8: "aug aou ago", 9: "sep set", 10: "oct okt ott", 11: "nov", 12: "dec dez dic des",
}  # fmt: skip


def looks_dated(text: str) -> bool:
    """Whether a text looks like a date with a time of day, in any notation.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    bool
        False for a date alone.

    Examples
    --------
    >>> [looks_dated(text) for text in ("05/13/2024 10:00 AM", "13 May 2024 10:00:00", "20240513T100000", "3.5 mm")]
    [True, True, True, False]
    """
    return bool(DATED.match(text) or (WORDED_DATE.search(text) and _month_of(text) and re.search(r"\d{4}", text)))


def _month_of(text: str) -> int:
    """Number of the only month that a text names, 0 for none or several."""
    letters = unicodedata.normalize("NFKD", text.casefold())
    words = re.findall(r"[a-z]{3,}", "".join(c for c in letters if not unicodedata.combining(c)))
    months = {k for word in words for k, starts in MONTH_WORDS.items() if word.startswith(tuple(starts.split()))}
    return months.pop() if len(months) == 1 else 0


def _parse_worded(text: str) -> datetime | None:
    """Time of a text that names the month and has a day, a year of four digits and a time of day without AM or PM."""
    month, clock = _month_of(text), CLOCK.search(text)
    if not month or not clock or re.search(r"\b[ap]\.?m\b|[+-]\d{2}:?\d{2}\b", text[clock.start() :], re.IGNORECASE):
        return None
    remainder = text[: clock.start()] + " " + text[clock.end() :]
    numbers = re.findall(r"(?<!\d)\d{1,4}(?!\d)", remainder)
    years, days = [n for n in numbers if len(n) == 4], [n for n in numbers if len(n) <= 2]
    if (
        len(years) != 1
        or len(days) != 1
        or len(numbers) != 2
        or re.search(r"[A-Z]{3,4}\b", remainder.replace("UTC", ""))
    ):
        return None
    second = float((clock[3] or "0").replace(",", "."))
    try:
        start = datetime(int(years[0]), month, int(days[0]), int(clock[1]), int(clock[2]))
    except ValueError:
        return None
    return (
        (start + timedelta(seconds=second)).replace(tzinfo=UTC if "UTC" in remainder else None)
        if second < 60.0
        else None
    )


def parse_time(value: Any) -> datetime | None:
    """Time of a time stamp in any of the forms that files use.

    These are ISO 8601 text, also with slashes, or with the month as a word, numpy datetime64 (UTC), seconds since 1970
    (UTC) and a MATLAB datenum. With dots the day comes first, "13.05.2024 10:00"; dates with slashes that do not begin
    with the year are ambiguous and not read.

    Parameters
    ----------
    value : any
        The time stamp as a library returns it.

    Returns
    -------
    datetime or None
        The time, with a zone if the file states one; None for any other value.

    Examples
    --------
    >>> parse_time("2024-05-13T10:00:00"), parse_time(719529.5)
    (datetime.datetime(2024, 5, 13, 10, 0), datetime.datetime(1970, 1, 1, 12, 0))
    """
    if isinstance(value, datetime):
        return value
    if isinstance(value, np.datetime64):
        stamp = value.astype("datetime64[us]").item()  # a whole number outside the years 1 to 9999, None for NaT
        return stamp.replace(tzinfo=UTC) if isinstance(stamp, datetime) else None
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        if match := DOTTED_DATE.fullmatch(value.strip()):
            value = f"{match[3]}-{match[2]:0>2}-{match[1]:0>2}T{match[4]:0>2}:{match[5]}"
        if (zone := re.search(r"[+-]\d{2}:?(\d{2})$", value.strip())) and int(zone[1]) % 15 and ":" in value:
            return None  # no time zone has such an offset: the text is damaged
        text = re.sub(r"^(\d{4})/(\d{1,2})/(\d{1,2})(?=\D)", _with_dashes, value.strip())
        if not ISO_CHARACTERS.fullmatch(text):  # Python skips other characters behind the microseconds
            return _parse_worded(text)
        try:
            return datetime.fromisoformat(text)
        except ValueError:
            return None
    if isinstance(value, (int, float)) and math.isfinite(value):
        if 6e5 < value < 8e5:
            return datetime(1970, 1, 1) + timedelta(seconds=round((value - MATLAB_EPOCH) * 86400, 6))
        if 1e8 < value < 1e11:
            return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=value)
    return None


def _with_dashes(match: re.Match[str]) -> str:
    return f"{match[1]}-{match[2]:0>2}-{match[3]:0>2}"


def parse_uff_time(text: str) -> datetime | None:
    """Time in ID line 3 of a Universal File, DD-MMM-YY HH:MM:SS.

    Two-digit years from 70 on are 1970 to 1999.

    Parameters
    ----------
    text : str
        The line.

    Returns
    -------
    datetime or None
        The time; None for any other text.

    Examples
    --------
    >>> parse_uff_time("18-Apr-16 13:49:58")
    datetime.datetime(2016, 4, 18, 13, 49, 58)
    """
    try:
        date, clock = text.split()[:2]
        day, month, year = date.split("-")
        hour, minute, second = clock.split(":")
        years = int(year) + (0 if len(year) == 4 else 1900 if int(year) >= 70 else 2000)
        start = datetime(years, MONTHS[month[:3].lower()], int(day), int(hour), int(minute))
        return start + timedelta(seconds=float(second))
    except (ValueError, KeyError, OverflowError):
        return None


def is_unread_uff_time(text: str) -> bool:
    """Whether ID line 3 of a Universal File looks like a date and time and cannot be read as one.

    Parameters
    ----------
    text : str
        The line; it may hold any other text.

    Returns
    -------
    bool
        True for "31-Feb-24 10:00:00" and "2024-02-30".

    Examples
    --------
    >>> is_unread_uff_time("31-Feb-24 10:00:00"), is_unread_uff_time("18-Apr-16 13:49:58"), is_unread_uff_time("NONE")
    (True, False, False)
    """
    looks_dated = re.search(r"\d{1,4}[-./](?:\d{1,2}|[A-Za-z]{3})[-./]\d{2,4}|\d{1,2}:\d{2}:\d{2}", text)
    return bool(looks_dated) and parse_uff_time(text) is None


def seconds_since_first(stamps: np.ndarray) -> np.ndarray:
    """Seconds of time stamps or durations, counted from the first one.

    Parameters
    ----------
    stamps : (n,) array of datetime64 or timedelta64
        Time stamps.

    Returns
    -------
    (n,) array of float
        NaN for a missing time stamp. [s]
    """
    seconds = (stamps - stamps[0]).astype("timedelta64[ns]").astype(float) * 1e-9
    return np.where(np.isnat(stamps), np.nan, seconds)


def start_offsets(stamps: Sequence[datetime | None]) -> list[float]:
    """Start of each channel relative to the first one.

    Parameters
    ----------
    stamps : sequence of datetime or None
        Start time of each channel, None if not stated.

    Returns
    -------
    list of float
        Offsets, all 0 if not all time stamps are comparable. [s]

    Examples
    --------
    >>> from datetime import datetime
    >>> start_offsets([datetime(2024, 5, 13, 10, 0, 1), datetime(2024, 5, 13, 10, 0, 0, 500_000)])
    [0.0, -0.5]
    """
    stated = [stamp for stamp in stamps if stamp is not None]
    if len(stated) < len(stamps) or len({stamp.tzinfo is None for stamp in stated}) > 1:
        return [0.0] * len(stamps)
    return [(stamp - stated[0]).total_seconds() for stamp in stated]


def check_simultaneous(
    names: Sequence[str], steps: Sequence[float], starts: Sequence[float], where: str, source: Source
) -> None:
    """Check that all channels have the same step, and starts within half a step.

    Multiplexed converters cause smaller differences of the starts.

    Parameters
    ----------
    names : sequence of str
        Names of the channels.
    steps : sequence of float
        Time step of each channel, 0 if not stated. [s]
    starts : sequence of float
        Start of each channel. [s]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If steps differ, or starts differ by more than half a step.
    """
    step = steps[0]
    if any(abs(channel_step - step) > TEXT_PRECISION * abs(step) for channel_step in steps):
        problem = f"its channels have different steps: {sorted(set(steps))} s"
        remedy = "Record all channels at one rate, or export those of one rate to one file"
        raise source.error(where, problem, remedy, reason="wrong_rate")
    earliest, latest = min(starts), max(starts)
    if step and latest - earliest > 0.5 * abs(step):
        first, last = names[starts.index(earliest)], names[starts.index(latest)]
        problem = f"channel {last!r} begins {latest - earliest:.6g} s after channel {first!r}"
        remedy = "Start all channels by one trigger, or export them cut to the stretch that they share"
        raise source.error(where, problem, remedy, reason="clock_drift")
