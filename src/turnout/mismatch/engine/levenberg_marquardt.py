"""Damped Gauss-Newton steps of the joint fit (Marquardt 1963) within a trust region, and Broyden's update.

The damping rises until the cost falls.
"""

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS


class DampedSteps:
    """Damped steps from ``theta``.

    The noise scale is that after the undamped step. With the scale of a bad start, the priors would weigh too much.
    """

    def __init__(self, joint, theta, residuals, jacobian):
        self.joint, self.theta, sums = joint, theta, {}
        for o, j, r in zip(joint.observations, jacobian, residuals):
            weight = np.sqrt(o.effective)
            rows, right = weight * j * joint.sd, weight * r
            old = sums.get(o.data_type, (0.0, 0.0, 0.0, 0.0))
            new = rows.T @ rows, rows.T @ right, float(right @ right), o.n_effective
            sums[o.data_type] = tuple(a + b for a, b in zip(old, new))
        pull = (joint.mean - theta) / joint.sd
        squares = {data_type: p[2] for data_type, p in sums.items()}
        for _ in range(THRESHOLDS.n_scale_iterations):
            scale = {data_type: max(1.0, squares[data_type] / sums[data_type][3]) for data_type in sums}
            self.normal = np.eye(theta.size) + sum(p[0] / scale[k] for k, p in sums.items())
            self.right = pull + sum(p[1] / scale[k] for k, p in sums.items())
            step = np.linalg.solve(self.normal, self.right)
            squares = {k: max(0.0, p[2] - 2.0 * step @ p[1] + step @ p[0] @ step) for k, p in sums.items()}

    def damped_step(self, damping):
        """(n,) step with ``damping`` times the diagonal added.

        A parameter that would leave its trust region gets more damping. One at its bound that would go beyond stays
        there, while the others move.
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

    def predicted_decrease(self, step):
        """Decrease of the cost if the problem were linear."""
        step = step / self.joint.sd
        return float(2.0 * step @ self.right - step @ self.normal @ step)

    def first_improvement(self, cost, damping):
        """((theta, predictions, residuals, cost), next damping) of the first step that costs less, with rising damping.

        (None, 0) if there is none, or if none predicts a tenth of the least decrease for which the fit goes on.
        """
        joint = self.joint
        for _ in range(THRESHOLDS.max_damping_tries):
            step = self.damped_step(damping)
            if self.predicted_decrease(step) < THRESHOLDS.min_decrease_share * joint.min_decrease:
                break
            trial = np.clip(self.theta + step, joint.low, joint.high)
            predictions = joint.predict_or_none(trial)
            if predictions is not None:
                residuals = joint.residuals(predictions)
                new_cost = joint.cost(trial, residuals)
                if new_cost < cost:
                    return (
                        trial,
                        predictions,
                        residuals,
                        new_cost,
                    ), damping * THRESHOLDS.damping_decrease if damping > THRESHOLDS.min_damping else 0.0
            damping = max(THRESHOLDS.damping_increase * damping, THRESHOLDS.first_damping)
        return None, 0.0


def broyden_update(jacobian, weight, step, before, after):
    """Rank-one update by which the Jacobian agrees with the last ``step``, in prior standard deviations."""
    size = float(weight @ step)
    change = [
        np.outer((a - b - j @ step).astype(j.dtype), (weight / size).astype(j.dtype))
        for j, a, b in zip(jacobian, before, after)
    ]
    return [j + c for j, c in zip(jacobian, change)]
