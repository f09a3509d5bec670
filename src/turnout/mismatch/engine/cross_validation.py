"""Scores on held-out conditions, energies of the change by an effect, and the overlap of two effects.

The overlap is the share of the change by one effect in sensors and recordings that another effect changes as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.case_check import checked_predictions
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation


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
        without = checked_predictions(case.observations, case.predict(fit.values, other_terms, case.observations))
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
    squares = ((o, o.effective * np.square(change)) for o, change in zip(observations, changes))
    energies = [energy for o, square in squares for energy in sums_by_sensor(o, square).values()]
    total = float(np.sum(energies))
    return np.array(energies) / total if total > 0.0 else None


def sums_by_sensor(observation: Observation, amounts: np.ndarray) -> dict[str, float]:
    """Sums of a non-negative amount of each sample by sensor.

    Parameters
    ----------
    observation : Observation
    amounts : (n,) array of float

    Returns
    -------
    dict
        Sensor -> sum. One sum, of "", if the observation has no sensor labels.
    """
    if observation.cells is None or "sensor" not in observation.labels:
        return {"": float(np.sum(amounts))}
    level, code = np.unique(observation.labels["sensor"].astype(str), return_inverse=True)
    inside = observation.cells >= 0
    sums = np.bincount(code[observation.cells[inside]], amounts[inside], minlength=level.size)
    return dict(zip(level.tolist(), sums.tolist()))


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
