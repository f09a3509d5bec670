r"""The most probable values of a visit under any normal prior, with all of its recordings simulated there again.

Visits are stored as linear models about their own maxima. A nose is not linear over the distance between two such
maxima: whether a visit agrees with what is known from earlier ones, only a fit that begins there can tell.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.engine.large_values import with_wide_priors
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout.further_passages import noise_scales

if TYPE_CHECKING:
    from turnout.mismatch.calibrated.belief import Belief, StateParameter
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit

Point = tuple[np.ndarray, list[np.ndarray], list[np.ndarray], float]  # values, predictions, whitened residuals, cost


@dataclass(frozen=True)
class NormalPrior:
    """Normal prior of all nuisances of a case: ``mean`` (n,) and inverse covariance ``precision`` (n, n)."""

    mean: np.ndarray
    precision: np.ndarray

    @classmethod
    def of_file(cls, case: Case) -> NormalPrior:
        """The prior of the case: independent values.

        Parameters
        ----------
        case : Case

        Returns
        -------
        NormalPrior
        """
        mean, sd = (np.array([getattr(n, field) for n in case.nuisances]) for field in ("mean", "sd"))
        return cls(mean, np.diag(sd**-2))

    @classmethod
    def of_belief(cls, case: Case, parameters: Mapping[str, StateParameter], belief: Belief) -> NormalPrior:
        """The belief in the shared parameters, with what a visit adds of its own; the prior of the case for all others.

        Parameters
        ----------
        case : Case
        parameters : mapping
            Nuisance -> parameter, as ``calibrated_parameters``.
        belief : Belief
            In these parameters, and others.

        Returns
        -------
        NormalPrior
        """
        shared = [k for k, n in enumerate(case.nuisances) if n.name in parameters]
        of_belief = [belief.names.index(parameters[case.nuisances[k].name].name) for k in shared]
        own = np.array([parameters[case.nuisances[k].name].visit_sd for k in shared])
        mean = np.array([n.mean for n in case.nuisances])
        covariance = np.diag([float(n.sd) ** 2 for n in case.nuisances])
        mean[shared] = belief.mean[of_belief]
        covariance[np.ix_(shared, shared)] = belief.covariance[np.ix_(of_belief, of_belief)] + np.diag(own**2)
        return cls(mean, np.linalg.inv(covariance))

    def cost(self, x: np.ndarray) -> float:
        """Minus twice the log density, up to a constant.

        Parameters
        ----------
        x : (n,) array of float
            Parameters, in the order of ``mean``.

        Returns
        -------
        float
        """
        return float((x - self.mean) @ self.precision @ (x - self.mean))


def fit_all_recordings(case: Case, fit: Fit, prior: NormalPrior, values: Mapping[str, float]) -> tuple[Fit, float]:
    r"""Gauss-Newton steps from ``values``, each with all recordings simulated again.

    .. math:: \min_x \sum_r w_r |e_r(x)|^2 + (x - m)^T P^{-1} (x - m)

    Steps are damped (Marquardt 1963) until they lower the sum.

    Parameters
    ----------
    case : Case
        With all recordings among its observations, see ``with_reserved_passages``.
    fit : Fit
        Its noise scales give the weights.
    prior : NormalPrior
        m and P.
    values : mapping
        Nuisance -> value, where the steps begin.

    Returns
    -------
    fit : Fit
        With the values, derivatives and whitened residuals at the end. The other fields are those of ``fit``.
    cost : float
        The sum.

    Raises
    ------
    SimulationError
        If the model cannot be simulated at the beginning, or beside an end of a step.

    References
    ----------
    Bell and Cathey 1993, The iterated Kalman filter update as a Gauss-Newton method, IEEE Transactions on Automatic
    Control 38.
    """
    low, high = np.array([n.bounds for n in case.nuisances], dtype=float).T
    weights = _weights(case, fit)

    def evaluate(x: np.ndarray) -> Point:
        x = np.clip(x, low, high)
        predicted = case.predict(_values(case, x), (), case.observations)
        white = [np.asarray(o.whiten(o.data - p), dtype=float) for o, p in zip(case.observations, predicted)]
        return x, predicted, white, sum(w * float(e @ e) for w, e in zip(weights, white)) + prior.cost(x)

    x, predicted, white, cost = evaluate(np.array([values[n.name] for n in case.nuisances]))
    rows, damping = _derivatives(case, x, predicted), 0.0
    for _ in range(CALIBRATION.max_new_steps):
        matrix, score = _normal_equations(weights, rows, white, prior, x)
        end, damping = _lower_point(x, matrix, score, cost, damping, evaluate)
        if end is None:
            break
        gain = 0.5 * (cost - end[3])
        x, predicted, white, cost = end
        rows = _derivatives(case, x, predicted)
        if gain < CALIBRATION.min_new_gain:
            break
    return replace(fit, values=_values(case, x), jacobian=rows, white=white), cost


def fit_again(case: Case, fit: Fit, large: Collection[str], partners: Mapping[str, str]) -> Fit:
    """The fit, continued to the maximum of all recordings under the prior of the file.

    Where trains meet a nose, recordings that are linear about the maximum of a few others lead far from their own.

    Parameters
    ----------
    case : Case
        With all recordings among its observations.
    fit : Fit
        Where the steps begin.
    large : collection of str
        Nuisances that are far beyond their prior: they have a wide one, as in ``fit_large_values``.
    partners : mapping
        As ``with_wide_priors``.

    Returns
    -------
    Fit
        With the noise scale at its end.

    Raises
    ------
    SimulationError
        If the model cannot be simulated at the beginning, or beside an end of a step.
    """
    wide = with_wide_priors(case, large, CALIBRATION.change_sds, partners)
    again, _ = fit_all_recordings(wide, fit, NormalPrior.of_file(wide), fit.values)
    return replace(again, scale={**again.scale, **noise_scales(wide, again)})


def _values(case: Case, x: np.ndarray) -> dict[str, float]:
    return {n.name: float(value) for n, value in zip(case.nuisances, x)}


def _derivatives(case: Case, x: np.ndarray, predicted: list[np.ndarray]) -> list[np.ndarray]:
    derivatives = case.nuisance_jacobian(_values(case, x), (), case.observations, predicted)
    return [np.asarray(o.whiten(d), dtype=np.float32) for o, d in zip(case.observations, derivatives)]


def _lower_point(
    x: np.ndarray,
    matrix: np.ndarray,
    score: np.ndarray,
    cost: float,
    damping: float,
    evaluate: Callable[[np.ndarray], Point],
) -> tuple[Point | None, float]:
    """First point with a lower cost, with rising damping (None: there is none), and the damping of the next step."""
    for _ in range(THRESHOLDS.max_damping_tries):
        step = np.linalg.solve(matrix + np.diag(damping * np.diag(matrix)), score)
        try:
            point = evaluate(x + step)
        except SimulationError:
            point = None
        if point is not None and point[3] < cost:
            return point, damping * THRESHOLDS.damping_decrease if damping > THRESHOLDS.min_damping else 0.0
        damping = max(THRESHOLDS.damping_increase * damping, THRESHOLDS.first_damping)
    return None, damping


@dataclass(frozen=True)
class FitGivenBelief:
    """A ``fit`` under a belief, and how far it is from the data alone.

    ``excess`` is the cost under the belief less that of the data at the maximum under the prior of the file. It is
    chi-squared like the innovation where the visit agrees with the belief, since both are twice the logarithm of a
    ratio of likelihoods, but holds for models that are not linear as well. ``linear_excess`` is the same by the linear
    model about the maximum under the prior of the file. Where it is larger, that model does not reach so far.
    """

    fit: Fit
    excess: float
    linear_excess: float


def fit_given_belief(case: Case, fit: Fit, parameters: Mapping[str, StateParameter], belief: Belief) -> FitGivenBelief:
    """The fit of a visit that begins at the values which earlier visits predict, under that belief.

    Its noise scale is that which all recordings leave at the maximum under the prior of the file.

    Parameters
    ----------
    case : Case
        With all recordings among its observations.
    fit : Fit
        Its fit under the prior of the file.
    parameters : mapping
        Nuisance -> parameter.
    belief : Belief
        Before the visit.

    Returns
    -------
    FitGivenBelief

    Raises
    ------
    SimulationError
        If the model cannot be simulated at a start.
    """
    alone, _ = fit_all_recordings(case, fit, NormalPrior.of_file(case), fit.values)
    alone = replace(alone, scale={**alone.scale, **noise_scales(case, alone)})
    prior = NormalPrior.of_belief(case, parameters, belief)
    start = {**_values(case, prior.mean), **{n.name: alone.values[n.name] for n in case.nuisances if n.owner}}
    given, cost = fit_all_recordings(case, alone, prior, start)
    x = np.array([alone.values[n.name] for n in case.nuisances])
    own = sum(((alone.values[n.name] - n.mean) / n.sd) ** 2 for n in case.nuisances if n.owner)
    weights = _weights(case, alone)
    of_data = own + sum(w * float(e @ e) for w, e in zip(weights, alone.white))
    matrix, score = _normal_equations(weights, alone.jacobian, alone.white, prior, x)
    linear_excess = prior.cost(x) - own - float(score @ np.linalg.solve(matrix, score))
    return FitGivenBelief(given, cost - of_data, linear_excess)


def _weights(case: Case, fit: Fit) -> list[float]:
    """Weight of each observation: of its samples, over the noise scale."""
    return [o.effective / fit.scale[o.data_type] for o in case.observations]


def _normal_equations(
    weights: Sequence[float], rows: Sequence[np.ndarray], white: Sequence[np.ndarray], prior: NormalPrior, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (n, n) and right side (n,) of a Gauss-Newton step from ``x``."""
    matrix, score = prior.precision.copy(), -prior.precision @ (x - prior.mean)
    for w, r, e in zip(weights, rows, white):
        weighted = w * np.asarray(r, dtype=float).T
        matrix, score = matrix + weighted @ r, score + weighted @ e
    return matrix, score
