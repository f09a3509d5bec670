"""When the records of a file began, and which of their stamps are in order."""

from bisect import bisect_left, bisect_right
from datetime import UTC
from zoneinfo import ZoneInfo

from turnout.errors import ReadError

STAMP = "%Y-%m-%d %H:%M:%S.%f"


def started_at(moment, time_zone):
    """Naive UTC of a file's start time; a time stamp without a zone is in ``time_zone`` (IANA name).

    >>> from datetime import datetime
    >>> started_at(datetime(2024, 5, 13, 12, 0), "Europe/Zurich")
    datetime.datetime(2024, 5, 13, 10, 0)
    """
    if moment is None:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=ZoneInfo(time_zone))
    try:
        return moment.astimezone(UTC).replace(tzinfo=None)
    except OverflowError:  # a damaged stamp in the year 1 or 9999
        return None


def starts_of(moments, time_zone):
    """[(record, naive UTC)] of [(record, time stamp)] of one file, in its order.

    Of an hour that comes twice in autumn the first is meant, unless a record would then begin before the one in front.

    >>> from datetime import datetime
    >>> stamps = enumerate([datetime(2024, 10, 27, 2, 55), datetime(2024, 10, 27, 2, 5)])
    >>> [f"{start:%H:%M}" for _, start in starts_of(stamps, "Europe/Copenhagen")]
    ['00:55', '01:05']
    """
    found, latest = [], None
    for record, moment in moments:
        start = started_at(moment, time_zone)
        if start is not None and latest is not None and start < latest and moment.tzinfo is None:
            second = started_at(moment.replace(fold=1), time_zone)
            start = second if second is not None and second >= latest else start
        found.append((record, start))
        latest = start if latest is None or (start is not None and start > latest) else latest
    return found


def check_order(starts, source):
    """{record: ReadError} for the fewest records without which no record began before the one in front of it."""
    errors: dict[int, ReadError] = {}
    known = [(record, start) for record, start in starts if start is not None]
    kept = _in_order([start for _, start in known])
    for i, (record, start) in enumerate(known):
        n = bisect_left(kept, i)
        if n < len(kept) and kept[n] == i:
            continue
        if n and start < (front := known[kept[n - 1]][1]):
            where = f"before the record in front of it ({front:{STAMP}})"
        else:
            where = f"after a record behind it ({known[kept[n]][1]:{STAMP}})"
        found = f"it began at {start:{STAMP}}, {where}"
        remedy = "Check the logger's clock and the time zone in the layout"
        errors[record] = source.error(f"record {record + 1}", found, remedy, reason="clock_backwards")
    return errors


def _in_order(starts):
    """Places of the most ``starts`` that never go back; of several such choices the one that keeps the earliest.

    >>> _in_order([2099, 2001, 2002, 1970, 2002])
    [1, 2, 4]
    """
    rank = {start: -k for k, start in enumerate(sorted(set(starts)))}
    ends: list[int] = []  # ends[n]: of all orders of n + 1 starts, read from behind, the latest first one
    ahead = [0] * len(starts)  # how many can follow in order, the one itself included
    for i in reversed(range(len(starts))):
        k = bisect_right(ends, rank[starts[i]])
        ends[k : k + 1] = [rank[starts[i]]]
        ahead[i] = k + 1
    kept: list[int] = []
    for i, start in enumerate(starts):
        if ahead[i] == len(ends) - len(kept) and (not kept or start >= starts[kept[-1]]):
            kept.append(i)
    return kept
