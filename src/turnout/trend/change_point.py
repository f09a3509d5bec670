"""Estimate when a flagged chart changed and by how much: one change or two, each a step or a drift."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtr

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.change_pairs import SHAPES, Pairs, find_pairs
from turnout.trend.forecast import step_autocorrelation
from turnout.trend.roots import find_root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

N_COMPONENTS = 400  # distributions that stand for all pairs of changes: quantiles are known to 1 / 400
MIN_SHARE = 0.25  # of the present change: a smaller first change is not its onset
MIN_VALUES = 4  # values, fewer give no change point: level, size, onset and scatter are estimated


@dataclass(frozen=True)
class Change:
    """What changed since when: ``shape`` is "step" or "drift", the more probable one; times in days.

    ``size`` is the change at the newest campaign, ``low`` and ``high`` its interval [%]. ``since`` is the median onset
    under that shape, ``earliest`` and ``latest`` its interval; of two changes it is the onset of the first in the
    direction that is asked for. The intervals average over one and two changes and their shapes, each with its
    probability, so a wrong choice does not narrow them. ``course`` is the shape and the onset of each change: two where
    their probability is above the level of the intervals, else one.
    """

    shape: str
    since: float
    earliest: float
    latest: float
    size: float
    low: float
    high: float
    drift_probability: float
    course: tuple[tuple[str, float], ...] = ()


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
    not_before: float = -np.inf,
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
    not_before : float
        Time before which no onset lies. [d]

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
    gaps = np.arange(2, t.size)
    gaps = gaps[time[2:] > not_before] if time[-1] > not_before else gaps
    i = np.repeat(gaps, pieces)
    start = np.maximum(t[i - 1], (min(not_before, time[-1]) - time[-1]) / DAYS_PER_YEAR)
    width = (t[i] - start) / pieces
    onset = start + (np.tile(np.arange(pieces), gaps.size) + 0.5) * width
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
    direction: str | None = None,
    not_before: float = -np.inf,
) -> Change:
    r"""Onset and size of the present change, averaged over one and two changes, their shapes and their onsets.

    The prior is uniform over step and drift, over the onset and over the size; the scatter is unknown. Then an onset
    of one shape has the posterior probability

    .. math:: p \propto \Delta\tau\ w_\tau^{-1/2}\ RSS_\tau^{-\nu/2}

    with :math:`\nu` = number of values less level, size and temperature slope. Given the onset, the size has a Student
    t distribution about its least-squares value with :math:`\nu - 1` degrees of freedom (one for the onset), of two
    changes :math:`\nu - 3`. Intervals are the central ones of the mixture. ``find_pairs`` gives the pairs of changes.

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
    direction : str or None
        "down" or "up": of two changes, the onset is that of the first in this direction; None: in that of their sum.
    not_before : float
        Time before which no onset lies. [d]

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
    >>> found = find_change(t, -0.2 * np.maximum(t / 7.0 - 25.0, 0.0) + 0.1 * np.cos(3.0 * t), 0.0)
    >>> print(found.shape, f"{found.since / 7.0:.0f} {found.size:.0f}")
    drift 25 -3
    """
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    n = values.size
    if n < MIN_VALUES or np.ptp(values) == 0.0:
        return Change("step", *(float("nan"),) * 6, 0.5)
    slope = temperature is not None and n > MIN_VALUES and np.ptp(temperature) > 0.0
    law = (temperature if slope else None, slope_weight)
    pieces = 4 if n < 150 else 2
    fits = fit_onsets(time, values, autocorrelation, pieces, *law, not_before)
    freedom = n - 2 - (slope and slope_weight == 0.0)
    log_p = np.concatenate(
        [np.log(f.width) - 0.5 * np.log(f.weight) - 0.5 * freedom * np.log(f.rss) for f in fits.values()]
    )
    p = np.exp(log_p - log_p.max())
    paired = fit_onsets(time, values, autocorrelation, 1, *law, not_before)
    pairs = find_pairs(time, values, autocorrelation, paired, freedom, *law)
    share = 0.0 if pairs is None else float(pairs.probability.sum())
    p *= (1.0 - share) / p.sum()
    components = [_SizeMixture.of_one(fits, p, freedom - 1)]
    course: tuple[tuple[str, float], ...] = ()
    present = p  # probability of each shape and onset of the present change
    if pairs is not None:
        components.append(_SizeMixture.of_two(pairs, freedom - 3))
        count = 2 * paired["step"].onset.size
        of_pairs = np.bincount(_present_change(pairs, direction), pairs.probability, minlength=count)
        present = p + np.repeat(of_pairs / pieces, pieces)
        if share > level:
            course = _course_of(pairs, paired["step"].onset)
    step, drift = np.split(present, 2)
    shape = SHAPES[int(drift.sum() > 0.5)]
    tail = 0.5 * (1.0 - level)
    first, last = _quantiles(fits["step"], step + drift, (tail, 1.0 - tail))
    since = _quantiles(fits["step"], drift if shape == "drift" else step, (0.5,))[0]
    since = min(max(since, first), last)
    course = course or ((shape, since),)
    low, middle, high = _sizes(components, (tail, 0.5, 1.0 - tail))

    def day(years: float) -> float:
        return float(time[-1] + DAYS_PER_YEAR * years)

    return Change(
        shape, day(since), day(first), day(last), middle, low, high, float(drift.sum()),
        tuple((name, day(years)) for name, years in course),
    )  # fmt: skip


def _course_of(pairs: Pairs, onset: np.ndarray) -> tuple[tuple[str, float], ...]:
    """Shape and onset [a, relative to the newest value] of both changes of the most probable pair."""
    likeliest = int(np.argmax(pairs.probability))
    columns = int(pairs.first[likeliest]), int(pairs.second[likeliest])
    return tuple((SHAPES[c // onset.size], float(onset[c % onset.size])) for c in columns)


def _present_change(pairs: Pairs, direction: str | None) -> np.ndarray:
    """Column of the first change of each pair in the direction, that of their sum where none is given.

    A first change smaller than ``MIN_SHARE`` of the sum does not count.
    """
    total = pairs.sizes.sum(axis=0)
    sign = np.sign(total) if direction is None else {"down": -1.0, "up": 1.0}[direction]
    return np.where(pairs.sizes[0] * sign >= MIN_SHARE * np.abs(total), pairs.first, pairs.second)


def _quantiles(fit: Fits, weight: np.ndarray, levels: Sequence[float]) -> list[float]:
    """Quantiles of the onset, its probability uniform over the width of each interval."""
    running = np.append(0.0, np.cumsum(weight) / weight.sum())
    edges = np.append(fit.onset[0] - 0.5 * fit.width[0], fit.onset + 0.5 * fit.width)
    return [float(np.interp(q, running, edges)) for q in levels]


@dataclass(frozen=True)
class _SizeMixture:
    """Student t distributions of the size with their probabilities ``p``: (n,) arrays, and their ``freedom``."""

    p: np.ndarray
    size: np.ndarray
    scale: np.ndarray
    freedom: int

    @classmethod
    def of_one(cls, fits: dict[str, Fits], p: np.ndarray, freedom: int) -> _SizeMixture:
        """Of one change; components below 1e-6 of the largest probability are left out."""
        joined = Fits(*(np.concatenate(pair) for pair in zip(*(vars(f).values() for f in fits.values()))))
        use = p > 1e-6 * p.max()  # none where one change is impossible
        scale = np.sqrt(joined.rss[use] / freedom / joined.weight[use])
        return cls(p[use], joined.size[use], scale, freedom)

    @classmethod
    def of_two(cls, pairs: Pairs, freedom: int) -> _SizeMixture:
        """Of the sums of two changes: ``N_COMPONENTS`` of equal probability stand for all pairs, ordered by size."""
        size = pairs.sizes.sum(axis=0)
        order = np.argsort(size)
        running = np.cumsum(pairs.probability[order])
        use = order[np.searchsorted(running, (np.arange(N_COMPONENTS) + 0.5) / N_COMPONENTS * running[-1])]
        scale = np.sqrt(pairs.rss[use] / freedom * pairs.variance[use])
        return cls(np.full(N_COMPONENTS, running[-1] / N_COMPONENTS), size[use], scale, freedom)


def _sizes(mixture: Sequence[_SizeMixture], levels: Sequence[float]) -> list[float]:
    """Quantiles of a mixture of Student t distributions."""
    components = [component for component in mixture if component.size.size]
    total = sum(float(component.p.sum()) for component in components)
    low, high = (
        min(float(component.size.min()) for component in components),
        max(float(component.size.max()) for component in components),
    )
    half_range = 1e3 * max(float(component.scale.max()) for component in components) + high - low

    def quantile(q: float) -> float:
        def shortfall(x: float) -> float:
            below = sum(
                float(np.sum(component.p * stdtr(component.freedom, (x - component.size) / component.scale)))
                for component in components
            )
            return below / total - q

        return find_root(shortfall, low - half_range, high + half_range, 1e-9 * half_range)

    return [quantile(q) for q in levels]
