"""Axes of charts: values to shares of the width, and round numbers or days as ticks with their texts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from turnout.number_text import power_of_ten_text
from turnout.report.formatting import escape

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

N_AXES = 256  # axes whose ticks are remembered: those of one turnout's charts


def linear_ticks(low: float, high: float, n_target: int = 5) -> list[float]:
    """Round numbers between ``low`` and ``high``, steps of 1, 2 or 5 times a power of ten.

    Parameters
    ----------
    low : float
        Lowest value.
    high : float
        Highest value.
    n_target : int
        Number of ticks that is aimed at.

    Returns
    -------
    list of float
        Values.

    Examples
    --------
    >>> linear_ticks(0.0, 1.0)
    [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    >>> linear_ticks(98.2, 103.9)
    [99.0, 100.0, 101.0, 102.0, 103.0]
    """
    if not high > low:
        return [low]
    raw = (high - low) / n_target
    magnitude = 10.0 ** math.floor(math.log10(raw))
    step = min((s * magnitude for s in (1, 2, 5, 10)), key=lambda s: abs(s - raw))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    decimals = max(12, 3 - math.floor(math.log10(step)))
    return [round(k * step, decimals) for k in range(first, last + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten between ``low`` and ``high``, with 2 and 5 where there are few.

    Parameters
    ----------
    low : float
        Lowest value, above 0.
    high : float
        Highest value.

    Returns
    -------
    list of float
        Values.

    Examples
    --------
    >>> log_ticks(30.0, 2000.0)
    [50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0]
    """
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    decades = [10.0**k for k in exponents if low <= 10.0**k <= high]
    if len(decades) >= 3:
        return decades
    return [m * 10.0**k for k in exponents for m in (1, 2, 5) if low <= m * 10.0**k <= high]


N_TIME_TICKS = 6  # number of ticks that is aimed at


def time_ticks(low: float, high: float) -> list[float]:
    """Starts of months or years between two POSIX times.

    Parameters
    ----------
    low : float
        Earliest time. [s]
    high : float
        Latest time. [s]

    Returns
    -------
    list of float
        POSIX times. [s]

    Examples
    --------
    >>> from datetime import UTC
    >>> start = datetime(2024, 1, 10, tzinfo=UTC).timestamp()
    >>> [format_day(t) for t in time_ticks(start, start + 3 * 365.25 * 86400)]
    ['Jul 2024', 'Jan 2025', 'Jul 2025', 'Jan 2026', 'Jul 2026', 'Jan 2027']
    """
    months = (high - low) / (30.44 * 86400)
    step = next((s for s in (1, 2, 3, 6, 12, 24, 60, 120) if months / s <= N_TIME_TICKS + 1), 120)
    epoch = datetime(1970, 1, 1)
    day = (epoch + timedelta(seconds=low)).replace(day=1, hour=0, minute=0, second=0, microsecond=0)
    ticks = []
    while (seconds := (day - epoch).total_seconds()) <= high:
        if seconds >= low and (day.year * 12 + day.month - 1) % step == 0:
            ticks.append(seconds)
        day = (day + timedelta(days=32)).replace(day=1)
    return ticks


def format_number(value: float, step: float | None = None) -> str:
    """Short text of a tick's number, with enough digits to differ from the next tick.

    Parameters
    ----------
    value : float
        The number.
    step : float or None
        Distance to the next tick.

    Returns
    -------
    str
        Text.

    Examples
    --------
    >>> format_number(0.2), format_number(1500.0), format_number(1e-9), format_number(0.0)
    ('0.2', '1500', '10⁻⁹', '0')
    >>> format_number(-1.5e-4), format_number(1.5e-5), format_number(2e4), format_number(2e5)
    ('-0.00015', '1.5·10⁻⁵', '20000', '2·10⁵')
    >>> format_number(999_990.0, step=1e6), format_number(-1e5)
    ('10⁶', '-10⁵')
    >>> format_number(530.00002, step=1e-5)
    '530.00002'
    """
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)) + 1e-12)
    n_digits = exponent - math.floor(math.log10(step) + 1e-12) + 1 if step else 0
    if -4 <= exponent <= 4:
        return f"{value:.{max(6, n_digits)}g}"
    return power_of_ten_text(value, max(3, n_digits))


def format_day(seconds: float) -> str:
    """Month and year of a POSIX time.

    Parameters
    ----------
    seconds : float
        POSIX time. [s]

    Returns
    -------
    str
        For example "Jul 2024".
    """
    return (datetime(1970, 1, 1) + timedelta(seconds=seconds)).strftime("%b %Y")


@dataclass
class Axis:
    """Maps values to pixels; ``scale`` is "linear", "log", "time", or "names": the k-th of ``names`` at k, from 1."""

    low: float
    high: float
    label: str = ""
    scale: str = "linear"
    names: tuple = ()

    def __post_init__(self) -> None:
        if not self.high > self.low:
            pad = abs(self.low) * 0.05 or 1.0
            self.low, self.high = self.low - pad, self.high + pad

    def share(self, values: ArrayLike) -> np.ndarray:
        """Relative position of values along the axis, 0 to 1.

        Parameters
        ----------
        values : float or (...) array
            Values.

        Returns
        -------
        (...) array
            Position; outside 0 to 1 for values beyond the ends.
        """
        if isinstance(values, (float, int)):  # much faster than an array of one value
            if self.scale != "log":
                return np.float64((values - self.low) / (self.high - self.low))
            if values > 0.0:
                return np.float64(math.log(values / self.low) / math.log(self.high / self.low))
        values = np.asarray(values, dtype=float)
        if self.scale == "log":
            with np.errstate(divide="ignore", invalid="ignore"):
                first, last = self._exponents
                return (np.log10(values) - first) / (last - first)
        return (values - self.low) / (self.high - self.low)

    @cached_property
    def _exponents(self) -> tuple[float, float]:
        """Powers of ten at the ends of a logarithmic axis."""
        return np.log10(self.low), np.log10(self.high)

    def ticks(self) -> list[tuple[float, str]]:
        """Pairs of value and text of the ticks."""
        if self.scale == "names":
            return [(k, escape(name)) for k, name in enumerate(self.names, start=1)]
        return _ticks(float(self.low), float(self.high), self.scale)


@lru_cache(maxsize=N_AXES)
def _ticks(low: float, high: float, scale: str) -> list[tuple[float, str]]:
    """Value and text of the ticks of an axis of numbers or times."""
    if scale == "time":
        middle = (low + high) / 2
        day = (datetime(1970, 1, 1) + timedelta(seconds=middle)).strftime("%Y-%m-%d")
        # an axis of a few days has no start of a month: its middle is named
        return [(t, format_day(t)) for t in time_ticks(low, high)] or [(middle, day)]
    if scale == "log":
        return [(v, format_number(v)) for v in log_ticks(low, high)]
    values = linear_ticks(low, high)
    step = values[1] - values[0] if len(values) > 1 else None
    return [(v, format_number(v, step)) for v in values]
