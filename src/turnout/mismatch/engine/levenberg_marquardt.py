"""Damped Gauss-Newton steps of the joint fit (Marquardt 1963) within a trust region, and Broyden's update.

The damping rises until the cost falls.
"""

import numpy as np

TRIES = 8  # trials of one step, each with more damping than the last
MORE, LESS = 6.0, 0.2  # factors on the damping after a failed and after an accepted step
HELD = 1e12  # times the diagonal: the parameter does not move
SETTLED = 0.1  # share of the least decrease for which the fit goes on; steps that predict less are not tried
FIRST, LEAST = 1e-2, 1e-4  # times the diagonal: the first damping, and the one below which it is set to 0


class Steps:
    """Damped steps from ``theta``.

    The noise scale is that after the undamped step. With the scale of a bad start, the priors would weigh too much.
    """

    def __init__(self, joint, theta, residuals, jacobian):
        self.joint, self.theta, parts = joint, theta, {}
        for o, j, r in zip(joint.observations, jacobian, residuals):
            weight = np.sqrt(o.effective)
            rows, right = weight * j * joint.sd, weight * r
            old = parts.get(o.kind, (0.0, 0.0, 0.0, 0.0))
            new = rows.T @ rows, rows.T @ right, float(right @ right), o.n_effective
            parts[o.kind] = tuple(a + b for a, b in zip(old, new))
        pull = (joint.mean - theta) / joint.sd
        left = {kind: p[2] for kind, p in parts.items()}
        for _ in range(5):
            scale = {kind: max(1.0, left[kind] / parts[kind][3]) for kind in parts}
            self.normal = np.eye(theta.size) + sum(p[0] / scale[k] for k, p in parts.items())
            self.right = pull + sum(p[1] / scale[k] for k, p in parts.items())
            step = np.linalg.solve(self.normal, self.right)
            left = {k: max(0.0, p[2] - 2.0 * step @ p[1] + step @ p[0] @ step) for k, p in parts.items()}

    def damped(self, damping):
        """(n,) step with ``damping`` times the diagonal added.

        A parameter that would leave its trust region gets more damping. One at its bound that would go beyond stays
        there, while the others move.
        """
        joint, diagonal = self.joint, np.diag(self.normal)
        reach, more = joint.reach / joint.sd, np.full(self.theta.size, damping)
        lowest, highest = self.theta <= joint.low, self.theta >= joint.high
        for _ in range(12):
            step = np.linalg.solve(self.normal + np.diag(diagonal * more), self.right)
            held = ((lowest & (step < 0.0)) | (highest & (step > 0.0))) & (more < HELD)
            excess = np.maximum(np.abs(step) / reach - 1.0, 0.0)
            if excess.max(initial=0.0) < 0.05 and not held.any():
                break
            more = np.where(held, HELD, more + (1.0 + more) * excess)
        return joint.sd * np.clip(step, -reach, reach)

    def promised(self, step):
        """Decrease of the cost if the problem were linear."""
        step = step / self.joint.sd
        return float(2.0 * step @ self.right - step @ self.normal @ step)

    def taken(self, cost, damping):
        """((theta, predictions, residuals, cost), next damping) of the first step that costs less, with rising damping.

        (None, 0) if there is none, or if none predicts a tenth of the least decrease for which the fit goes on.
        """
        joint = self.joint
        for _ in range(TRIES):
            step = self.damped(damping)
            if self.promised(step) < SETTLED * joint.enough:
                break
            tried = np.clip(self.theta + step, joint.low, joint.high)
            new = joint.tried(tried)
            if new is not None:
                residuals = joint.residuals(new)
                new_cost = joint.cost(tried, residuals)
                if new_cost < cost:
                    return (tried, new, residuals, new_cost), damping * LESS if damping > LEAST else 0.0
            damping = max(MORE * damping, FIRST)
        return None, 0.0


def broyden(jacobian, weight, moved, old, new):
    """Rank-one update by which the Jacobian agrees with the last ``step``, in prior standard deviations."""
    size = float(weight @ moved)
    change = [
        np.outer((a - b - j @ moved).astype(j.dtype), (weight / size).astype(j.dtype))
        for j, a, b in zip(jacobian, old, new)
    ]
    return [j + c for j, c in zip(jacobian, change)]
