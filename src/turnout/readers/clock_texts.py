"""Columns of text with the time of day of each sample, with or without a date, as loggers print them."""

import re
from collections.abc import Callable, Sequence
from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np

from turnout.readers.metadata_names import TIME_NAMES
from turnout.readers.source import Source
from turnout.readers.stamp_texts import FRACTION, plain_stamp
from turnout.readers.texts import decode_text

DATE = r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.](?:\d{4}|\d{2})"
CLOCK = r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d{1,12})?)(?: ?([AaPp])\.?[Mm]\.?)?(?:Z| ?UTC| ?[+-]\d{2}:?\d{2})?"
# As CLOCK, behind a date or a count of days; or minutes and seconds, which without decimals may be hours and minutes.
STAMP = re.compile(
    rf" *(?:(?P<date>{DATE})[T ,_]+|(?P<days>\d{{1,5}})(?: days? |\.))?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2}(?:[.,]\d{1,12})?)(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
    r"(?:(?P<zone>Z| ?UTC)| ?(?P<sign>[+-])(?P<zone_hour>\d{2}):?(?P<zone_minute>\d{2}))? *"
)
MINUTES = re.compile(r" *(?P<minute>\d{1,2}):(?P<second>\d{2}[.,]\d{1,12}) *")
DATE_ALONE = re.compile(rf" *(?:{DATE}) *")
DAY = 86400.0  # s
HOUR = 3600.0  # s


def is_clock(text: str) -> bool:
    """Whether a text is a time of day with seconds, with or without a date before it, or minutes and seconds.

    Parameters
    ----------
    text : str
        A cell.

    Returns
    -------
    bool
        Whether it is.

    Examples
    --------
    >>> [is_clock(text) for text in ("10:00:00.00005", "13.05.2026 10:00:00,5", "2026-05-13T10:00:00Z", "00:10.5")]
    [True, True, True, True]
    >>> is_clock("10:00"), is_clock("3")
    (False, False)
    """
    text = plain_stamp(text)
    return bool(STAMP.fullmatch(text) or MINUTES.fullmatch(text))


def is_clock_or_date(text: str) -> bool:
    """Whether a text is a time of day or a date, as a cell in a row of numbers may be.

    Parameters
    ----------
    text : str
        A cell.

    Returns
    -------
    bool
        Whether it is.
    """
    return is_clock(text) or bool(DATE_ALONE.fullmatch(plain_stamp(text)))


def seconds_of_clock(texts: Sequence[str]) -> np.ndarray:
    """Seconds of times of day, counted from the first of them.

    Dates, counts of days and time zones in the texts count. Without a date the next day begins where the time of day
    falls by more than half a day; of minutes and seconds, the next hour where they fall by more than half an hour.

    Parameters
    ----------
    texts : (n,) sequence of str
        Times of day in a row, each as ``is_clock`` knows them.

    Returns
    -------
    (n,) array of float
        NaN where a text is none, as at 10:61:00. [s]

    Examples
    --------
    >>> seconds_of_clock(["23:59:59.5", "00:00:00.0", "none", "00:00:01"])
    array([0. , 0.5, nan, 1.5])
    >>> seconds_of_clock(["05/13/2026 12:59:59 PM", "05/13/2026 01:00:00 PM"])
    array([0., 1.])
    >>> seconds_of_clock(["2026-10-25T02:59:59.5+02:00", "2026-10-25T02:00:00+01:00"])
    array([0. , 0.5])
    """
    first = STAMP.fullmatch(plain_stamp(texts[0])) if len(texts) else None
    if first and (time := _seconds_of_one_form(texts, is_of_half_day=bool(first["half"]))) is not None:
        return time if first["date"] or first["days"] else _with_midnights(time, DAY)
    widths = {len(fraction[2]) for text in texts if (fraction := FRACTION.search(text))}
    matches = [STAMP.fullmatch(text) or MINUTES.fullmatch(text) for text in map(plain_stamp, texts)]
    fields = [match.groupdict() if match and len(widths) < 2 else {} for match in matches]
    time = np.array([_seconds_of_day(field) for field in fields])
    dates = [field.get("date") for field in fields]
    is_read = np.isfinite(time)
    if not is_read.any():
        return time
    if all(date for date, is_one in zip(dates, is_read) if is_one):
        days = _day_numbers([date or "" for date in dates])
        return DAY * (days - days[is_read][0]) + (time - time[is_read][0])
    if all("days" not in field or field["days"] is None for field in fields):
        period = DAY if any(field.get("hour") for field in fields) else HOUR
        time[is_read] = _with_midnights(time[is_read], period)
    return time - time[is_read][0]


def _with_midnights(time: np.ndarray, period: float) -> np.ndarray:
    """Times of day that begin a new period where they fall by more than half of one."""
    return time + period * np.cumsum(np.diff(time, prepend=time[:1]) < -period / 2)


CLOCK_DIGITS = re.compile(r"(?<!\d)(\d{1,2}):(\d{2}):(\d{2})(?:[.,:](\d{1,9}))?(?![\d:.,])")


def _seconds_of_one_form(texts: Sequence[str], is_of_half_day: bool) -> np.ndarray | None:
    """Seconds since the first of texts that differ in the digits of their times of day alone; None for others.

    They are compared as one table of characters, because a search in each text takes twenty times as long.
    """
    match = CLOCK_DIGITS.search(texts[0])
    try:
        table = np.array(texts, dtype="S")
    except UnicodeEncodeError:
        return None
    if match is None or table.dtype.itemsize != len(texts[0]):
        return None
    characters = table.view(np.uint8).reshape(len(texts), -1)
    is_digit = np.zeros(len(texts[0]), dtype=bool)
    for group in range(1, 5):
        is_digit[slice(*match.span(group))] = True
    digits = characters[:, is_digit] - ord("0")
    if (digits > 9).any() or (characters[:, ~is_digit] != characters[0, ~is_digit]).any():
        return None
    edges = np.cumsum([0, *(len(match[group] or "") for group in range(1, 5))])
    hour, minute, second, fraction = (_numbers_of(digits[:, a:b]) for a, b in pairwise(edges))
    if (
        minute.max() > 59
        or second.max() > 59
        or hour.max() > 23
        or (is_of_half_day and not 1 <= hour.min() <= hour.max() <= 12)
    ):
        return None
    whole = ((hour % 12 if is_of_half_day else hour) * 60 + minute) * 60 + second
    return (whole - whole[0]) + (fraction - fraction[0]) / 10.0 ** len(match[4] or "")


def _numbers_of(digits: np.ndarray) -> np.ndarray:
    """Whole number of each row of digits."""
    return digits @ 10 ** np.arange(digits.shape[1])[::-1]


def _seconds_of_day(field: dict[str, str | None]) -> float:
    """Seconds since midnight of UTC if a zone is stated, with the days that are counted; NaN if no clock shows them."""
    if not field:
        return np.nan
    hour, minute = int(field.get("hour") or 0), int(field["minute"] or 0)
    second = float((field["second"] or "").replace(",", "."))
    if half := field.get("half"):
        hour = hour % 12 + 12 * (half in "pP") if 1 <= hour <= 12 else 24
    is_of_day = bool(half or field.get("date") or field.get("zone") or field.get("sign"))
    if minute > 59 or second >= 61.0 or (is_of_day and hour > 23):  # a leap second is the second 60
        return np.nan
    offset = 60.0 * (60 * int(field.get("zone_hour") or 0) + int(field.get("zone_minute") or 0))
    seconds = DAY * int(field.get("days") or 0) + HOUR * hour + 60.0 * minute + second
    return seconds + (offset if field.get("sign") == "-" else -offset)


# Year, month and day of the three numbers of a date, in the order in which they are written.
NOTATIONS: tuple[Callable[[int, int, int], tuple[int, int, int]], ...] = (
    lambda a, b, c: (a, b, c),
    lambda a, b, c: (c, b, a),
    lambda a, b, c: (c, a, b),
)


def _day_numbers(dates: Sequence[str]) -> np.ndarray:
    """Number of the day of each date, in the notation in which they are closest together; NaN for other texts."""
    if len(set(dates) - {""}) == 1:
        return np.zeros(len(dates))
    numbers = {date: tuple(map(int, re.split("[-/.]", date))) for date in dict.fromkeys(dates) if date}
    closest: dict[str, float] = dict.fromkeys(numbers, np.nan)
    least = np.inf
    for notation in NOTATIONS:
        try:
            days = {text: float(date(*notation(*parts)).toordinal()) for text, parts in numbers.items()}
        except ValueError:
            continue
        if (span := max(days.values()) - min(days.values())) < least:
            closest, least = days, span
    return np.array([closest[text] if text else np.nan for text in dates], dtype=float)


def with_dates(columns: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The columns of a table, with the dates of a column that changes before the times of day beside it.

    Parameters
    ----------
    columns : sequence of (n,) array
        The columns as they are in the file.

    Returns
    -------
    list of (n,) array
        They are unchanged where there is more than one column of times of day or of dates.

    Examples
    --------
    >>> dates, times = np.array(["13.05.2026", "14.05.2026"]), np.array(["23:59:59", "00:00:00"])
    >>> with_dates([dates, times])[1]
    array(['13.05.2026 23:59:59', '14.05.2026 00:00:00'], dtype=object)
    """
    columns = list(columns)
    texts = {i: _text(c[0]) for i, c in enumerate(columns) if len(c) and c.dtype.kind in "OUST"}
    dates = [i for i, text in texts.items() if DATE_ALONE.fullmatch(plain_stamp(text))]
    clocks = [i for i, text in texts.items() if (stamp := STAMP.fullmatch(text)) and not stamp["date"]]
    if len(dates) == len(clocks) == 1 and len(set(map(_text, columns[dates[0]]))) > 1:
        pairs = zip(columns[dates[0]], columns[clocks[0]])
        columns[clocks[0]] = np.array([f"{_text(day)} {_text(clock)}" for day, clock in pairs], dtype=object)
    return columns


TIME_REMEDY = "Export the time in seconds from the start of the record, as numbers"


def with_durations(column: np.ndarray, noun: str, name: str, source: Source) -> np.ndarray:
    """A column of texts that are times of day as durations since the first one; any other column unchanged.

    Parameters
    ----------
    column : (n,) array
        Values of a column.
    noun : str
        What the format calls a column, for the message.
    name : str
        Name or number of the column.
    source : Source
        The raw file.

    Returns
    -------
    (n,) array
        Of timedelta64[ns], a ``ClockColumn``, if its first value is a time of day and others differ from it.

    Raises
    ------
    ReadError
        If a value is no time of day, or the column is called time and holds other texts: they may contradict the rate.
    """
    if column.ndim != 1 or len(column) < 2 or column.dtype.kind not in "OUST":
        return column
    where = f"{noun} {name!r}"
    if not is_clock(_text(column[0])):
        if name.strip().lower() in TIME_NAMES and any(value != column[0] for value in column):
            problem = f"it holds {_text(column[0])[:60]!r}, and so no known times"
            raise source.error(where, problem, TIME_REMEDY)
        return column
    texts = [value if type(value) is str else _text(value) for value in column.tolist()]
    if all(text == texts[0] for text in texts):  # the start, repeated in every row
        return column
    seconds = seconds_of_clock(texts)
    if not np.isfinite(seconds).all():
        k = int(np.argmin(np.isfinite(seconds)))
        problem = f"the time of sample {k} is {texts[k][:60]!r}, that of the first is {texts[0][:60]!r}"
        if k == 0:
            problem = f"the time of its first sample, {texts[0][:60]!r}, is none that a clock shows"
        raise source.error(where, problem, "Export the record again from the logger", reason="not_finite")
    durations = np.round(seconds * 1e9).astype("timedelta64[ns]").view(ClockColumn)
    durations.first_text = texts[0]
    return durations


class ClockColumn(np.ndarray):
    """Durations since the first of a column of texts, which is ``first_text``; so are slices of it."""

    first_text: str = ""

    def __array_finalize__(self, template: Any) -> None:
        self.first_text = getattr(template, "first_text", "")


def _text(value: object) -> str:
    return decode_text(value) if isinstance(value, bytes) else str(value)
