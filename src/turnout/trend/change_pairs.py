"""Two changes of one chart: every pair of onsets, and its probability against one change.

A section may change twice within one epoch: a second step, a growth after a step, or a return to the old level.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.forecast import whiten

if TYPE_CHECKING:
    from turnout.trend.change_point import Fits

MIN_VALUES = 8  # values, fewer do not determine level, two sizes and two onsets with a scatter
MIN_DISTANCE = 3  # campaigns between two changes: two drifts that begin closer are one that begins between them
MIN_PROBABILITY = 0.01  # two changes less probable than this are left out
LEFT_OUT = 1e-6  # pairs less probable than this, relative to the most probable one, are left out
SHAPES = ("step", "drift")


@dataclass(frozen=True)
class Pairs:
    """Pairs of changes with their probabilities; (n_pair,) arrays unless stated.

    ``probability`` is that of each pair, its sum that of two changes against one. ``first`` and ``second`` are columns:
    shape times number of onsets plus the number of the onset. ``sizes`` (2, n_pair) [%] are both changes at the newest
    value. ``variance`` is that of their sum, over the variance of the scatter; ``rss`` the residual sum of squares.
    """

    probability: np.ndarray
    first: np.ndarray
    second: np.ndarray
    sizes: np.ndarray
    variance: np.ndarray
    rss: np.ndarray


class _Design:
    """Whitened values and changes of every onset and shape, less what level and temperature slope explain."""

    def __init__(
        self,
        years: np.ndarray,
        values: np.ndarray,
        autocorrelation: float,
        onset: np.ndarray,
        temperature: np.ndarray | None,
        slope_weight: float,
    ) -> None:
        step = (years[:, None] >= onset).astype(float)
        changes = np.hstack([step, step * (years[:, None] - onset) / -onset])
        nuisances = [np.ones(years.size)]
        if temperature is not None:
            nuisances.append(temperature - temperature.mean())
        columns = np.column_stack([*nuisances, changes])
        columns, y = whiten(columns, values, years, autocorrelation)
        if temperature is not None and slope_weight > 0.0:  # the prior of the slope, as one more value
            row = np.zeros(columns.shape[1])
            row[1] = np.sqrt(slope_weight)
            columns, y = np.vstack([columns, row]), np.append(y, 0.0)
        basis, _ = np.linalg.qr(columns[:, : len(nuisances)])
        changes = columns[:, len(nuisances) :]
        self.changes = changes - basis @ (basis.T @ changes)
        self.square = np.sum(self.changes**2, axis=0)
        residual = y - basis @ (basis.T @ y)
        self.moment = self.changes.T @ residual
        self.rss = float(residual @ residual)

    def pair_rss(self, i: np.ndarray, j: np.ndarray, product: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual sums of squares of pairs of columns, infinite where they are equal, and their determinants."""
        determinant = self.square[i] * self.square[j] - product**2
        independent = determinant > 1e-9 * self.square[i] * self.square[j]
        determinant = np.where(independent, determinant, 1.0)
        explained = self.moment[i] ** 2 * self.square[j] + self.moment[j] ** 2 * self.square[i]
        explained = (explained - 2.0 * self.moment[i] * self.moment[j] * product) / determinant
        rss = np.maximum(self.rss - explained, 1e-12 * max(self.rss, 1e-300))
        return np.where(independent, rss, np.inf), determinant


def find_pairs(
    time: np.ndarray,
    values: np.ndarray,
    autocorrelation: float,
    fits: dict[str, Fits],
    freedom: int,
    temperature: np.ndarray | None = None,
    slope_weight: float = 0.0,
) -> Pairs | None:
    r"""Every pair of changes, with its posterior probability against one change.

    .. math:: y_i = l + b\,T_i + c_1 x_{1i} + c_2 x_{2i}

    with a step or a drift for each, as in ``fit_onsets``. One and two changes are equally probable before the values
    are seen, and so are all onsets within their duration D. The second size has the unit information prior, which gives

    .. math:: p_{12} \propto \frac{\Delta\tau_1 \Delta\tau_2}{2 D^2}\, n^{-1/2} w_{\tau_1}^{-1/2} RSS_{12}^{-\nu/2},
              \qquad p_1 \propto \frac{\Delta\tau_1}{2 D}\, w_{\tau_1}^{-1/2} RSS_1^{-\nu/2}

    Parameters
    ----------
    time, values : (n,) arrays of float
        Ascending [d], [%].
    autocorrelation : float
        AR(1) coefficient at the usual spacing.
    fits : dict
        Result of ``fit_onsets`` with the same values: the onsets that are paired.
    freedom : int
        nu, the degrees of freedom of one change.
    temperature : (n,) array of float, optional
        [°C]; without it b = 0.
    slope_weight : float
        Weight of the temperature slope, see ``fit_onsets``.

    Returns
    -------
    Pairs or None
        None with fewer than ``MIN_VALUES`` values, and where two changes are less probable than ``MIN_PROBABILITY``.

    References
    ----------
    Kass and Wasserman, A reference Bayesian test for nested hypotheses and its relationship to the Schwarz criterion,
    J. American Stat. Ass. 90, 1995, for the unit information prior.
    """
    if time.size < MIN_VALUES:
        return None
    step, drift = fits["step"], fits["drift"]
    years = (time - time[-1]) / DAYS_PER_YEAR
    design = _Design(years, values, autocorrelation, step.onset, temperature, slope_weight)
    width = np.tile(step.width, 2)
    onset, number = np.tile(step.onset, 2), np.tile(np.arange(step.onset.size), 2)
    duration = step.width.sum()
    weight, rss = np.append(step.weight, drift.weight), np.append(step.rss, drift.rss)
    log_one = np.log(width / (2.0 * duration)) - 0.5 * np.log(weight) - 0.5 * freedom * np.log(rss)
    evidence_one = np.logaddexp.reduce(log_one)
    information = 0.5 * np.log(time.size)

    def log_pairs(i: np.ndarray, j: np.ndarray, product: np.ndarray) -> np.ndarray:
        first = np.where(onset[i] < onset[j], i, j)
        prior = np.log(width[i] * width[j] / (2.0 * duration**2)) - 0.5 * np.log(weight[first]) - information
        with np.errstate(divide="ignore"):
            log_p = prior - 0.5 * freedom * np.log(design.pair_rss(i, j, product)[0])
        return np.where(np.abs(number[i] - number[j]) < MIN_DISTANCE, -np.inf, log_p)

    # The best pair by turns, from the best single change on: the sum over its row bounds what the whole sum can be.
    columns, likeliest = np.arange(onset.size), int(np.argmax(log_one))
    evidence_row = -np.inf
    for _ in range(4):
        row = log_pairs(np.full(onset.size, likeliest), columns, design.changes.T @ design.changes[:, likeliest])
        evidence_row = max(evidence_row, float(np.logaddexp.reduce(row)))
        likeliest = int(np.argmax(row))
    if evidence_row - evidence_one < np.log(MIN_PROBABILITY):
        return None
    n_onset = step.onset.size
    earlier, later = np.triu_indices(n_onset, MIN_DISTANCE)
    first = np.concatenate([earlier + a * n_onset for a in (0, 1) for _ in (0, 1)])
    second = np.concatenate([later + b * n_onset for _ in (0, 1) for b in (0, 1)])
    product = (design.changes.T @ design.changes)[first, second]
    log_p = log_pairs(first, second, product)
    evidence = np.logaddexp(evidence_one, np.logaddexp.reduce(log_p))
    p = np.exp(log_p - evidence)
    use = p > LEFT_OUT * p.max()
    i, j, product = first[use], second[use], product[use]
    rss, determinant = design.pair_rss(i, j, product)
    moment, square = design.moment, design.square
    sizes = np.array([square[j] * moment[i] - product * moment[j], square[i] * moment[j] - product * moment[i]])
    variance = (square[i] + square[j] - 2.0 * product) / determinant
    return Pairs(p[use] * p.sum() / p[use].sum(), i, j, sizes / determinant, variance, rss)
