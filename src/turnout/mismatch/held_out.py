"""Score of a model on conditions that were left out, with what belongs to them alone integrated out."""

import numpy as np

from turnout.mismatch.joint import Joint


def held_out_score(case, fit, observations=None):
    r"""Log predictive density [nats] of each left-out condition, dict condition -> density.

    .. math:: \ln p(y_c \mid y_{-c}) = \ln N(r_c;\; J_c(\hat\theta_{-c} - \hat\theta),\;
              S + J_c C_{-c} J_c^T)

    The fit without condition c follows from the full fit by one Gauss-Newton step; nuisances that belong to the
    left-out condition go back to their prior and are integrated out, not fitted. S holds sigma times the noise
    scale that the other conditions gave; correlated samples count by their ``effective`` share.
    """
    joint = Joint(case, fit.candidates, observations)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    conditions = [o.condition for o in joint.observations]
    found = {}
    for condition in dict.fromkeys(conditions):
        out = [i for i, c in enumerate(conditions) if c == condition]
        kept = [i for i, c in enumerate(conditions) if c != condition]
        if kept:
            found[condition] = _density(joint, fit, theta, out, kept)
    return found


def _scales(joint, fit, kept):
    """Noise scale by kind from the kept observations; a kind that is wholly left out keeps that of the full fit."""
    total, count = {}, {}
    for i in kept:
        o, r = joint.observations[i], fit.residuals[i]
        total[o.kind] = total.get(o.kind, 0.0) + o.effective * float(np.sum((r / o.sigma) ** 2))
        count[o.kind] = count.get(o.kind, 0.0) + o.n_effective
    return {**fit.scale, **{kind: max(1.0, total[kind] / count[kind]) for kind in total}}


def _weighted(joint, fit, indices, scale):
    rows, right, log_sigma, n = [], [], 0.0, 0.0
    for i in indices:
        o = joint.observations[i]
        weight = np.sqrt(o.effective / scale[o.kind]) / o.sigma
        rows.append(fit.jacobian[i] * weight[:, None])
        right.append(fit.residuals[i] * weight)
        log_sigma += o.effective * float(np.sum(np.log(o.sigma))) + 0.5 * o.n_effective * np.log(scale[o.kind])
        n += o.n_effective
    return np.concatenate(rows), np.concatenate(right), log_sigma, n


def _density(joint, fit, theta, out, kept):
    scale = _scales(joint, fit, kept)
    rows, right, _, _ = _weighted(joint, fit, kept, scale)
    scaled = rows * joint.sd
    normal = scaled.T @ scaled + np.eye(theta.size)
    shift = np.linalg.solve(normal, scaled.T @ right + (joint.mean - theta) / joint.sd)
    rows, right, log_sigma, n = _weighted(joint, fit, out, scale)
    there = rows * joint.sd
    missed = right - there @ shift
    # Woodbury on the p by p side: N(missed; 0, 1 + there normal^-1 there')
    inner = normal + there.T @ there
    projected = there.T @ missed
    quadratic = missed @ missed - projected @ np.linalg.solve(inner, projected)
    log_ratio = np.linalg.slogdet(inner)[1] - np.linalg.slogdet(normal)[1]
    return float(-0.5 * (quadratic + log_ratio + n * np.log(2.0 * np.pi)) - log_sigma)


def mean_square_out(case, fit, observations, predictions):
    """Mean square of ``observations`` minus ``predictions`` in units of sigma."""
    total = sum(o.effective * float(np.sum(((o.data - p) / o.sigma) ** 2)) for o, p in zip(observations, predictions))
    return total / sum(o.n_effective for o in observations)
