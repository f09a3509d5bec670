"""Scores on held-out conditions, single witnesses of a name, and the overlap of two effects.

A single witness is one recording, or all impacts at one position, without which a name has no support. The overlap is
the share of the change by one effect in sensors and recordings that another effect changes as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.engine.search import Search


def held_out_score(case: Case, fit: Fit) -> dict[str, float]:
    r"""Log predictive density of each left-out condition.

    .. math:: \ln p(y_c \mid y_{-c}) = \ln N(r_c;\; J_c(\hat\theta_{-c} - \hat\theta),\;
              S + J_c C_{-c} J_c^T)

    The fit without condition c follows from the full fit by one Gauss-Newton step. Nuisances of the left-out condition
    return to their prior and are integrated out, not fitted. S holds sigma times the noise scale of the other
    conditions. Correlated samples count by their ``effective`` share.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    dict
        Condition -> log density [nats]. {} if there is one condition alone.
    """
    joint, theta, sums = _problem_and_sums(case, fit)
    conditions = [o.condition for o in joint.observations]
    densities = {}
    for condition in dict.fromkeys(conditions):
        left_out = [p for p, c in zip(sums, conditions) if c == condition]
        retained = [p for p, c in zip(sums, conditions) if c != condition]
        if retained:
            densities[condition] = _predictive_density(joint, fit, theta, left_out, retained)
    return densities


def jackknife_steps(case: Case, fit: Fit, data_type: str) -> np.ndarray:
    """Change of all parameters without one recording of a data type, by one Gauss-Newton step.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    data_type : str

    Returns
    -------
    (m, n) array of float
        Of the nuisances, then of the effects' parameters, for each of the m recordings; m = 0 for fewer than three.
    """
    joint, theta, sums = _problem_and_sums(case, fit)
    normal = np.eye(theta.size) + sum(p.gram / fit.scale[p.data_type] for p in sums)
    right = (joint.mean - theta) / joint.sd + sum(p.across / fit.scale[p.data_type] for p in sums)
    selected = [p for p in sums if p.data_type == data_type]
    if len(selected) < THRESHOLDS.min_recordings:
        return np.zeros((0, theta.size))
    scale = fit.scale[data_type]
    steps = [np.linalg.solve(normal - p.gram / scale, right - p.across / scale) for p in selected]
    return joint.sd * np.array(steps)


def jackknife_errors(steps: np.ndarray) -> np.ndarray:
    r"""Jackknife standard errors, :math:`\sqrt{(m - 1) / m \sum (\theta_i - \bar\theta)^2}` over m recordings.

    They include errors of single recordings that are no noise, for example of a vehicle file or a coarse time step.

    Parameters
    ----------
    steps : (m, n) array of float
        From ``jackknife_steps``, or values that follow from them.

    Returns
    -------
    (n,) array of float
        Zeros without a recording.

    References
    ----------
    Efron and Stein 1981, The jackknife estimate of variance.
    """
    return np.sqrt((len(steps) - 1) * np.var(steps, axis=0)) if len(steps) else np.zeros(steps.shape[1])


def single_type_estimate(case: Case, fit: Fit, data_type: str, name: str, sd: float) -> float:
    """Estimate of one nuisance from the observations of one data type alone, with its prior widened.

    It is one Gauss-Newton step from ``fit``, with all other nuisances free under their priors.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    data_type : str
    name : str
        The nuisance.
    sd : float
        Prior standard deviation that it gets.

    Returns
    -------
    float
    """
    joint = JointProblem(case)
    theta = np.array([fit.values[n.name] for n in case.nuisances])
    k, n = [n.name for n in case.nuisances].index(name), theta.size
    prior_weight = np.ones(n)
    prior_weight[k] = (joint.sd[k] / sd) ** 2
    normal, right = np.diag(prior_weight), prior_weight * (joint.mean - theta) / joint.sd
    for o, jacobian, white in zip(case.observations, fit.jacobian, fit.white):
        if o.data_type == data_type:
            sums = _ObservationSums(joint, o, jacobian[:, :n], white)
            normal, right = normal + sums.gram / fit.scale[data_type], right + sums.across / fit.scale[data_type]
    return float(theta[k] + joint.sd[k] * np.linalg.solve(normal, right)[k])


def _problem_and_sums(case: Case, fit: Fit) -> tuple[JointProblem, np.ndarray, list[_ObservationSums]]:
    """The joint problem, its parameters in ``fit``, and the sums over each observation."""
    joint = JointProblem(case, fit.candidates)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    return (
        joint,
        theta,
        [_ObservationSums(joint, o, j, r) for o, j, r in zip(joint.observations, fit.jacobian, fit.white)],
    )


class _ObservationSums:
    """Sums over one observation, at noise scale 1, with distances in prior standard deviations."""

    def __init__(self, joint: JointProblem, observation: Observation, jacobian: np.ndarray, white: np.ndarray) -> None:
        rows = np.sqrt(observation.effective) * jacobian * joint.sd
        right = np.sqrt(observation.effective) * white
        self.data_type, self.n = observation.data_type, observation.n_effective
        self.gram, self.across, self.square = rows.T @ rows, rows.T @ right, float(right @ right)
        self.log_sigma = observation.effective * float(np.sum(np.log(observation.sigma)))


def _noise_scales(fit: Fit, retained: Sequence[_ObservationSums]) -> dict[str, float]:
    """Noise scale by data type from the retained observations. A type wholly left out keeps that of the full fit."""
    total: dict[str, float] = {}
    count: dict[str, float] = {}
    for p in retained:
        total[p.data_type] = total.get(p.data_type, 0.0) + p.square
        count[p.data_type] = count.get(p.data_type, 0.0) + p.n
    return {**fit.scale, **{data_type: max(1.0, total[data_type] / count[data_type]) for data_type in total}}


def _predictive_density(
    joint: JointProblem,
    fit: Fit,
    theta: np.ndarray,
    left_out: Sequence[_ObservationSums],
    retained: Sequence[_ObservationSums],
) -> float:
    scale = _noise_scales(fit, retained)
    gram, across = (sum(getattr(p, what) / scale[p.data_type] for p in retained) for what in ("gram", "across"))
    normal = gram + np.eye(theta.size)
    shift = np.linalg.solve(normal, across + (joint.mean - theta) / joint.sd)
    gram, across = (sum(getattr(p, what) / scale[p.data_type] for p in left_out) for what in ("gram", "across"))
    square = sum(p.square / scale[p.data_type] for p in left_out)
    n = sum(p.n for p in left_out)
    log_sigma = sum(p.log_sigma + 0.5 * p.n * np.log(scale[p.data_type]) for p in left_out)
    # residual = right - rows shift; Woodbury on the p by p side: N(residual; 0, 1 + rows normal^-1 rows')
    residual_square = square - 2.0 * shift @ across + shift @ gram @ shift
    projected = across - gram @ shift
    inner = normal + gram
    quadratic = residual_square - projected @ np.linalg.solve(inner, projected)
    log_ratio = np.linalg.slogdet(inner)[1] - np.linalg.slogdet(normal)[1]
    return float(-0.5 * (quadratic + log_ratio + n * np.log(2.0 * np.pi)) - log_sigma)


def weighted_mean_square(observations: Sequence[Observation], predictions: Sequence[np.ndarray]) -> float:
    """Mean square of observations minus predictions, whitened.

    Parameters
    ----------
    observations : sequence of Observation
    predictions : sequence of (n,) array of float

    Returns
    -------
    float
    """
    total = sum(o.effective * float(np.sum(o.whiten(o.data - p) ** 2)) for o, p in zip(observations, predictions))
    return total / sum(o.n_effective for o in observations)


def effect_signature(case: Case, fit: Fit, candidate: Candidate) -> list[np.ndarray]:
    """Change by a candidate in each observation, whitened, at the nuisances of ``fit``.

    Parameters
    ----------
    case : Case
    fit : Fit
    candidate : Candidate
        One of those in ``fit``.

    Returns
    -------
    list of (n,) array of float
        [] if the simulation fails without it.
    """
    other_terms = tuple(t for c, t in zip(fit.candidates, fit.terms) if c.key != candidate.key)
    try:
        without = case.predict(fit.values, other_terms, case.observations)
    except SimulationError:
        return []
    return [o.whiten(p - q) for o, p, q in zip(case.observations, fit.predictions, without)]


def signature_overlap(case: Case, fit: Fit, first: Candidate, second: Candidate) -> float:
    r"""Overlap of two effects in sensors and recordings: 0 if they show apart, 1 if alike.

    .. math:: \sum_k \sqrt{p_k q_k}

    with p and q the shares of energy of each change in sensor and recording k.

    Parameters
    ----------
    case : Case
    fit : Fit
        With both effects.
    first, second : Candidate

    Returns
    -------
    float
        1 if the simulation fails without one of them.

    References
    ----------
    Bhattacharyya 1943, On a measure of divergence between two statistical populations.
    """
    p, q = (_energy_shares(case.observations, effect_signature(case, fit, c)) for c in (first, second))
    if p is None or q is None:
        return 1.0
    return float(np.sum(np.sqrt(p * q)))


def _energy_shares(observations: Sequence[Observation], changes: Sequence[np.ndarray]) -> np.ndarray | None:
    """(n_sensor_and_recording,) shares of the energy of ``changes``. None if it is zero."""
    energies = [e for o, d in zip(observations, changes) for e in _energy_by_sensor(o, o.effective * np.square(d))]
    total = float(np.sum(energies))
    return np.array(energies) / total if total > 0.0 else None


def _energy_by_sensor(observation: Observation, energy: np.ndarray) -> Iterable[float]:
    """Sums of ``energy`` (n,) by sensor. One sum if the observation has no sensor labels."""
    if observation.cells is None or "sensor" not in observation.labels:
        return [float(np.sum(energy))]
    level, code = np.unique(observation.labels["sensor"].astype(str), return_inverse=True)
    inside = observation.cells >= 0
    return np.bincount(code[observation.cells[inside]], energy[inside], minlength=level.size)


def single_witness(
    search: Search, fit: Fit, candidate: Candidate, gain: float, by_condition: Mapping[str, float]
) -> str:
    """The condition whose gain alone supports a name while the gain of all others together does not.

    "" if there is none.

    A real effect shows wherever it acts. A gain in one recording that others do not share belongs to that recording, if
    at least two others show the effect with half its energy. Two are needed, since nuisances may absorb the gain of
    one. Trains are exempt: speed and roughness differ at each passage.

    Impacts at one position are one witness, however often they are repeated. They share the fittings, the twist of the
    rail and the mark on it. No held-out condition shows the prior penalty that nuisances pay to imitate an effect. If
    that penalty is most of the ``gain``, and all other conditions support the name, no single position is the witness.
    Passages share none of these faults: if they are enough for a name without any impact, they are a second witness.
    What other impacts lose by the name is a question of its own (``is_contradicted``).

    Parameters
    ----------
    search : Search
    fit : Fit
        It has ``candidate`` in it.
    candidate : Candidate
    gain : float
        Of all conditions together. [nats]
    by_condition : dict
        Condition -> gain when it is left out. [nats]
    """
    case, threshold = search.case, search.settings.threshold
    if position := _single_hammer_position(case.hammer_positions(), gain, by_condition, threshold):
        return position
    strongest = max(by_condition, key=lambda c: by_condition[c], default="")
    if not strongest or by_condition[strongest] <= threshold or "train" in candidate.where:
        return ""
    other_gain = sum(by_condition.values()) - by_condition[strongest]
    if other_gain >= threshold:
        return ""
    energies = effect_energy(case, fit, candidate)
    min_energy = THRESHOLDS.min_energy_ratio * energies.pop(strongest, np.inf)
    return strongest if sum(energy >= min_energy for energy in energies.values()) >= THRESHOLDS.min_witnesses else ""


def _single_hammer_position(
    hammer_positions: Mapping[str, float], gain: float, by_condition: Mapping[str, float], threshold: float
) -> str:
    """Position, in words, whose impacts alone support half of a name or more, while all others do not.

    "" if there is none, or if recordings without impacts support the name. Half of a name is enough to confirm one:
    the price of a name is that of a search among many effects, and others need to confirm only the one that was found.
    """
    gains: dict[float, float] = {}
    for condition, condition_gain in by_condition.items():
        if condition in hammer_positions:
            gains[hammer_positions[condition]] = gains.get(hammer_positions[condition], 0.0) + condition_gain
    if len(gains) < THRESHOLDS.min_hammer_positions:
        return ""
    strongest = max(gains, key=lambda position: gains[position])
    other_gain = sum(by_condition.values()) - gains[strongest]
    gain_without_impacts = sum(g for condition, g in by_condition.items() if condition not in hammer_positions)
    if gain_without_impacts >= threshold:
        return ""
    if other_gain > 0.0 and gains[strongest] + other_gain < THRESHOLDS.min_held_out_share * gain:
        return ""
    is_alone = gains[strongest] > THRESHOLDS.min_confirmation * threshold > other_gain
    return f"all impacts at {strongest:g} m" if is_alone else ""


def effect_energy(case: Case, fit: Fit, candidate: Candidate) -> dict[str, float]:
    """Weighted energy of the change by a candidate, by condition.

    Parameters
    ----------
    case : Case
    fit : Fit
    candidate : Candidate
        One of those in ``fit``.

    Returns
    -------
    dict
        Condition -> energy. {} if the simulation fails without the candidate.
    """
    energies: dict[str, float] = {}
    for o, change in zip(case.observations, effect_signature(case, fit, candidate)):
        energy = o.effective * float(np.sum(change**2))
        energies[o.condition] = energies.get(o.condition, 0.0) + energy
    return energies


def gain_where_unmasked(case: Case, fit: Fit, by_condition: Mapping[str, float]) -> float:
    """Gain of the conditions in which no effect of ``fit`` shows.

    Parameters
    ----------
    case : Case
    fit : Fit
    by_condition : mapping
        Condition -> gain when it is left out. [nats]

    Returns
    -------
    float
        0 if ``fit`` has no effect. [nats]
    """
    unmasked = dict(by_condition) if fit.candidates else {}
    for candidate in fit.candidates:
        energies = effect_energy(case, fit, candidate)
        largest = max(energies.values(), default=np.inf)
        unmasked = {
            c: gain for c, gain in unmasked.items() if energies.get(c, largest) < THRESHOLDS.max_masked_energy * largest
        }
    return float(sum(unmasked.values()))
