"""Damped Gauss-Newton steps of the joint fit (Marquardt 1963) within a trust region, and Broyden's update.

The damping rises until the cost falls.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.joint_problem import JointProblem


class FitPoint(NamedTuple):
    """Parameters ``theta`` (n,) of a joint fit, with the predictions, whitened residuals and cost there."""

    theta: np.ndarray
    predictions: list[np.ndarray]
    residuals: list[np.ndarray]
    cost: float


class DampedSteps:
    """Damped steps from ``theta``.

    The noise scale is that after the undamped step. With the scale of a bad start, the priors would weigh too much.

    ``promise`` is the decrease of the cost by that step if the problem were linear.
    """

    def __init__(
        self, joint: JointProblem, theta: np.ndarray, residuals: Sequence[np.ndarray], jacobian: Sequence[np.ndarray]
    ) -> None:
        self.joint, self.theta = joint, theta
        sums: dict[str, tuple[Any, ...]] = {}
        for o, j, r in zip(joint.observations, jacobian, residuals):
            weight = np.sqrt(o.effective)
            rows, right = j * (weight * joint.sd), weight * r
            old = sums.get(o.data_type, (0.0, 0.0, 0.0, 0.0))
            new = rows.T @ rows, rows.T @ right, float(right @ right), o.n_effective
            sums[o.data_type] = tuple(a + b for a, b in zip(old, new))
        self.sums, self.pull = sums, (joint.mean - theta) / joint.sd
        squares = {data_type: p[2] for data_type, p in sums.items()}
        scale: dict[str, float] = {}
        for _ in range(THRESHOLDS.n_scale_iterations):
            before, scale = scale, {k: max(1.0, squares[k] / p[3]) for k, p in sums.items()}
            if scale == before:  # 1, where the residuals are within their errors
                break
            self.normal = np.eye(theta.size) + sum(p[0] / scale[k] for k, p in sums.items())
            self.right = self.pull + sum(p[1] / scale[k] for k, p in sums.items())
            step = np.linalg.solve(self.normal, self.right)
            squares = {k: max(0.0, p[2] - 2.0 * step @ p[1] + step @ p[0] @ step) for k, p in sums.items()}
        self.promise = float(step @ self.right)

    def damped_step(self, damping: float) -> np.ndarray:
        """Step with a damping added to the diagonal of the normal matrix.

        A parameter that would leave its trust region gets more damping. One at its bound that would go beyond stays
        there, while the others move.

        Parameters
        ----------
        damping : float
            Times the diagonal.

        Returns
        -------
        (n,) array of float
            In the units of the parameters.
        """
        joint, diagonal = self.joint, np.diag(self.normal)
        reach, damping_factors = joint.reach / joint.sd, np.full(self.theta.size, damping)
        lowest, highest = self.theta <= joint.low, self.theta >= joint.high
        for _ in range(THRESHOLDS.n_reach_iterations):
            step = np.linalg.solve(self.normal + np.diag(diagonal * damping_factors), self.right)
            is_held = ((lowest & (step < 0.0)) | (highest & (step > 0.0))) & (damping_factors < THRESHOLDS.hold_damping)
            excess = np.maximum(np.abs(step) / reach - 1.0, 0.0)
            if excess.max(initial=0.0) < THRESHOLDS.max_overreach and not is_held.any():
                break
            damping_factors = np.where(
                is_held, THRESHOLDS.hold_damping, damping_factors + (1.0 + damping_factors) * excess
            )
        return joint.sd * np.clip(step, -reach, reach)

    def predicted_decrease(self, step: np.ndarray) -> float:
        """Decrease of the cost if the problem were linear.

        Parameters
        ----------
        step : (n,) array of float
            In the units of the parameters.

        Returns
        -------
        float
        """
        step = step / self.joint.sd
        return float(2.0 * step @ self.right - step @ self.normal @ step)

    def linear_decrease(self, step: np.ndarray) -> float:
        """Decrease of the cost, with the noise scales at their best values, if the residuals were linear.

        ``predicted_decrease`` has fixed scales; far from the optimum it promises much more.

        Parameters
        ----------
        step : (n,) array of float
            In the units of the parameters.

        Returns
        -------
        float
        """
        step = step / self.joint.sd
        value = float(self.pull @ self.pull - np.sum((self.pull - step) ** 2))
        for normal, slope, square, n in self.sums.values():
            after = max(0.0, square - 2.0 * step @ slope + step @ normal @ step)
            value += n * (_cost_per_sample(square / n) - _cost_per_sample(after / n))
        return value

    def first_improvement(
        self, cost: float, damping: float, max_tries: int | None = None
    ) -> tuple[FitPoint | None, float]:
        """First step that costs less, with rising damping.

        Along a failed step a parabola falls by at most half of what the linear model promises, so after a failed
        trial that promised less than the least decrease the others are not tried either.

        Parameters
        ----------
        cost : float
            Cost before the step.
        damping : float
            Times the diagonal, of the first trial.
        max_tries : int or None
            Largest number of trials; None: that of the settings.

        Returns
        -------
        improvement : FitPoint or None
            None if no step costs less, or if none promises enough.
        damping : float
            For the next step; 0 without an improvement.
        """
        joint = self.joint
        for _ in range(max_tries or THRESHOLDS.max_damping_tries):
            step = self.damped_step(damping)
            promise = self.predicted_decrease(step)
            if promise < THRESHOLDS.min_decrease_share * joint.min_decrease:
                break
            trial = np.clip(self.theta + step, joint.low, joint.high)
            predictions = joint.predict_or_none(trial)
            if predictions is not None:
                residuals = joint.residuals(predictions)
                new_cost = joint.cost(trial, residuals)
                if new_cost < cost:
                    next_damping = self._next_damping(damping, (cost - new_cost) / self.linear_decrease(step))
                    return FitPoint(trial, predictions, residuals, new_cost), next_damping
                if promise < joint.min_decrease:
                    break
            damping = max(THRESHOLDS.damping_increase * damping, THRESHOLDS.first_damping)
        return None, 0.0

    def _next_damping(self, damping: float, kept_share: float) -> float:
        """Damping after a step that kept this share of its promise: less, or more after a poor one in a small case.

        A large case has old derivatives, which new ones improve more than smaller steps.
        """
        if kept_share < THRESHOLDS.min_kept_promise and not self.joint.case.is_large:
            return max(THRESHOLDS.damping_increase * damping, THRESHOLDS.first_damping)
        return damping * THRESHOLDS.damping_decrease if damping > THRESHOLDS.min_damping else 0.0


def _cost_per_sample(mean_square: float) -> float:
    """Cost per sample with the noise scale at its best value, as in ``JointProblem.cost``."""
    scale = max(1.0, mean_square)
    return float(np.log(scale) + mean_square / scale)


def broyden_update(
    jacobian: Sequence[np.ndarray],
    weight: np.ndarray,
    step: np.ndarray,
    before: Sequence[np.ndarray],
    after: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """Rank-one update by which the Jacobian agrees with the last step, in prior standard deviations.

    Parameters
    ----------
    jacobian : sequence of (n, p) array of float
        By observation.
    weight : (p,) array of float
        The step over the prior variances.
    step : (p,) array of float
    before, after : sequence of (n,) array of float
        Residuals before and after the step, by observation.

    Returns
    -------
    list of (n, p) array of float
    """
    size = float(weight @ step)
    change = [
        np.outer((a - b - j @ step).astype(j.dtype), (weight / size).astype(j.dtype))
        for j, a, b in zip(jacobian, before, after)
    ]
    return [j + c for j, c in zip(jacobian, change)]
