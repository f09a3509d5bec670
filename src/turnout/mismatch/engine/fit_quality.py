"""How well predictions fit observations, and whether one prediction is significantly better than another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.cross_validation import weighted_mean_square
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.observation import Observation


def fit_percent(observations: Sequence[Observation], predictions: Sequence[np.ndarray]) -> float:
    r"""Share of the recordings that is predicted, in units of sigma.

    .. math:: 100 (1 - \|y - \hat y\| / \|y - \bar y\|)

    Parameters
    ----------
    observations : sequence of Observation
    predictions : sequence of (n,) array of float

    Returns
    -------
    float
        [%]

    Examples
    --------
    >>> from turnout.mismatch.engine.observation import Observation
    >>> y = np.array([1.0, -1.0, 1.0, -1.0])
    >>> fit_percent([Observation("a", "a", y, 1.0)], [0.9 * y])
    90.0
    """
    missed = total = 0.0
    for o, p in zip(observations, predictions):
        mean = float(np.mean(o.data))
        missed += o.effective * float(np.sum(((o.data - p) / o.sigma) ** 2))
        total += o.effective * float(np.sum(((o.data - mean) / o.sigma) ** 2))
    return round(100.0 * (1.0 - float(np.sqrt(missed / total))), 4)


def gain_error(observations: Sequence[Observation], before: Sequence[np.ndarray], after: Sequence[np.ndarray]) -> float:
    r"""Standard error of ``fit_percent`` of ``after`` less that of ``before``.

    Jackknife over stretches of each observation, each in all of its rows: with the gain :math:`d_i` of all stretches
    but one, :math:`\sqrt{(m - 1) / m \sum (d_i - \bar d)^2}`. Both fits lack the same roughness, and so do all sensors
    under one train. The gain is therefore more certain than either fit.

    Parameters
    ----------
    observations : sequence of Observation
    before, after : sequence of (n,) array of float
        Two predictions of each.

    Returns
    -------
    float
        In points of fit.

    References
    ----------
    Efron and Stein 1981, The jackknife estimate of variance.
    """
    sums = np.array([_block_squares(o, b, a) for o, b, a in zip(observations, before, after)]).transpose(1, 0, 2)
    missed_before, missed_after, total = (np.sum(s) - s.ravel() for s in sums)
    gain = 100.0 * (np.sqrt(missed_before / total) - np.sqrt(missed_after / total))
    return float(np.sqrt((gain.size - 1) * np.var(gain)))


def _block_squares(o: Observation, before: np.ndarray, after: np.ndarray) -> list[list[float]]:
    """(3, n_blocks) weighted sums of squares of the residuals ``before`` and ``after``, and of the recording."""
    residuals = (o.data - before, o.data - after, o.data - np.mean(o.data))
    return [_block_sums(o, (p / o.sigma) ** 2) for p in residuals]


def _block_sums(o: Observation, squares: np.ndarray) -> list[float]:
    """(n_blocks,) sums of ``squares`` (n,) over stretches of the observation, each in all of its rows."""
    per_sample = squares.reshape(o.rows, -1).sum(axis=0)
    return [o.effective * float(np.sum(b)) for b in np.array_split(per_sample, THRESHOLDS.n_blocks)]


def is_significantly_worse(
    observations: Sequence[Observation], before: Sequence[np.ndarray], after: Sequence[np.ndarray], points: float
) -> bool:
    """Whether a prediction fits worse by more than some points of fit and two standard errors.

    The standard error is that of the difference of weighted squares over stretches of each observation, each in all of
    its rows. One in six names that say nothing about these observations reaches one standard error.

    Parameters
    ----------
    observations : sequence of Observation
    before, after : sequence of (n,) array of float
        Two predictions of each.
    points : float
        Loss of ``fit_percent`` that is allowed.

    Returns
    -------
    bool
    """
    losses = (((o.data - a) ** 2 - (o.data - b) ** 2) / o.sigma**2 for o, b, a in zip(observations, before, after))
    block_losses = [block_loss for o, d in zip(observations, losses) for block_loss in _block_sums(o, d)]
    error = np.std(block_losses, ddof=1) * np.sqrt(len(block_losses))
    return (
        sum(block_losses) > THRESHOLDS.loss_errors * error
        and fit_percent(observations, after) < fit_percent(observations, before) - points
    )


def lost_evidence(
    observations: Sequence[Observation], before: Sequence[np.ndarray], after: Sequence[np.ndarray]
) -> float:
    """Fall of the logarithm of the likelihood of observations from one prediction to another [nats].

    Parameters
    ----------
    observations : sequence of Observation
    before, after : sequence of (n,) array of float
        Two predictions of each.

    Returns
    -------
    float
        Below 0 where ``after`` is the better one.
    """
    n = sum(o.n_effective for o in observations)
    return 0.5 * n * (weighted_mean_square(observations, after) - weighted_mean_square(observations, before))
