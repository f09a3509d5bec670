"""Forecast when a resonance reaches its limit, as an interval of dates or none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from turnout.constants import DAYS_PER_YEAR

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings

N_RECENT = 8  # newest values, whose mean is the present level of a chart
SETTLING_YEARS = np.geomspace(0.05, 10.0, 40)  # time constants of the settling curve that are tried [a]


@dataclass(frozen=True)
class Forecast:
    """``verdict``: line, line_or_settling, settling, no_limit, too_short or reached.

    ``slope`` and its standard error ``slope_error`` [%/a] are from generalised least squares. ``not_before`` and
    ``not_after`` [a after the last value] are the ends of the interval of the crossing, nan where there is none.
    ``not_after`` is given for the verdict line alone. ``preference`` is AIC(line) - AIC(settling).
    """

    verdict: str
    slope: float
    slope_error: float
    not_before: float
    not_after: float
    preference: float

    @property
    def sentence(self) -> str:
        """The forecast in words: the earliest date, never one date alone, or why there is none."""
        if self.verdict == "reached":
            return "the limit is reached"
        if self.verdict == "too_short":
            return "too early for a date"
        if self.verdict == "settling":
            return "no date: the values settle"
        if self.verdict == "no_limit":
            return "no limit in sight"
        if self.not_before == 0.0:
            latest = "" if not self.not_after > 0.0 else f", by {self.not_after:.1f} years if it goes on like this"
            return f"the limit may be reached already{latest}"
        if np.isfinite(self.not_after):
            return f"not before {self.not_before:.1f} years, by {self.not_after:.1f} years if it goes on like this"
        return f"not before {self.not_before:.1f} years, no latest date"


def step_autocorrelation(time: np.ndarray, autocorrelation: float) -> np.ndarray:
    """AR(1) coefficient from each value to the next.

    Parameters
    ----------
    time : (n,) array of float
        Ascending times. [d]
    autocorrelation : float
        Coefficient at the median spacing.

    Returns
    -------
    (n - 1,) array of float
        Coefficient of each step, 0 for a step of no length.

    Examples
    --------
    >>> step_autocorrelation(np.array([0.0, 1.0, 2.0, 4.0]), 0.5)
    array([0.5 , 0.5 , 0.25])
    """
    step = np.diff(time)
    usual = np.median(step)
    phi = autocorrelation ** (step / usual) if usual > 0.0 else np.full(step.size, autocorrelation)
    return np.where(step <= 0.0, 0.0, phi)


def whiten(
    design: np.ndarray, values: np.ndarray, time: np.ndarray, autocorrelation: float
) -> tuple[np.ndarray, np.ndarray]:
    r"""Whiten a regression with AR(1) errors and unequal spacing.

    .. math:: y_i' = \frac{y_i - \phi_i y_{i-1}}{\sqrt{1 - \phi_i^2}}, \quad
              \phi_i = \phi^{(t_i - t_{i-1}) / \tilde{\Delta t}}

    with the median spacing :math:`\tilde{\Delta t}`; the first value stays as it is (Prais and Winsten 1954).

    Parameters
    ----------
    design : (n, n_column) array of float
        Design matrix.
    values : (n,) array of float
        Values. [%]
    time : (n,) array of float
        Ascending times. [d]
    autocorrelation : float
        AR(1) coefficient at the usual spacing.

    Returns
    -------
    (n, n_column) and (n,) arrays of float
        Whitened design and values.

    References
    ----------
    Prais and Winsten 1954 for the first value.
    """
    phi = step_autocorrelation(time, autocorrelation)
    scale = 1.0 / np.sqrt(1.0 - phi**2)
    rows = np.vstack([design[:1], (design[1:] - phi[:, None] * design[:-1]) * scale[:, None]])
    return rows, np.append(values[:1], (values[1:] - phi * values[:-1]) * scale)


def fit_line(time: np.ndarray, values: np.ndarray, autocorrelation: float) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Fit a line by generalised least squares.

    Parameters
    ----------
    time : (n,) array of float
        Ascending times. [d]
    values : (n,) array of float
        Values. [%]
    autocorrelation : float
        AR(1) coefficient at the usual spacing.

    Returns
    -------
    ((2,) array, (2, 2) array, float, int)
        Level at the last value [%] and slope [%/a], their covariance, residual sum of squares, degrees of freedom.

    Examples
    --------
    >>> fit = fit_line(np.arange(5.0) * 365.25, np.array([1.0, 0.0, -1.0, -2.0, -3.0]), 0.3)
    >>> fit[0].round(6)
    array([-3., -1.])
    """
    years = (time - time[-1]) / DAYS_PER_YEAR
    design, y = whiten(np.column_stack([np.ones(years.size), years]), values, time, autocorrelation)
    coefficient, _, _, _ = np.linalg.lstsq(design, y, rcond=None)
    rss = float(np.sum((y - design @ coefficient) ** 2))
    freedom = years.size - 2
    covariance = np.linalg.inv(design.T @ design) * rss / max(freedom, 1)
    return coefficient, covariance, rss, freedom


def settling_rss(time: np.ndarray, values: np.ndarray, autocorrelation: float) -> float:
    """Smallest residual sum of squares of a settling curve, a + c exp(-t / tau), over a grid of tau.

    Parameters
    ----------
    time : (n,) array of float
        Ascending times. [d]
    values : (n,) array of float
        Values. [%]
    autocorrelation : float
        AR(1) coefficient at the usual spacing.

    Returns
    -------
    float
        Residual sum of squares of the whitened values. [%²]
    """
    years = (time - time[0]) / DAYS_PER_YEAR
    lowest = np.inf
    for tau in SETTLING_YEARS:
        design, y = whiten(np.column_stack([np.ones(years.size), np.exp(-years / tau)]), values, time, autocorrelation)
        coefficient, _, _, _ = np.linalg.lstsq(design, y, rcond=None)
        lowest = min(lowest, float(np.sum((y - design @ coefficient) ** 2)))
    return lowest


def crossing_interval(
    coefficient: np.ndarray, covariance: np.ndarray, freedom: int, limit: float, level: float
) -> tuple[float, float]:
    r"""Interval of the time at which a line reaches ``limit`` (Fieller).

    All t >= 0 with :math:`|a + b t - L| \le q\, \mathrm{se}(a + b t)`, with q a quantile of Student's t.

    Parameters
    ----------
    coefficient : (2,) array of float
        Level a at time 0 [%] and slope b [%/a].
    covariance : (2, 2) array of float
        Their covariance.
    freedom : int
        Degrees of freedom.
    limit : float
        Limit L. [%]
    level : float
        Probability of the interval.

    Returns
    -------
    (float, float)
        Earliest and latest time [a]: (nan, nan) where the line never reaches the limit, (t, nan) where there is no
        latest time, (0, 0) where the level at time 0 is below the limit by more than its error.

    References
    ----------
    Fieller, Some problems in interval estimation, J. Royal Stat. Soc. B 16, 1954.

    Examples
    --------
    A line known almost exactly, 1 %/a from 0 to -5.

    >>> print(*(f"{t:.2f}" for t in crossing_interval(np.array([0.0, -1.0]), np.eye(2) * 1e-12, 50, -5.0, 0.8)))
    5.00 5.00
    """
    q = -stdtrit(freedom, (1.0 - level) / 2.0)
    a, b = float(coefficient[0]) - limit, float(coefficient[1])
    square = b * b - q * q * covariance[1, 1]
    half = a * b - q * q * covariance[0, 1]
    constant = a * a - q * q * covariance[0, 0]
    never = (float("nan"), float("nan"))
    if constant > 0.0 >= a:
        return 0.0, 0.0
    if constant > 0.0 and square > 0.0 and b >= 0.0:
        return never
    root = np.sqrt(max(half * half - square * constant, 0.0))
    first = 0.0 if constant <= 0.0 else float(constant / (root - half))
    return (first, float((root - half) / square)) if square > 0.0 > b else (first, never[1])


def forecast(time: np.ndarray, values: np.ndarray, autocorrelation: float, settings: TrendSettings) -> Forecast:
    """When the values reach ``settings.limit_percent``, with the interval of ``settings.interval_level``.

    If the mean of the last ``N_RECENT`` values is beyond the limit, it is reached. Otherwise a line is compared with a
    settling curve by AIC. If the curve is better, there is no date: a line through settling values would give a date
    that never comes. If neither is better by 2, there is no latest date.

    Parameters
    ----------
    time, values : (n,) arrays of float
        Ascending [d] and [%] relative to the level before the change.
    autocorrelation : float
        AR(1) coefficient at the usual spacing.
    settings : TrendSettings
        Limit, probability of the interval, horizon and shortest time.

    Returns
    -------
    Forecast
        Verdict with slope and interval.
    """
    nan = float("nan")
    if time.size and values[-N_RECENT:].mean() <= settings.limit_percent:
        return Forecast("reached", nan, nan, 0.0, nan, nan)
    if time.size < 12 or time[-1] - time[0] < settings.drift_days:
        return Forecast("too_short", nan, nan, nan, nan, nan)
    coefficient, covariance, rss, freedom = fit_line(time, values, autocorrelation)
    slope, error = float(coefficient[1]), float(np.sqrt(covariance[1, 1]))
    rss_settling = settling_rss(time, values, autocorrelation)
    n = time.size
    preference = n * np.log(max(rss, 1e-300) / max(rss_settling, 1e-300)) - 2.0
    low, high = crossing_interval(coefficient, covariance, freedom, settings.limit_percent, settings.interval_level)
    if preference > 0.0:
        return Forecast("settling", slope, error, nan, nan, preference)
    if not np.isfinite(low) or low > settings.horizon_years:
        return Forecast("no_limit", slope, error, nan, nan, preference)
    if preference > -2.0:
        return Forecast("line_or_settling", slope, error, low, nan, preference)
    return Forecast("line", slope, error, low, high, preference)
