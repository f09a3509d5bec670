"""Start times as files write them."""

import math
import re
from datetime import UTC, datetime, timedelta

import numpy as np

MATLAB_EPOCH = 719529  # datenum of 1970-01-01
DOTTED = re.compile(r"(\d{1,2})\.\s?(\d{1,2})\.\s?(\d{4})[\sT,;]+(\d{1,2}):(\d{2}(?::\d{2}(?:[.,]\d{1,9})?)?)")
MONTHS = {m: i for i, m in enumerate("jan feb mar apr may jun jul aug sep oct nov dec".split(), start=1)}


def moment(value):
    """datetime of ISO 8601 text, numpy datetime64 (UTC), seconds since 1970 (UTC) or a MATLAB datenum; else None.

    With dots the day comes first, "13.05.2024 10:00"; with slashes nobody can tell.

    Examples
    --------
    >>> moment("2024-05-13T10:00:00"), moment(719529.5)
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
        if match := DOTTED.fullmatch(value.strip()):
            value = f"{match[3]}-{match[2]:0>2}-{match[1]:0>2}T{match[4]:0>2}:{match[5]}"
        try:
            return datetime.fromisoformat(value.strip())
        except ValueError:
            return None
    if isinstance(value, (int, float)) and math.isfinite(value):
        if 6e5 < value < 8e5:
            return datetime(1970, 1, 1) + timedelta(seconds=round((value - MATLAB_EPOCH) * 86400, 6))
        if 1e8 < value < 1e11:
            return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=value)
    return None


def uff_moment(text):
    """datetime of UFF's ID line 3, DD-MMM-YY HH:MM:SS; None where something else stands there.

    Two-digit years from 70 on are of the last century.

    >>> uff_moment("18-Apr-16 13:49:58")
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
