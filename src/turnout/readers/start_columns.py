"""Start of a recording in its first row: a date and a time of day, or a time column in units since 1970."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone

from turnout.readers.clock_texts import CLOCK, DATE, DATE_ALONE, STAMP
from turnout.readers.entry_candidates import EPOCHS
from turnout.readers.rate_units import words_of
from turnout.readers.stated_starts import OTHER
from turnout.readers.statements import PLAUSIBLE_RATES

DATED = re.compile(rf" *({DATE})[T ,_]+{CLOCK} *")
ZONE = re.compile(r"(?:(Z|UTC)|([+-])(\d{2}):?(\d{2})) *$")
EPOCH_UNITS = (1.0, 1e-3, 1e-6, 1e-9)  # s


def start_in_cells(cells: Sequence[str], names: Sequence[str]) -> tuple[datetime | None, str]:
    """Start time in the first row of a text table, and its text if it cannot be read.

    Parameters
    ----------
    cells : sequence of str
        Cells of the first row.
    names : sequence of str
        Names of the columns; those of other events, such as an export, state no start.

    Returns
    -------
    tuple of (datetime or None, str)
        The start, with a zone if the cell states one; without a start, the text of date and time of day, "" if there
        are none.

    Examples
    --------
    >>> start_in_cells(["13.05.2026 10:00:00,5", "1,5"], ["Zeit", "Kraft"])
    (datetime.datetime(2026, 5, 13, 10, 0, 0, 500000), '')
    >>> start_in_cells(["05/06/2026", "10:00:00", "1.5"], ["Date", "Time", "Force"])
    (None, '05/06/2026 10:00:00: day or month first?')
    """
    cells = [cell.strip() for cell, name in zip(cells, names) if not any(OTHER.search(w) for w in words_of(name))]
    dated = [cell for cell in cells if DATED.fullmatch(cell)]
    if not dated:
        dates = [cell for cell in cells if DATE_ALONE.fullmatch(cell)]
        clocks = [cell for cell in cells if STAMP.fullmatch(cell)]
        dated = [f"{dates[0]} {clocks[0]}"] if len(dates) == len(clocks) == 1 else []
    if not dated:
        return None, ""
    match = DATED.fullmatch(dated[0])
    orders = _orders(match[1]) if match else []
    start = _time_of(orders[0], match, dated[0]) if match and len(orders) == 1 else None
    question = ": day or month first?" if len(orders) > 1 else ""
    return start, "" if start else dated[0] + question


def _orders(date: str) -> list[tuple[int, int, int]]:
    """(year, month, day) of a date in each order that its notation and the calendar allow.

    The year comes first if it has four digits there. With dots the day comes first, with slashes and dashes the day or
    the month. A year of two digits may be in front or behind.
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


def _time_of(day: tuple[int, int, int], match: re.Match[str], text: str) -> datetime | None:
    """The time of a day and a matched time of day; None for an hour that no day has, and a zone that nobody uses."""
    hour, minute, second, half = int(match[2]), int(match[3]), float(match[4].replace(",", ".")), match[5]
    if half:
        hour = hour % 12 + 12 * (half in "pP") if 1 <= hour <= 12 else 24
    if hour > 23 or minute > 59 or second >= 60.0:
        return None
    start = datetime(*day) + timedelta(hours=hour, minutes=minute, seconds=second)
    zone = ZONE.search(text)
    if not zone:
        return start
    if zone[1]:
        return start.replace(tzinfo=UTC)
    offset = timedelta(hours=int(zone[3]), minutes=int(zone[4]))
    if int(zone[4]) % 15 or offset > timedelta(hours=14):
        return None
    return start.replace(tzinfo=timezone(-offset if zone[2] == "-" else offset))


def start_of_epoch(first: float, step: float, has_unit: bool) -> datetime | None:
    """Start of a time column that counts from 1970, in UTC.

    Parameters
    ----------
    first : float
        First number, in seconds by the unit of the column.
    step : float
        Step, in the same unit.
    has_unit : bool
        Whether the file states the unit; else the column may count s, ms, µs or ns.

    Returns
    -------
    datetime or None
        None if the column counts from another origin, or its step is that of no recording.

    Examples
    --------
    >>> start_of_epoch(1.7786664e12, 0.05, False)
    datetime.datetime(2026, 5, 13, 10, 0, tzinfo=datetime.timezone.utc)
    >>> start_of_epoch(12.5, 5e-5, True), start_of_epoch(7e8, 50.0, False)  # the latter in µs since the logger began
    (None, None)
    """
    for unit in EPOCH_UNITS[:1] if has_unit else EPOCH_UNITS:
        if EPOCHS[0] <= first * unit <= EPOCHS[1] and PLAUSIBLE_RATES[0] * step * unit <= 1.0:
            return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=round(first * unit, 6))
    return None
