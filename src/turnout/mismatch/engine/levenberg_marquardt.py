"""Steps of the joint fit: damped more and more until the cost falls (Marquardt 1963), within a trust region, and what
they teach its Jacobian."""

import numpy as np

TRIES = 8  # of one step, each more damped than the last
MORE, LESS = 6.0, 0.2  # factors on the damping after a step that failed, and after one that was taken
HELD = 1e12  # of the diagonal: this one does not move
SETTLED = 0.1  # of what is enough to go on; a step that promises less is not tried
FIRST, LEAST = 1e-2, 1e-4  # of the diagonal: the first damping, and one that is as good as none


class Steps:
    """Damped steps from ``theta``; the noise scale is the one that the undamped step will leave, else a bad start would
    trust its priors."""

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
        """(n,) step with ``damping`` times the diagonal added to it; what would leave its trust region is damped alone,
        what is at its bound and would go beyond stays there, and the others move on."""
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
        """By how much the cost would fall if everything were straight."""
        step = step / self.joint.sd
        return float(2.0 * step @ self.right - step @ self.normal @ step)

    def taken(self, cost, damping):
        """((theta, predictions, residuals, cost), damping for the next) of the first step that costs less, damped ever
        more; (None, 0) where none does, or none promises a tenth of what is enough to go on."""
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
    """Rank-one update that makes the Jacobian say what the last step did to the residuals, in prior deviations."""
    size = float(weight @ moved)
    change = [
        np.outer((a - b - j @ moved).astype(j.dtype), (weight / size).astype(j.dtype))
        for j, a, b in zip(jacobian, old, new)
    ]
    return [j + c for j, c in zip(jacobian, change)]
