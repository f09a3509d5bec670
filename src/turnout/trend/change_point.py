"""Estimate when a flagged chart changed and by how much, as a step or as a drift."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtr

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.forecast import step_autocorrelation
from turnout.trend.roots import find_root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

MIN_VALUES = 4  # values, fewer give no change point: level, size, onset and scatter are estimated


@dataclass(frozen=True)
class Change:
    """One change: ``shape`` is "step" or "drift", the more probable one; times in days.

    ``size`` is the change at the newest campaign, ``low`` and ``high`` its interval [%]. ``since`` is the median onset
    under that shape, ``earliest`` and ``latest`` its interval. The intervals average over both shapes, each with its
    probability, so a wrong choice of the shape does not narrow them.
    """

    shape: str
    since: float
    earliest: float
    latest: float
    size: float
    low: float
    high: float
    drift_probability: float


@dataclass(frozen=True)
class Fits:
    """Least-squares fits for every onset of one shape; (n_onset,) arrays.

    ``onset`` [a, relative to the newest value, negative] represents a time interval of ``width`` [a]. ``size`` [%] is
    the change at the newest value, ``weight`` its precision (sum of squares of the regressor), ``rss`` the residual sum
    of squares.
    """

    onset: np.ndarray
    width: np.ndarray
    size: np.ndarray
    weight: np.ndarray
    rss: np.ndarray


def fit_onsets(
    time: np.ndarray,
    values: np.ndarray,
    autocorrelation: float,
    pieces: int = 4,
    temperature: np.ndarray | None = None,
    slope_weight: float = 0.0,
) -> dict[str, Fits]:
    r"""Fit a level and a change for every onset, by generalised least squares with AR(1) errors.

    .. math:: y_i = l + b\,T_i + c\, x_i,\quad x_i = [t_i \ge \tau]\ \text{(step)},\quad
              x_i = \max(0, t_i - \tau) / (t_n - \tau)\ \text{(drift)}

    The values are already corrected for temperature with the slope of the baseline, which has an error. b is the
    remaining slope; without it a warm season could shift the onset. Every gap between values from the second one on is
    divided into ``pieces``, and the onset lies in the middle of one of them. The precision matrix of an AR(1) process
    is tridiagonal, so every sum over the values after an onset is a running sum: all onsets cost no more than one.

    Parameters
    ----------
    time, values : (n,) arrays of float
        Ascending [d], [%]; n >= 4.
    autocorrelation : float
        phi at the usual spacing.
    pieces : int
        Number of onsets in each gap between two values.
    temperature : (n,) array of float, optional
        [°C]; without it b = 0.
    slope_weight : float
        Squared ratio of the scatter to the error of the slope, if the slope was fitted to other values; 0 if it was
        fitted to these.

    Returns
    -------
    dict
        Fits of "step" and of "drift".

    Examples
    --------
    >>> t, y = np.arange(6.0), np.array([0.0, 0.0, 0.0, -2.0, -2.0, -2.0])
    >>> step = fit_onsets(t, y, 0.0, pieces=1)["step"]
    >>> best = np.argmin(step.rss)
    >>> print(f"{DAYS_PER_YEAR * step.onset[best]:.1f} {step.size[best]:.1f} {abs(step.rss[best]):.1f}")
    -2.5 -2.0 0.0
    """
    t = (time - time[-1]) / DAYS_PER_YEAR
    diagonal, off_diagonal = _precision(time, autocorrelation)

    def times_precision(v: np.ndarray) -> np.ndarray:
        product = diagonal * v + off_diagonal * np.append(v[1:], 0.0)
        product[1:] += off_diagonal[:-1] * v[:-1]
        return product

    one, y = times_precision(np.ones(t.size)), times_precision(values)
    after = np.append(t[1:], 0.0)
    terms = (one, t * one, y, t * y, diagonal + 2 * off_diagonal, t * diagonal + off_diagonal * (t + after))
    sums = [np.cumsum(v[::-1])[::-1] for v in (*terms, t * t * diagonal + 2 * off_diagonal * t * after)]
    i = np.repeat(np.arange(2, t.size), pieces)
    width = (t[i] - t[i - 1]) / pieces
    onset = t[i - 1] + (np.tile(np.arange(pieces), t.size - 2) + 0.5) * width
    one_0, one_1, y_0, y_1, self_0, self_1, self_2 = (s[i] for s in sums)
    total, total_y = one.sum(), y.sum()
    rss_total = max(float(values @ y) - total_y**2 / total, 0.0)
    temperature_centred = np.zeros(t.size) if temperature is None else temperature - (temperature @ one) / total
    temperature_weighted = times_precision(temperature_centred)
    temperature_square, temperature_y = (
        float(temperature_centred @ temperature_weighted) + slope_weight,
        float(temperature_weighted @ values),
    )
    per_degree = 1.0 / temperature_square if float(temperature_centred @ temperature_weighted) > 0.0 else 0.0
    temperature_0, temperature_1 = (
        np.cumsum(v[::-1])[::-1][i] for v in (temperature_weighted, t * temperature_weighted)
    )
    rss_total = max(rss_total - temperature_y**2 * per_degree, 0.0)

    def solve(square: np.ndarray, level: np.ndarray, product: np.ndarray, temperature_sum: np.ndarray) -> Fits:
        weight = np.maximum(square - level**2 / total - temperature_sum**2 * per_degree, 1e-300)
        moment = product - level * total_y / total - temperature_sum * temperature_y * per_degree
        rss = np.maximum(rss_total - moment**2 / weight, 1e-12 * max(rss_total, 1e-300))
        return Fits(onset, width, moment / weight, weight, rss)

    square = self_2 - 2.0 * onset * self_1 + onset**2 * self_0
    return {
        "step": solve(self_0, one_0, y_0, temperature_0),
        "drift": solve(
            square / onset**2,
            *(
                (v_1 - onset * v_0) / -onset
                for v_0, v_1 in ((one_0, one_1), (y_0, y_1), (temperature_0, temperature_1))
            ),
        ),
    }


def _precision(time: np.ndarray, autocorrelation: float) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal and off-diagonal of the precision matrix of an AR(1) process: (n,) arrays, the last off-diagonal 0."""
    phi = step_autocorrelation(time, autocorrelation)
    share = 1.0 / (1.0 - phi**2)
    diagonal, off_diagonal = np.append(1.0, share), np.append(-phi * share, 0.0)
    diagonal[:-1] += phi**2 * share
    return diagonal, off_diagonal


def find_change(
    time: ArrayLike,
    values: ArrayLike,
    autocorrelation: float,
    temperature: np.ndarray | None = None,
    slope_weight: float = 0.0,
    level: float = 0.95,
) -> Change:
    r"""Onset and size of one change, averaged over its shape and its onset.

    The prior is uniform over step and drift, over the onset and over the size; the scatter is unknown. Then an onset
    of one shape has the posterior probability

    .. math:: p \propto \Delta\tau\ w_\tau^{-1/2}\ RSS_\tau^{-\nu/2}

    with :math:`\nu` = number of values less level, size and temperature slope. Given the onset, the size has a Student
    t distribution about its least-squares value with :math:`\nu - 1` degrees of freedom (one for the onset). Intervals
    are the central ones of the mixture.

    Parameters
    ----------
    time : (n,) array of float
        Ascending times. [d]
    values : (n,) array of float
        Residuals. [%]
    autocorrelation : float
        AR(1) coefficient at the usual spacing.
    temperature : (n,) array of float or None
        Rail temperatures; None: no temperature slope. [°C]
    slope_weight : float
        Weight of the temperature slope, see ``fit_onsets``.
    level : float
        Probability of the intervals.

    Returns
    -------
    Change
        Onset, size and shape; nan with fewer than ``MIN_VALUES`` values or constant ones.

    References
    ----------
    Zellner, An Introduction to Bayesian Inference in Econometrics, 1971, ch. 3; averaging: Hoeting et al.,
    Bayesian model averaging, Statistical Science 14, 1999, eq. 1.

    Examples
    --------
    >>> t = np.arange(40.0) * 7.0
    >>> found = find_change(t, -0.2 * np.maximum(t / 7.0 - 25.0, 0.0) + 0.01 * np.cos(9.0 * t), 0.0)
    >>> print(found.shape, f"{found.since / 7.0:.1f} {found.size:.1f}")
    drift 25.0 -2.8
    """
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    n = values.size
    if n < MIN_VALUES or np.ptp(values) == 0.0:
        return Change("step", *(float("nan"),) * 6, 0.5)
    slope = temperature is not None and n > MIN_VALUES and np.ptp(temperature) > 0.0
    fits_by_shape = fit_onsets(
        time, values, autocorrelation, 4 if n < 150 else 2, temperature if slope else None, slope_weight
    )
    freedom = n - 2 - (slope and slope_weight == 0.0)
    log_p = [np.log(f.width) - 0.5 * np.log(f.weight) - 0.5 * freedom * np.log(f.rss) for f in fits_by_shape.values()]
    p = np.exp(np.concatenate(log_p) - max(v.max() for v in log_p))
    p = np.split(p / p.sum(), 2)
    step, drift = fits_by_shape["step"], fits_by_shape["drift"]
    shape = "drift" if p[1].sum() > 0.5 else "step"
    tail = 0.5 * (1.0 - level)
    first, last = _quantiles(step, p[0] + p[1], (tail, 1.0 - tail))
    since = _quantiles(fits_by_shape[shape], p[shape == "drift"], (0.5,))[0]
    joined = Fits(*(np.concatenate(pair) for pair in zip(vars(step).values(), vars(drift).values())))
    low, middle, high = _sizes(joined, np.concatenate(p), freedom - 1, (tail, 0.5, 1.0 - tail))
    since, first, last = (float(time[-1] + DAYS_PER_YEAR * x) for x in (min(max(since, first), last), first, last))
    return Change(shape, since, first, last, middle, low, high, float(p[1].sum()))


def _quantiles(fit: Fits, weight: np.ndarray, levels: Sequence[float]) -> list[float]:
    """Quantiles of the onset, its probability uniform over the width of each interval."""
    running = np.append(0.0, np.cumsum(weight) / weight.sum())
    edges = np.append(fit.onset[0] - 0.5 * fit.width[0], fit.onset + 0.5 * fit.width)
    return [float(np.interp(q, running, edges)) for q in levels]


def _sizes(fit: Fits, p: np.ndarray, freedom: int, levels: Sequence[float]) -> list[float]:
    """Quantiles of a mixture of Student t distributions; components below 1e-6 of the largest weight are left out."""
    use = p > 1e-6 * p.max()
    p, size = p[use] / p[use].sum(), fit.size[use]
    scale = np.sqrt(fit.rss[use] / freedom / fit.weight[use])
    half_range = 1e3 * scale.max() + np.ptp(size)

    def quantile(q: float) -> float:
        def shortfall(x: float) -> float:
            return float(np.sum(p * stdtr(freedom, (x - size) / scale))) - q

        return find_root(shortfall, size.min() - half_range, size.max() + half_range, 1e-9 * half_range)

    return [quantile(q) for q in levels]
