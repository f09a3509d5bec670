"""Dates of three numbers, as 13/05/2026: which orders of year, month and day their notation and the calendar allow."""

import re
from datetime import UTC, datetime, timedelta, timezone

from turnout.readers.clock_texts import CLOCK, DATE

DATED = re.compile(rf" *({DATE})[T ,_]+{CLOCK} *")
ZONE = re.compile(r"(?:(Z|UTC)|([+-])(\d{2}):?(\d{2})) *$")


def orders_of_date(date: str) -> list[tuple[int, int, int]]:
    """(year, month, day) of a date in each order that its notation and the calendar allow.

    The year comes first if it has four digits there. With dots the day comes first, with slashes and dashes the day or
    the month. A year of two digits may be in front or behind.

    Parameters
    ----------
    date : str
        Three numbers with slashes, dashes or dots between them.

    Returns
    -------
    list of tuple of (int, int, int)
        More than one if the order is not clear.

    Examples
    --------
    >>> orders_of_date("05/13/2026"), orders_of_date("05/04/2026")
    ([(2026, 5, 13)], [(2026, 4, 5), (2026, 5, 4)])
    """
    parts = re.split("[-/.]", date)
    a, b, c = map(int, parts)
    if len(parts[0]) == 4:
        orders = [(a, b, c)]
    elif len(parts[2]) == 4:
        orders = [(c, b, a)] if "." in date else [(c, b, a), (c, a, b)]
    else:
        orders = [(2000 + c, b, a), (2000 + c, a, b), (2000 + a, b, c)]
    return list(dict.fromkeys(order for order in orders if _is_day(order)))


def _is_day(order: tuple[int, int, int]) -> bool:
    try:
        datetime(*order)
    except ValueError:
        return False
    return True


def time_of_match(day: tuple[int, int, int], match: re.Match[str]) -> datetime | None:
    """The time of a day and a time of day; None for an hour that no day has, and a zone that nobody uses.

    Parameters
    ----------
    day : tuple of (int, int, int)
        Year, month and day.
    match : re.Match
        Match of ``DATED``.

    Returns
    -------
    datetime or None
        With a zone if the text states one.
    """
    hour, minute, second, half = int(match[2]), int(match[3]), float(match[4].replace(",", ".")), match[5]
    if half:
        hour = hour % 12 + 12 * (half in "pP") if 1 <= hour <= 12 else 24
    if hour > 23 or minute > 59 or second >= 60.0:
        return None
    start = datetime(*day) + timedelta(hours=hour, minutes=minute, seconds=second)
    zone = ZONE.search(match[0])
    if not zone:
        return start
    if zone[1]:
        return start.replace(tzinfo=UTC)
    offset = timedelta(hours=int(zone[3]), minutes=int(zone[4]))
    if int(zone[4]) % 15 or offset > timedelta(hours=14):
        return None
    return start.replace(tzinfo=timezone(-offset if zone[2] == "-" else offset))


def dated_time(text: str) -> datetime | None:
    """Time of a text with a date that only one order of day and month allows, and a time of day.

    Parameters
    ----------
    text : str
        Value of an entry. Its time of day may have no seconds.

    Returns
    -------
    datetime or None
        None for any other text.

    Examples
    --------
    >>> dated_time("05/13/2026 10:20:30.5 PM"), dated_time("13/05/2026 10:20"), dated_time("05/04/2026 10:20")
    (datetime.datetime(2026, 5, 13, 22, 20, 30, 500000), datetime.datetime(2026, 5, 13, 10, 20), None)
    """
    match = DATED.fullmatch(WITHOUT_SECONDS.sub(r"\1:00", text))
    orders = orders_of_date(match[1]) if match else []
    return time_of_match(orders[0], match) if match and len(orders) == 1 else None


WITHOUT_SECONDS = re.compile(r"((?<![\d:+-])\d{1,2}:\d{2})(?![\d:])")
