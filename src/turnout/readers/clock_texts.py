"""Columns of text with the time of day of each sample, with or without a date, as loggers print them."""

import re
from collections.abc import Sequence

import numpy as np

from turnout.readers.source import Source
from turnout.readers.texts import decode_text

DATE = r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.](?:\d{4}|\d{2})"
CLOCK = r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d{1,12})?)(?: ?([AaPp])\.?[Mm]\.?)?(?:Z| ?UTC| ?[+-]\d{2}:?\d{2})?"
STAMP = re.compile(rf" *(?:(?:{DATE})[T ,_]+)?{CLOCK} *")
DATE_ALONE = re.compile(rf" *(?:{DATE}) *")
DAY = 86400.0  # s
LONGEST_STEP_BACK = DAY / 2  # s: a larger one is midnight


def is_clock(text: str) -> bool:
    """Whether a text is a time of day with seconds, with or without a date before it.

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
    >>> [is_clock(text) for text in ("10:00:00.00005", "13.05.2026 10:00:00,5", "2026-05-13T10:00:00Z", "10:00", "3")]
    [True, True, True, False, False]
    """
    return bool(STAMP.fullmatch(text))


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
    return is_clock(text) or bool(DATE_ALONE.fullmatch(text))


def seconds_of_clock(texts: Sequence[str]) -> np.ndarray:
    """Seconds of times of day, counted from the first of them.

    The date is not read: where the time of day falls by more than half a day, the next day begins.

    Parameters
    ----------
    texts : (n,) sequence of str
        Times of day in a row, each as ``is_clock`` knows them.

    Returns
    -------
    (n,) array of float
        NaN where a text is none. [s]

    Examples
    --------
    >>> seconds_of_clock(["23:59:59.5", "00:00:00.0", "none", "00:00:01"])
    array([0. , 0.5, nan, 1.5])
    >>> seconds_of_clock(["05/13/2026 12:59:59 PM", "05/13/2026 01:00:00 PM"])
    array([0., 1.])
    """
    fields = [match.groups() if (match := STAMP.fullmatch(str(text))) else ("nan", "0", "0", None) for text in texts]
    hours, minutes, seconds, halves = zip(*fields)
    hour = np.array([float(h) % 12 + 12 * (half in "pP") if half else float(h) for h, half in zip(hours, halves)])
    second = np.array([float(s.replace(",", ".")) for s in seconds])
    time = 3600.0 * hour + 60.0 * np.array(minutes, dtype=float) + second
    is_read = np.isfinite(time)
    steps = np.diff(time[is_read], prepend=time[is_read][:1])
    time[is_read] += DAY * np.cumsum(steps < -LONGEST_STEP_BACK)
    return time - time[is_read][0] if is_read.any() else time


def with_durations(column: np.ndarray, where: str, source: Source) -> np.ndarray:
    """A column of texts that are times of day as durations since the first one; any other column unchanged.

    Parameters
    ----------
    column : (n,) array
        Values of a column.
    where : str
        The column, for the message.
    source : Source
        The raw file.

    Returns
    -------
    (n,) array
        Of timedelta64[ns] if its first value is a time of day and others differ from it.

    Raises
    ------
    ReadError
        If a later value is no time of day.
    """
    if column.ndim != 1 or len(column) < 2 or column.dtype.kind not in "OUST" or not is_clock(_text(column[0])):
        return column
    texts = [_text(value) for value in column]
    if len(set(texts)) == 1:  # the start, repeated in every row
        return column
    seconds = seconds_of_clock(texts)
    if not np.isfinite(seconds).all():
        k = int(np.argmin(np.isfinite(seconds)))
        problem = f"the time of sample {k} is {texts[k][:60]!r}, that of the first is {texts[0][:60]!r}"
        raise source.error(where, problem, "Export the record again from the logger", reason="not_finite")
    return np.round(seconds * 1e9).astype("timedelta64[ns]")


def _text(value: object) -> str:
    return decode_text(value) if isinstance(value, bytes) else str(value)
