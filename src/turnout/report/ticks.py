"""Where the ticks of an axis stand and what they say."""

import math
from datetime import datetime, timedelta

SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def linear_ticks(low, high, about=5):
    """Round numbers between ``low`` and ``high``, steps of 1, 2 or 5 times a power of ten.

    >>> linear_ticks(0.0, 1.0)
    [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    >>> linear_ticks(98.2, 103.9)
    [99.0, 100.0, 101.0, 102.0, 103.0]
    """
    if not high > low:
        return [low]
    raw = (high - low) / about
    magnitude = 10.0 ** math.floor(math.log10(raw))
    step = min((s * magnitude for s in (1, 2, 5, 10)), key=lambda s: abs(s - raw))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    decimals = max(12, 3 - math.floor(math.log10(step)))
    return [round(k * step, decimals) for k in range(first, last + 1)]


def log_ticks(low, high):
    """Powers of ten between ``low`` and ``high``, with 2 and 5 where there are few.

    >>> log_ticks(30.0, 2000.0)
    [50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0]
    """
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    decades = [10.0**k for k in exponents if low <= 10.0**k <= high]
    if len(decades) >= 3:
        return decades
    return [m * 10.0**k for k in exponents for m in (1, 2, 5) if low <= m * 10.0**k <= high]


def time_ticks(low, high, about=6):
    """Starts of months or years between two POSIX times [s], at most ``about`` or so.

    >>> from datetime import UTC
    >>> start = datetime(2024, 1, 10, tzinfo=UTC).timestamp()
    >>> [say_day(t) for t in time_ticks(start, start + 3 * 365.25 * 86400)]
    ['Jul 2024', 'Jan 2025', 'Jul 2025', 'Jan 2026', 'Jul 2026', 'Jan 2027']
    """
    months = (high - low) / (30.44 * 86400)
    step = next((s for s in (1, 2, 3, 6, 12, 24, 60, 120) if months / s <= about + 1), 120)
    epoch = datetime(1970, 1, 1)
    day = (epoch + timedelta(seconds=low)).replace(day=1, hour=0, minute=0, second=0, microsecond=0)
    ticks = []
    while (seconds := (day - epoch).total_seconds()) <= high:
        if seconds >= low and (day.year * 12 + day.month - 1) % step == 0:
            ticks.append(seconds)
        day = (day + timedelta(days=32)).replace(day=1)
    return ticks


def say_number(value, step=None):
    """A tick's number, as short as it can be, with the digits that tell it from the next one, ``step`` away.

    >>> say_number(0.2), say_number(1500.0), say_number(1e-9), say_number(0.0)
    ('0.2', '1500', '10⁻⁹', '0')
    >>> say_number(530.00002, step=1e-5)
    '530.00002'
    """
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)) + 1e-12)
    needed = exponent - math.floor(math.log10(step) + 1e-12) + 1 if step else 0
    if -4 <= exponent <= 4:
        return f"{value:.{max(6, needed)}g}"
    mantissa = value / 10.0**exponent
    power = "10" + str(exponent).translate(SUPERSCRIPTS)
    return power if abs(mantissa - 1) < 1e-9 and needed <= 3 else f"{mantissa:.{max(3, needed)}g}·{power}"


def say_day(seconds):
    """Month and year of a POSIX time."""
    return (datetime(1970, 1, 1) + timedelta(seconds=seconds)).strftime("%b %Y")
