"""Start times of the records of a file: in UTC, in their order, and what is reported about them."""

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

from turnout.errors import ReadError
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_zones import stamp_and_zone, zone_problem
from turnout.readers.time_numbers import is_unset
from turnout.readers.time_texts import is_date, stated_time

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


MAX_LEAD = timedelta(days=1)  # of a logger's clock before ours, with the differences between time zones
CLOCK_REMEDY = "Check the logger's clock; give the campaign or the time in the file's name"
SHORT_DATE = re.compile(r"\d{1,2}(?:[-/]\d{1,2}[-/]\d{2,4}|\.\d{1,2}\.\d{2})(?!\d)")
ORDER_REMEDY = (
    "Let the logger write the year with four digits in front, YYYY-MM-DD: in this date its order is not stated"
)
DATE_OF_UFF = re.compile(r"\d{1,2}-[^\W\d]+\.?-\d{2,4}")
MONTH_REMEDY = "Write the month in English, as in 13-May-26 10:00:00"
NAME_REMEDY = (
    "If it is the start, let the logger call it 'start_time', as in 'start_time: 2026-05-13 10:20:30'; if it is not, "
    "name it in the layout, 'checked_entries', and give the campaign or the time in the file's name"
)
COUNT_REMEDY = (
    "State its origin in the name or the unit, such as 'days since 1899-12-30', or give the campaign or the time in "
    "the file's name"
)
OBJECT_REMEDY = (
    "Store it as text, in MATLAB by char(x, 'yyyy-MM-dd HH:mm:ss.SSS'), or give the campaign or the time in the file's "
    "name"
)
ZONE_REMEDY = "Compare it with 'time_zone' in the layout; let the logger write UTC, or an offset such as +02:00"
NO_START = {"", "-", "none", "n/a", "?", "unknown", "nan", "nat", "null", "0", "0.0"}


def start_fields(*values: Any, declared: str = "") -> dict[str, Any]:
    """Fields ``started_at`` and ``unread_start`` of a RawRecord.

    Parameters
    ----------
    *values : any
        Time stamps as a library returns them, the preferred one first.
    declared : str
        Name and unit of a number, which may say how it counts.

    Returns
    -------
    dict of str to any
        The first time stamp that can be read, one of a clock that was set before any other; without one, the text of
        the first that is stated.

    Examples
    --------
    >>> start_fields(None, "2024-02-30 10:00")
    {'started_at': None, 'unread_start': '2024-02-30 10:00'}
    >>> start_fields(46155.5)["unread_start"]
    '46155.5: days since 1899-12-30 or days since 1904-01-01?'
    """
    stated = [value for value in values if _text_of(value).casefold() not in NO_START]
    times = [stated_time(value, declared) for value in stated]
    started_at = min((time for time, _ in times if time is not None), key=is_unset, default=None)
    if started_at is not None or not stated:
        return {"started_at": started_at, "unread_start": ""}
    return {"started_at": None, "unread_start": times[0][1] or _text_of(stated[0])[:60]}


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
        False for the epoch of a counter, such as 1904-01-01, and for a time in the future.
    """
    now = datetime.now(UTC).replace(tzinfo=None)
    return not is_unset(stamp) and stamp.replace(tzinfo=None) <= now + MAX_LEAD


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
        problem = (
            f"the start time {no_time[0][1]!r} {'has no time of day' if is_date(no_time[0][1]) else 'cannot be read'}"
        )
        text = no_time[0][1]
        remedy = CLOCK_REMEDY
        if stamp_and_zone(text)[0]:
            problem, remedy = f"{problem}: its time zone is not known to be that of the layout", ZONE_REMEDY
        elif SHORT_DATE.match(text) and not is_date(text):
            remedy = ORDER_REMEDY
        elif "MATLAB class" in text:
            remedy = OBJECT_REMEDY
        elif text.endswith("?"):
            remedy = COUNT_REMEDY
        elif DATE_OF_UFF.match(text):
            remedy = MONTH_REMEDY
        elif ": " in text:
            remedy = NAME_REMEDY
        yield _start_error([k for k, _ in no_time], problem, source, remedy)
    timed = [(k, stamp) for k, stamp in stamps if stamp is not None]
    if strange := [(k, stamp) for k, stamp in timed if not is_plausible(stamp)]:
        is_early = is_unset(strange[0][1])
        fault = "no time of a recording: the logger's clock was not set" if is_early else "in the future"
        problem = f"the start time {strange[0][1]:{TIME_FORMAT}} is {fault}"
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


def zone_errors(records: Sequence[RawRecord | ReadError], time_zone: str, source: Source) -> Iterator[ReadError]:
    """One error about time zones in the file that cannot be read and may differ from that of the layout.

    Parameters
    ----------
    records : sequence of RawRecord or ReadError
        The records of the file.
    time_zone : str
        IANA name of the layout's zone.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        With the reason ``start_unknown``, a remark.
    """
    problems = {
        k: problem
        for k, record in enumerate(records)
        if isinstance(record, RawRecord) and (problem := zone_problem(record, time_zone))
    }
    if problems:
        yield _start_error(list(problems), next(iter(problems.values())), source, ZONE_REMEDY)


def _start_error(records: Sequence[int], problem: str, source: Source, remedy: str = CLOCK_REMEDY) -> ReadError:
    numbers = [k + 1 for k in records]
    where = f"record {numbers[0]}" if len(numbers) == 1 else f"records {numbers[0]} to {numbers[-1]}"
    return source.error(where, problem, remedy, reason="start_unknown")
