"""Scores on held-out conditions, single witnesses of a name, and the overlap of two effects.

A single witness is one recording, or all impacts at one position, without which a name has no support. The overlap is
the share of the change by one effect in sensors and recordings that another effect changes as well.
"""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import Joint

FEWEST = 3  # recordings; a jackknife over fewer has no meaning


def held_out_score(case, fit):
    r"""Log predictive density [nats] of each left-out condition, dict condition -> density.

    .. math:: \ln p(y_c \mid y_{-c}) = \ln N(r_c;\; J_c(\hat\theta_{-c} - \hat\theta),\;
              S + J_c C_{-c} J_c^T)

    The fit without condition c follows from the full fit by one Gauss-Newton step. Nuisances of the left-out condition
    return to their prior and are integrated out, not fitted. S holds sigma times the noise scale of the other
    conditions. Correlated samples count by their ``effective`` share.
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
    r"""Jackknife standard errors of all parameters of ``fit`` over its recordings of one ``data_type``.

    :math:`\sqrt{(m - 1) / m \sum (\theta_i - \bar\theta)^2}` (Efron and Stein 1981) over the m recordings, with one
    Gauss-Newton step for each. It includes errors of single recordings that are no noise, for example of a vehicle
    file or a coarse time step. Zeros for fewer than three recordings.
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
    """Estimate of the nuisance ``name`` from the observations of one ``data_type`` alone, with its prior widened to
    ``sd``.

    It is one Gauss-Newton step from ``fit``, with all other nuisances free under their priors.
    """
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
    """Sums over one observation, at noise scale 1, with distances in prior standard deviations."""

    def __init__(self, joint, observation, jacobian, white):
        rows = np.sqrt(observation.effective) * jacobian * joint.sd
        right = np.sqrt(observation.effective) * white
        self.kind, self.n = observation.kind, observation.n_effective
        self.gram, self.across, self.square = rows.T @ rows, rows.T @ right, float(right @ right)
        self.log_sigma = observation.effective * float(np.sum(np.log(observation.sigma)))


def _scales(fit, kept):
    """Noise scale by data type from the retained observations. A type wholly left out keeps that of the full fit."""
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
    # residual = right - rows shift; Woodbury on the p by p side: N(residual; 0, 1 + rows normal^-1 rows')
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


def changed(case, fit, candidate):
    """Change by ``candidate``, one of those in ``fit``, in each observation at its nuisances, whitened.

    [] if the simulation fails without it.
    """
    others = tuple(t for c, t in zip(fit.candidates, fit.terms) if c.key != candidate.key)
    try:
        without = case.predict(fit.values, others, case.observations)
    except SimulationError:
        return []
    return [o.whitened(p - q) for o, p, q in zip(case.observations, fit.predictions, without)]


def shared(case, fit, first, second):
    r"""Overlap of two effects in sensors and recordings: 0 if they show apart, 1 if alike.

    .. math:: \sum_k \sqrt{p_k q_k}

    with p and q the shares of energy of each change in sensor and recording k (Bhattacharyya 1943). 1 if the simulation
    fails without one of them.
    """
    parts = [_energies(case.observations, changed(case, fit, c)) for c in (first, second)]
    if any(p is None for p in parts):
        return 1.0
    return float(np.sum(np.sqrt(parts[0] * parts[1])))


def _energies(observations, changes):
    """(n_sensor_and_recording,) shares of the energy of ``changes``. None if it is zero."""
    found = [e for o, d in zip(observations, changes) for e in _by_sensor(o, o.effective * np.square(d))]
    total = float(np.sum(found))
    return np.array(found) / total if total > 0.0 else None


def _by_sensor(observation, energy):
    """Sums of ``energy`` (n,) by sensor. One sum if the observation has no sensor labels."""
    if observation.cells is None or "sensor" not in observation.labels:
        return [float(np.sum(energy))]
    level, code = np.unique(observation.labels["sensor"].astype(str), return_inverse=True)
    inside = observation.cells >= 0
    return np.bincount(code[observation.cells[inside]], energy[inside], minlength=level.size)


# A recording that must confirm an effect: share of the effect's energy in the main witness, and number of them.
AS_PLAIN, WITNESSES = 0.5, 2
# Share of the largest energy of an effect in a recording below which it does not show: a tenth in amplitude.
HIDDEN = 0.01
# Share of the evidence that held-out conditions must show. Less: most of it is the prior penalty of nuisances.
TOLD = 0.5
SPOTS = 3  # positions of impacts; of fewer none can be called the exception
# Levels in thresholds: the impacts at one position gain more, all other conditions together gain less.
SPOKEN = (1.0, 0.5)


def hangs_on(case, fit, candidate, gain, by_condition, settings):
    """The condition whose gain alone supports a name while the gain of all others together does not.

    "" if there is none.

    A real effect shows wherever it acts. A gain in one recording that others do not share belongs to that recording, if
    at least two others show the effect with half its energy. Two are needed, since nuisances may absorb the gain of
    one. Trains are exempt: speed and roughness differ at each passage.

    Impacts at one position are one witness, however often they are repeated. They share the fittings, the twist of the
    rail and the mark on it. No held-out condition shows the prior penalty that nuisances pay to imitate an effect. If
    that penalty is most of the ``gain``, and all other conditions support the name, no single position is the witness.

    Parameters
    ----------
    case, fit : Case, Fit
        The fit has ``candidate`` in it.
    candidate : Candidate
    gain : float
        Of all conditions together. [nats]
    by_condition : dict
        Condition -> gain when it is left out. [nats]
    settings : MismatchSettings
    """
    if spot := _one_spot(case.struck(), gain, by_condition, settings.threshold):
        return spot
    top = max(by_condition, key=by_condition.get, default="")
    if not top or by_condition[top] <= settings.threshold or "train" in candidate.where:
        return ""
    others = sum(by_condition.values()) - by_condition[top]
    if others >= settings.threshold:
        return ""
    shown = plainness(case, fit, candidate)
    least = AS_PLAIN * shown.pop(top, np.inf)
    return top if sum(energy >= least for energy in shown.values()) >= WITNESSES else ""


def _one_spot(struck, gain, by_condition, threshold):
    """Position, in words, whose impacts alone support a name, or half of one, while all others do not.

    "" if there is none.
    """
    gains = {}
    for condition, told in by_condition.items():
        if condition in struck:
            gains[struck[condition]] = gains.get(struck[condition], 0.0) + told
    if len(gains) < SPOTS:
        return ""
    top = max(gains, key=gains.get)
    others = sum(by_condition.values()) - gains[top]
    if others > 0.0 and gains[top] + others < TOLD * gain:
        return ""
    return f"all blows at {top:g} m" if any(gains[top] > s * threshold > others for s in SPOKEN) else ""


def plainness(case, fit, candidate):
    """Condition -> weighted energy of the change by ``candidate`` at the nuisances of ``fit``.

    {} if the simulation fails without it.
    """
    found = {}
    for o, change in zip(case.observations, changed(case, fit, candidate)):
        energy = o.effective * float(np.sum(change**2))
        found[o.condition] = found.get(o.condition, 0.0) + energy
    return found


def told_apart(case, fit, by_condition):
    """Gain of the conditions in which no effect of ``fit`` shows, 0 if it has none. [nats]"""
    quiet = dict(by_condition) if fit.candidates else {}
    for candidate in fit.candidates:
        shown = plainness(case, fit, candidate)
        most = max(shown.values(), default=np.inf)
        quiet = {c: gain for c, gain in quiet.items() if shown.get(c, most) < HIDDEN * most}
    return float(sum(quiet.values()))
