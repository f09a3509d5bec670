"""Compute the sampling distribution of a coherence estimate and the confidence limits that follow from it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

# Tables over u = -ln(1 - coherence) from 0 (none) to 30 (1 - 1e-13), finer near 0 where u(v) has most curvature.
TABLE_NODES = 30.0 * np.linspace(0.0, 1.0, 201) ** 3


def coherence_distribution(estimate: ArrayLike, true: ArrayLike, n: int) -> np.ndarray:
    r"""Probability that a coherence averaged over n independent records is at most ``estimate``.

    .. math:: P = z \left(\frac{1-\gamma^2}{1-\gamma^2 z}\right)^{\!n} \sum_{k=0}^{n-2}
        \left(\frac{1-z}{1-\gamma^2 z}\right)^{\!k} {}_2F_1(-k,\, 1-n;\, 1;\, \gamma^2 z)

    Exact for Gaussian records; force spectra that repeat exactly give a slightly narrower distribution.

    Parameters
    ----------
    estimate, true : (...) array of float in [0, 1]
        Estimate z and true magnitude-squared coherence; broadcast against each other. [-]
    n : int
        Independent records averaged, 2 or more, else ValueError.

    Returns
    -------
    (...) array of float

    Raises
    ------
    ValueError
        ``n`` is below 2.

    References
    ----------
    Carter, Knapp and Nuttall 1973, IEEE Trans. Audio Electroacoust. 21(4), 337-344, eq. 3.

    Examples
    --------
    For incoherent signals, ten averages are below 0.283 in 95 % of all cases: 1 - 0.05^(1/9).

    >>> print(round(float(coherence_distribution(0.28313, 0.0, 10)), 4))
    0.95
    """
    if n < 2:
        raise ValueError("one record has coherence 1 at every frequency: need 2 or more")
    z, c = np.broadcast_arrays(np.asarray(estimate, dtype=float), np.asarray(true, dtype=float))
    return _distribution_of_complements(1.0 - z, 1.0 - c, n)


def _distribution_of_complements(b: np.ndarray, a: np.ndarray, n: int) -> np.ndarray:
    """Distribution from b = 1 - estimate and a = 1 - true, which keeps all digits near coherence 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return _sum_of_logs(np.asarray(b), np.asarray(a), n)


def _sum_of_logs(b: np.ndarray, a: np.ndarray, n: int) -> np.ndarray:
    """Sum of the series; all terms are positive, and logarithms and ratios avoid overflow at large n."""
    denominator = a + b - a * b
    x = (1.0 - a) * (1.0 - b)
    log_step = np.log(b) - np.log(denominator)
    log_term = np.log1p(-b) + n * (np.log(a) - np.log(denominator))
    total = np.exp(log_term)
    ratio = np.ones_like(x)
    for k in range(n - 2):
        ratio = (2 * k + 1 + (n - 1 - k) * x - k * (1.0 - x) / ratio) / (k + 1)
        log_term = log_term + log_step + np.log(ratio)
        total = total + np.exp(log_term)
    return np.where(b <= 0.0, 1.0, np.where((b >= 1.0) | (a <= 0.0), 0.0, np.minimum(total, 1.0)))


@lru_cache(maxsize=256)
def _quantile_table(n: int, probability: float) -> scipy.interpolate.CubicSpline:
    """Spline from v = -ln(1 - quantile) to u = -ln(1 - true), both free of cancellation and nearly parallel."""
    u = TABLE_NODES
    low, high = np.zeros_like(u), u + 40.0
    for _ in range(60):
        v = 0.5 * (low + high)
        below = _distribution_of_complements(np.exp(-v), np.exp(-u), n) < probability
        low, high = np.where(below, v, low), np.where(below, high, v)
    return scipy.interpolate.CubicSpline(0.5 * (low + high), u)


def true_coherence_with_quantile(estimate: ArrayLike, n: int, probability: float) -> np.ndarray:
    """True coherence whose estimates are below the given one with the given probability.

    Inverts ``coherence_distribution`` through a table; 0 where zero coherence already
    explains the estimate. One record allows no statement: 0 for probabilities above one half, else 1.

    Parameters
    ----------
    estimate : (...) array of float in [0, 1]
        Magnitude-squared coherence averaged over ``n`` records. [-]
    n : int
        Independent records averaged.
    probability : float
        Probability of an estimate below the given one. [-]

    Returns
    -------
    (...) array of float
        True coherence; nan where the estimate is nan. [-]

    Examples
    --------
    >>> print(true_coherence_with_quantile([0.2, 1.0 - 0.05 ** (1 / 9), 1.0], 10, 0.95).round(3))
    [0. 0. 1.]
    """
    z = np.clip(np.asarray(estimate, dtype=float), 0.0, 1.0)
    if n < 2:
        return np.where(np.isnan(z), np.nan, 0.0 if probability > 0.5 else 1.0)
    table = _quantile_table(int(n), float(probability))
    v_low, v_high = table.x[0], table.x[-1]
    v = -np.log(np.maximum(1.0 - z, np.exp(-v_high)))
    return np.where(z >= 1.0, 1.0, -np.expm1(-np.where(v <= v_low, 0.0, table(np.maximum(v, v_low)))))


def coherence_limits(estimate: ArrayLike, n: int, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
    """Two-sided confidence limits of the true coherence.

    Parameters
    ----------
    estimate : (n_frequency,) array of float
        Magnitude-squared coherence averaged over ``n`` records. [-]
    n : int
        Records averaged. With one record the limits are 0 and 1.
    level : float
        Probability that the limits enclose the true value.

    Returns
    -------
    low, high : (n_frequency,) array of float

    Examples
    --------
    Thirty records of true coherence 0.8 give 0.70 to 0.88 in 95 % of all tests (by simulation). So 0.8 is the upper
    limit of the one estimate and the lower limit of the other.

    >>> low, high = coherence_limits(np.array([0.70, 0.88]), 30)
    >>> print(f"{high[0]:.2f} {low[1]:.2f}")
    0.80 0.80
    """
    tail = (1.0 - level) / 2.0
    return (
        true_coherence_with_quantile(estimate, n, 1.0 - tail),
        true_coherence_with_quantile(estimate, n, tail),
    )


def lower_coherence_limit(estimate: ArrayLike, n: int, level: float = 0.95) -> np.ndarray:
    """One-sided lower confidence limit of the true coherence, which the coherence gate uses.

    For a limit of 0.8 ten averages must give 0.91, thirty 0.87.

    Parameters
    ----------
    estimate : (...) array of float in [0, 1]
        Magnitude-squared coherence averaged over ``n`` records. [-]
    n : int
        Independent records averaged.
    level : float
        Probability that the true coherence is above the limit. [-]

    Returns
    -------
    (...) array of float
        Lower limit. [-]

    Examples
    --------
    >>> print(lower_coherence_limit(0.913, 10).round(2), lower_coherence_limit(0.87, 30).round(2))
    0.8 0.8
    """
    return true_coherence_with_quantile(estimate, n, level)
