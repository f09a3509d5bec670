"""Score of a model on conditions that were left out, with what belongs to them alone integrated out."""

import numpy as np

from turnout.mismatch.joint import Joint

FEWEST = 3  # recordings of which two may disagree with the third


def held_out_score(case, fit):
    r"""Log predictive density [nats] of each left-out condition, dict condition -> density.

    .. math:: \ln p(y_c \mid y_{-c}) = \ln N(r_c;\; J_c(\hat\theta_{-c} - \hat\theta),\;
              S + J_c C_{-c} J_c^T)

    The fit without condition c follows from the full fit by one Gauss-Newton step; nuisances that belong to the
    left-out condition go back to their prior and are integrated out, not fitted. S holds sigma times the noise
    scale that the other conditions gave; correlated samples count by their ``effective`` share.
    """
    joint, theta, parts = _taken_apart(case, fit)
    conditions = [o.condition for o in joint.observations]
    found = {}
    for condition in dict.fromkeys(conditions):
        out = [p for p, c in zip(parts, conditions) if c == condition]
        kept = [p for p, c in zip(parts, conditions) if c != condition]
        if kept:
            found[condition] = _density(joint, fit, theta, out, kept)
    return found


def disagreement(case, fit, kind):
    r"""Standard errors of all parameters of ``fit`` by what its recordings of a ``kind`` say without one another.

    Jackknife (Efron and Stein 1981) over these m recordings, with one Gauss-Newton step for each:
    :math:`\sqrt{(m - 1) / m \sum (\theta_i - \bar\theta)^2}`. An error that is each recording's own, but no noise,
    as of a vehicle's file or a coarse step, is in it. Zeros where there are fewer than three.
    """
    joint, theta, parts = _taken_apart(case, fit)
    normal = np.eye(theta.size) + sum(p.gram / fit.scale[p.kind] for p in parts)
    right = (joint.mean - theta) / joint.sd + sum(p.across / fit.scale[p.kind] for p in parts)
    out = [p for p in parts if p.kind == kind]
    if len(out) < FEWEST:
        return np.zeros(theta.size)
    scale = fit.scale[kind]
    moved = np.array([np.linalg.solve(normal - p.gram / scale, right - p.across / scale) for p in out])
    return joint.sd * np.sqrt((len(out) - 1) * np.var(moved, axis=0))


def told_alone(case, fit, kind, name, sd):
    """What the observations of a ``kind`` say alone of the nuisance ``name``, whose prior is opened to ``sd``: its
    value one Gauss-Newton step from ``fit``, all other nuisances free under their priors."""
    joint = Joint(case)
    theta = np.array([fit.values[n.name] for n in case.nuisances])
    k, n = [n.name for n in case.nuisances].index(name), theta.size
    opened = np.ones(n)
    opened[k] = (joint.sd[k] / sd) ** 2
    normal, right = np.diag(opened), opened * (joint.mean - theta) / joint.sd
    for o, jacobian, white in zip(case.observations, fit.jacobian, fit.white):
        if o.kind == kind:
            part = _Part(joint, o, jacobian[:, :n], white)
            normal, right = normal + part.gram / fit.scale[kind], right + part.across / fit.scale[kind]
    return float(theta[k] + joint.sd[k] * np.linalg.solve(normal, right)[k])


def _taken_apart(case, fit):
    """The joint problem, its parameters in ``fit``, and the sums over each observation."""
    joint = Joint(case, fit.candidates)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    return joint, theta, [_Part(joint, o, j, r) for o, j, r in zip(joint.observations, fit.jacobian, fit.white)]


class _Part:
    """Sums over one observation, at noise scale 1, distances in prior standard deviations."""

    def __init__(self, joint, observation, jacobian, white):
        rows = np.sqrt(observation.effective) * jacobian * joint.sd
        right = np.sqrt(observation.effective) * white
        self.kind, self.n = observation.kind, observation.n_effective
        self.gram, self.across, self.square = rows.T @ rows, rows.T @ right, float(right @ right)
        self.log_sigma = observation.effective * float(np.sum(np.log(observation.sigma)))


def _scales(fit, kept):
    """Noise scale by kind from the kept observations; a kind that is wholly left out keeps that of the full fit."""
    total, count = {}, {}
    for p in kept:
        total[p.kind] = total.get(p.kind, 0.0) + p.square
        count[p.kind] = count.get(p.kind, 0.0) + p.n
    return {**fit.scale, **{kind: max(1.0, total[kind] / count[kind]) for kind in total}}


def _density(joint, fit, theta, out, kept):
    scale = _scales(fit, kept)
    gram, across = (sum(getattr(p, what) / scale[p.kind] for p in kept) for what in ("gram", "across"))
    normal = gram + np.eye(theta.size)
    shift = np.linalg.solve(normal, across + (joint.mean - theta) / joint.sd)
    gram, across = (sum(getattr(p, what) / scale[p.kind] for p in out) for what in ("gram", "across"))
    square = sum(p.square / scale[p.kind] for p in out)
    n = sum(p.n for p in out)
    log_sigma = sum(p.log_sigma + 0.5 * p.n * np.log(scale[p.kind]) for p in out)
    # missed = right - rows shift; Woodbury on the p by p side: N(missed; 0, 1 + rows normal^-1 rows')
    missed = square - 2.0 * shift @ across + shift @ gram @ shift
    projected = across - gram @ shift
    inner = normal + gram
    quadratic = missed - projected @ np.linalg.solve(inner, projected)
    log_ratio = np.linalg.slogdet(inner)[1] - np.linalg.slogdet(normal)[1]
    return float(-0.5 * (quadratic + log_ratio + n * np.log(2.0 * np.pi)) - log_sigma)


def mean_square_out(observations, predictions):
    """Mean square of ``observations`` minus ``predictions``, whitened."""
    total = sum(o.effective * float(np.sum(o.whitened(o.data - p) ** 2)) for o, p in zip(observations, predictions))
    return total / sum(o.n_effective for o in observations)
