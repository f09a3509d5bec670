"""Times of day as loggers print and store them."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from turnout.readers.calendar_dates import dated_time
from turnout.readers.stamp_texts import DAY_OF_YEAR, is_weekday, month_of, plain_stamp, with_colons
from turnout.readers.time_numbers import time_of_digits, time_of_number

NUMBER_TEXT = re.compile(r"\d+(?:\.\d*)?(?:[eE]\+?\d+)?")
DAY_DIGITS = 8  # of a date without marks, YYYYMMDD
DATED = re.compile(
    r"\d{1,4}[-./]\s?\d{1,2}[-./]\s?\d{1,4}\D+\d{1,2}(?:[:.-]|\s?h\s?)\d{2}"
    r"|\d{8}[T _-]?\d{4,6}|\d{4}-?(?:W\d\d|\d{3}T)|\d{4}年"
)
ISO_CHARACTERS = re.compile(r"[\dTtWZz:+.,_ -]+")
WORDED_DATE = re.compile(r"[^\W\d]{3,}\.?.*\d{1,2}\s?[:h]\s?\d{2}")
# A date without a time of day, in ISO 8601 also by its week. It is no start: midnight would be a guess.
DATE_ALONE = re.compile(
    r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{8}(?:\.0)?|\d{4}-?W\d{2}(?:-?\d)?"
)
CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d{1,9})?))?")
DOTTED_DATE = re.compile(r"(\d{1,2})\.\s?(\d{1,2})\.\s?(\d{4})[\sT,;]+(\d{1,2}):(\d{2}(?::\d{2}(?:[.,]\d{1,9})?)?)")
# A time of day as in "13.05.2026 10.20.30", and the words beside one: "13.05.2026 um 10:20:30 Uhr".
DOTTED_CLOCK = re.compile(r"(?<=\d{4}[ T])(\d{1,2})\.(\d{2})\.(\d{2})(?!\.|\d)")
BEFORE_CLOCK = re.compile(r"(?<=\d),? (?:um|at|kl\.?|à|om|alle|ore|ob) (?=\d{1,2}\s?[:.h]\s?\d{2})", re.IGNORECASE)
BEHIND_CLOCK = re.compile(r"(?<=\d) (?:Uhr|hrs?|h)\.?$", re.IGNORECASE)
HOURS_AND_MINUTES = re.compile(r"(?<=[\sT])(\d{1,2})\s?h\s?(\d{2})(?:\s?(?:m|min)?\s?(\d{2}(?:[.,]\d{1,9})?)\s?s?)?$")
WORD_AHEAD = re.compile(r"^([^\W\d]{2,10})\.?,? +(?=\d{1,4}[-./]|\d{1,2}\.? *[^\W\d]{3})")  # of a whole date
# The date vector of MATLAB as a text, "[2026 5 13 8 30 12.25]".
VECTOR = re.compile(
    r"[\[(]?\s*(\d{4})(?:\.0*)?" + r"[\s,;]+(\d{1,2})(?:\.0*)?" * 4 + r"[\s,;]+(\d{1,2}(?:\.\d*)?)\s*[\])]?",
)
VECTOR_YEARS = range(1990, 2062)  # of digital loggers
WITH_UTC = re.compile(r"(.*\d) ?\(?(?:UTC|GMT)\)?")
MONTHS = {m: i for i, m in enumerate("jan feb mar apr may jun jul aug sep oct nov dec".split(), start=1)}


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
    text = with_colons(_without_weekday(text))
    is_worded = WORDED_DATE.search(text) and month_of(text) and re.search(r"\d{4}", text)
    return bool(DATED.match(text) or DAY_OF_YEAR.match(text) or is_worded or time_of_vector(text))


def time_of_vector(value: Any) -> datetime | None:
    """Time of a date vector: year, month, day, hour, minute and second as six numbers, or as a text of them.

    Parameters
    ----------
    value : any
        Value of an entry.

    Returns
    -------
    datetime or None
        Without a zone; None for anything else, and for numbers that are no time of a digital logger.

    Examples
    --------
    >>> time_of_vector([2026, 5, 13, 8, 30, 12.25]), time_of_vector("[2026 5 13 8 30 12]"), time_of_vector([1, 2])
    (datetime.datetime(2026, 5, 13, 8, 30, 12, 250000), datetime.datetime(2026, 5, 13, 8, 30, 12), None)
    """
    numbers: Sequence[Any] = ()
    if isinstance(value, str):
        match = VECTOR.fullmatch(value.strip())
        numbers = [float(text) for text in match.groups()] if match else []
    elif isinstance(value, np.ndarray):
        numbers = np.ravel(value).tolist() if value.size == len(DATE_PARTS) else []
    elif isinstance(value, (list, tuple)):
        numbers = value
    are_numbers = all(isinstance(n, (int, float, np.integer, np.floating)) for n in numbers)
    if len(numbers) != len(DATE_PARTS) or not are_numbers:
        return None
    if numbers[0] not in VECTOR_YEARS or not np.isfinite(numbers).all() or any(n != int(n) for n in numbers[:5]):
        return None
    try:
        minute = datetime(*map(int, numbers[:5]))  # type: ignore[arg-type]
    except ValueError:
        return None
    return minute + timedelta(seconds=float(numbers[5])) if 0.0 <= numbers[5] < 60.0 else None


DATE_PARTS = ("year", "month", "day", "hour", "minute", "second")


def is_date(text: str) -> bool:
    """Whether a text is a date without a time of day.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    bool
        Also for 8 digits, YYYYMMDD.

    Examples
    --------
    >>> [is_date(text) for text in ("2024-05-13", "13.05.2024", "20240513", "2024-05-13 10:00", "12:30")]
    [True, True, True, False, False]
    """
    return bool(DATE_ALONE.fullmatch(text.strip()))


def is_day(text: str) -> bool:
    """Whether a text is a date without a time of day, in any notation.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    bool
        Also with the month as a word.

    Examples
    --------
    >>> [is_day(text) for text in ("2024-05-13", "13 May 2024", "13.5.24", "13 May 2024 10:00", "12:30", "May")]
    [True, True, True, False, False, False]
    """
    text = text.strip()
    is_worded = len(text) <= MAX_WORDED_DATE and re.search(r"\b\d{4}\b", text) and month_of(text)
    return is_date(text) or bool(SHORT_DATE.fullmatch(text)) or bool(is_worded and ":" not in text)


SHORT_DATE = re.compile(r"\d{1,2}[-./]\d{1,2}[-./]\d{2}|\d{1,2}-[A-Za-z]{3}-\d{2}")
MAX_WORDED_DATE = 40  # characters


def _parse_worded(text: str) -> datetime | None:
    """Time of a text that names the month and has a day, a year of four digits and a time of day without AM or PM."""
    month, clock = month_of(text), CLOCK.search(text)
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

    These are ISO 8601 text, also with slashes, or with the month as a word, numpy datetime64 (without a zone), and
    numbers that only one usual count explains (``time_numbers``): since 1970, a MATLAB datenum ... With dots the day
    comes first, "13.05.2024 10:00"; with slashes or dashes a date that does not begin with the year is read if only one
    order of day and month is possible. A date without a time of day is not read.

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
    >>> parse_time("2024-05-13T10:00:00"), parse_time(739385.5)
    (datetime.datetime(2024, 5, 13, 10, 0), datetime.datetime(2024, 5, 13, 12, 0))
    >>> parse_time("2024-05-13") is None
    True
    """
    return stated_time(value)[0]


def stated_time(value: Any, declared: str = "") -> tuple[datetime | None, str]:
    """Time of a time stamp as ``parse_time``, or what is unclear about a number.

    Parameters
    ----------
    value : any
        The time stamp as a library returns it.
    declared : str
        Its name and unit, which may say how a number counts.

    Returns
    -------
    tuple of (datetime or None, str)
        The time; without one, what a number may mean, "" for any other value.
    """
    if isinstance(value, np.generic) and not isinstance(value, np.datetime64):
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str) and NUMBER_TEXT.fullmatch(text := value.strip()) and len(text) != DAY_DIGITS:
        written = time_of_digits(text)
        return (written, "") if written else time_of_number(int(text) if text.isdecimal() else float(text), declared)
    if isinstance(value, (int, float)):
        return time_of_number(value, declared)
    return _time_of_stamp(value), ""


def _time_of_stamp(value: Any) -> datetime | None:
    """Time of a time stamp that is no number."""
    if isinstance(value, datetime):
        return value
    if isinstance(value, np.datetime64):
        if np.datetime_data(value.dtype)[0] in ("Y", "M", "W", "D"):
            return None
        stamp = value.astype("datetime64[us]").item()  # a whole number outside the years 1 to 9999, None for NaT
        return stamp if isinstance(stamp, datetime) else None
    if not isinstance(value, str):
        return None
    if vector := time_of_vector(value):
        return vector
    if match := WITH_UTC.fullmatch(value.strip()):
        time = _time_of_stamp(match[1])
        return time.replace(tzinfo=UTC) if time and time.tzinfo is None else None
    value = BEFORE_CLOCK.sub(" ", BEHIND_CLOCK.sub("", with_colons(_without_weekday(value.strip()))))
    value = HOURS_AND_MINUTES.sub(lambda match: f"{match[1]}:{match[2]}:{match[3] or '00'}", value)
    value = plain_stamp(DOTTED_CLOCK.sub(r"\1:\2:\3", value))
    if time := dated_time(value.strip()):
        return time
    if match := DOTTED_DATE.fullmatch(value.strip()):
        value = f"{match[3]}-{match[2]:0>2}-{match[1]:0>2}T{match[4]:0>2}:{match[5]}"
    if (zone := re.search(r"[+-]\d{2}:?(\d{2})$", value.strip())) and int(zone[1]) % 15 and ":" in value:
        return None  # no time zone has such an offset: the text is damaged
    text = re.sub(r"^(\d{4})/(\d{1,2})/(\d{1,2})(?=\D)", _with_dashes, value.strip())
    if is_date(text):
        return None
    if not ISO_CHARACTERS.fullmatch(text):  # Python skips other characters behind the microseconds
        return _parse_worded(text)
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None


def _without_weekday(text: str) -> str:
    """A time stamp without the weekday in front of its date. A month, as in "May 13, 2026", and a zone stay."""
    match = WORD_AHEAD.match(text)
    return text[match.end() :] if match and is_weekday(match[1]) else text


def _with_dashes(match: re.Match[str]) -> str:
    return f"{match[1]}-{match[2]:0>2}-{match[3]:0>2}"


def parse_uff_time(text: str) -> datetime | None:
    """Time in ID line 3 of a Universal File, DD-MMM-YY HH:MM:SS.

    Two-digit years from 70 on are 1970 to 1999. The month may be in another language.

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
        start = datetime(years, MONTHS.get(month[:3].lower()) or month_of(month), int(day), int(hour), int(minute))
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
