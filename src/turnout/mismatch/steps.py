"""Steps of the joint fit: damped within a trust region, cut until the cost falls, and what they teach its Jacobian."""

import numpy as np


def damped_step(joint, theta, residuals, jacobian):
    """Damped step; the noise scale is the one the step itself will leave, else a bad start would trust its priors."""
    parts = {}
    for o, j, r in zip(joint.observations, jacobian, residuals):
        weight = np.sqrt(o.effective)
        rows, right = weight * j * joint.sd, weight * r
        old = parts.get(o.kind, (0.0, 0.0, 0.0, 0.0))
        new = rows.T @ rows, rows.T @ right, float(right @ right), o.n_effective
        parts[o.kind] = tuple(a + b for a, b in zip(old, new))
    pull = (joint.mean - theta) / joint.sd
    step, left = np.zeros(theta.size), {kind: p[2] for kind, p in parts.items()}
    for _ in range(5):
        scale = {kind: max(1.0, left[kind] / parts[kind][3]) for kind in parts}
        normal = np.eye(theta.size) + sum(p[0] / scale[k] for k, p in parts.items())
        step = np.linalg.solve(normal, pull + sum(p[1] / scale[k] for k, p in parts.items()))
        left = {k: max(0.0, p[2] - 2.0 * step @ p[1] + step @ p[0] @ step) for k, p in parts.items()}
    right = pull + sum(p[1] / scale[k] for k, p in parts.items())
    reach, damping = joint.reach / joint.sd, np.zeros(theta.size)
    for _ in range(12):  # damp those alone that would leave their trust region: the others move on
        excess = np.maximum(np.abs(step) / reach - 1.0, 0.0)
        if excess.max(initial=0.0) < 0.05:
            break
        damping += (np.diag(normal) + damping) * excess
        step = np.linalg.solve(normal + np.diag(damping), right)
    return joint.sd * np.clip(step, -reach, reach)


def shortened(joint, theta, step, cost):
    """The step, halved until the cost falls; None where it does not."""
    for halving in range(5):
        tried = np.clip(theta + step * 0.5**halving, joint.low, joint.high)
        new = joint.tried(tried)
        if new is None:
            continue
        residuals = joint.residuals(new)
        new_cost = joint.cost(tried, residuals)
        if new_cost < cost:
            return tried, new, residuals, new_cost
    return None


def broyden(jacobian, weight, moved, old, new):
    """Rank-one update that makes the Jacobian say what the last step did to the residuals, in prior deviations."""
    size = float(weight @ moved)
    change = [
        np.outer((a - b - j @ moved).astype(j.dtype), (weight / size).astype(j.dtype))
        for j, a, b in zip(jacobian, old, new)
    ]
    return [j + c for j, c in zip(jacobian, change)]
