"""Score of a column: its gain against the residual of a fit with the nuisances projected out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.observation import Whitened
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit


class Projector:
    """Scores columns against the residual of ``fit`` with its nuisances projected out."""

    def __init__(self, case: Case, fit: Fit) -> None:
        self.joint, self.fit = JointProblem(case, fit.candidates), fit
        self.scaled, self.right = self.joint.stack(fit.jacobian, fit.white, fit.scale)
        self.scaled *= self.joint.sd
        self.normal = np.linalg.inv(self.scaled.T @ self.scaled + np.eye(self.scaled.shape[1]))
        theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
        self.pull = (self.joint.mean - theta) / self.joint.sd
        self.shift = self.normal @ (self.scaled.T @ self.right + self.pull)

    def score(self, changes: Sequence[np.ndarray] | None, candidate: Candidate, start: int) -> tuple[float, float]:
        r"""Best gain along a column, and how much of it, within the bounds.

        .. math:: g = \max_a\, 2a\,c^T P r - a^2 c^T P c, \quad P = I - J (J^T J + I)^{-1} J^T

        with the distance of the nuisances from their priors included. A column that nuisances imitate scores low.

        Parameters
        ----------
        changes : sequence of (n,) array of float or None
            Change of each observation at the start; None if it cannot be simulated.
        candidate : Candidate
        start : int
            Number of the start.

        Returns
        -------
        gain : float
            In chi-squared.
        share : float
            Multiple of the start's distance from neutral.
        """
        return self.scores([changes], [candidate], [start])[0]

    def scores(
        self,
        changes: Sequence[Sequence[np.ndarray] | None],
        candidates: Sequence[Candidate],
        starts: Sequence[int],
    ) -> list[tuple[float, float]]:
        """``score`` of several columns, which are whitened and projected together.

        Parameters
        ----------
        changes : sequence of list of (n,) array of float, or None
            Change of each observation at each start; None if it cannot be simulated.
        candidates : sequence of Candidate
        starts : sequence of int
            Number of the start of each candidate.

        Returns
        -------
        list of (gain, share)
        """
        gains_and_shares = []
        for first in range(0, len(changes), THRESHOLDS.n_columns_together):
            together = slice(first, first + THRESHOLDS.n_columns_together)
            columns = self._weighted_columns(changes[together])
            across = self.scaled.T @ columns
            squares = np.sum(columns**2, axis=0)
            sizes = squares - np.sum(across * (self.normal @ across), axis=0)
            slopes = self.right @ columns - self.shift @ across
            numbers = zip(squares, sizes, slopes, candidates[together], starts[together])
            gains_and_shares += [_best_gain(square, size, slope, c, k) for square, size, slope, c, k in numbers]
        return gains_and_shares

    def _weighted_columns(self, changes: Sequence[Sequence[np.ndarray] | None]) -> np.ndarray:
        """(n, n_change) changes of all observations, whitened and weighted; 0 for those that are None."""
        blocks = []
        for i, o in enumerate(self.joint.observations):
            block = np.zeros((o.data.size, len(changes)))
            shown = {k: c[i] for k, c in enumerate(changes) if c is not None and c[i].any()}
            not_white = [k for k, change in shown.items() if not isinstance(change, Whitened)]
            if not_white:
                block[:, not_white] = o.whiten(np.column_stack([shown[k] for k in not_white]))
            for k in set(shown) - set(not_white):
                block[:, k] = shown[k]
            blocks.append(np.sqrt(o.effective / self.fit.scale[o.data_type]) * block)
        return np.concatenate(blocks)


def _best_gain(square: float, size: float, slope: float, candidate: Candidate, start: int) -> tuple[float, float]:
    """``Projector.score`` from the square of a column, without and with nuisances projected out, and its slope."""
    if size <= 1e-12 * square or size <= 0.0:
        return 0.0, 1.0
    optimum = slope / size if not candidate.refit.nonlinear_in_size else 1.0
    most = _max_multiple(candidate, candidate.starts[start])
    share = float(np.clip(optimum, THRESHOLDS.min_start_multiple, most))
    return float(2.0 * share * slope - share**2 * size), share


def _max_multiple(candidate: Candidate, start: Sequence[float]) -> float:
    """Largest multiple of the distance from neutral to ``start`` within the bounds and the range of a column."""
    multiple = THRESHOLDS.max_start_multiple
    for p, s in list(zip(candidate.parameters, start))[:1]:
        distance = s - p.neutral
        if distance:
            limit = p.bounds[1] if distance > 0 else p.bounds[0]
            multiple = min(multiple, abs(limit - p.neutral) / abs(distance))
    return max(multiple, THRESHOLDS.min_start_multiple)
