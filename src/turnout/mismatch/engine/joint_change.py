r"""How the change of one quantity is divided between an effect and the tolerance of the base model.

A wheelset 1.8 times as heavy as in its file is an effect of 1.8 and a tolerance of nothing, or one of 1.4 and a
tolerance of 1.3: the prediction is the same. Recordings show the joint change alone, and the priors alone divide it. A
fit that ends before its optimum leaves the division where its steps were, which made an effect too small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from turnout.mismatch.engine.levenberg_marquardt import FitPoint

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.joint_problem import JointProblem


def with_probable_division(
    joint: JointProblem, point: FitPoint, jacobian: Sequence[np.ndarray]
) -> tuple[FitPoint, list[np.ndarray]]:
    r"""The end of a fit with every joint change divided as the priors have it, at the same prediction.

    With the joint change :math:`t = \psi\, g(\eta)` of an effect that is 1 where there is none, or
    :math:`t = \psi + g(\eta)` of one that is 0,

    .. math:: \min_\eta \; (\psi - \mu_\psi)^2 / \sigma_\psi^2 + (\eta - \mu_\eta)^2 / \sigma_\eta^2
              \quad \text{with } t \text{ held}

    Parameters
    ----------
    joint : JointProblem
    point : FitPoint
    jacobian : sequence of (n, p) array of float
        Whitened derivatives at the point, by observation.

    Returns
    -------
    point : FitPoint
        At no higher cost.
    jacobian : list of (n, p) array of float
        With the columns of the moved parameters at their new values.
    """
    rows, names = list(jacobian), [n.name for n in joint.case.nuisances]
    first = joint.n
    for candidate in joint.candidates:
        if candidate.site.same_quantity and candidate.site.masking_parameter in names:
            point, rows = _divide(joint, point, rows, candidate, (first, names.index(candidate.site.masking_parameter)))
        first += len(candidate.parameters)
    return point, rows


def _divide(
    joint: JointProblem, point: FitPoint, jacobian: list[np.ndarray], candidate: Candidate, at: tuple[int, int]
) -> tuple[FitPoint, list[np.ndarray]]:
    """The end of a fit with the joint change of one candidate divided. ``at``: indices of effect and tolerance."""
    share_of = candidate.site.from_masking or np.exp
    is_product = candidate.neutral[0] != 0.0
    psi, eta = (float(point.theta[k]) for k in at)

    def effect_beside(tolerance: float) -> float:
        share, new_share = share_of(eta), share_of(tolerance)
        return float(psi * share / new_share if is_product else psi + share - new_share)

    def prior_cost(tolerance: float) -> float:
        theta = np.array([effect_beside(tolerance), tolerance])
        return float(np.sum(((theta - joint.mean[[*at]]) / joint.sd[[*at]]) ** 2))

    reach = max(abs(eta - joint.mean[at[1]]), joint.sd[at[1]])
    low, high = np.clip(joint.mean[at[1]] + np.array([-reach, reach]), joint.low[at[1]], joint.high[at[1]])
    optimum, cost = minimize_scalar(prior_cost, bounds=(low, high), method="bounded"), prior_cost(eta)
    tolerance = float(optimum.x)
    is_possible = joint.low[at[0]] <= effect_beside(tolerance) <= joint.high[at[0]]
    if not (is_possible and optimum.fun < cost):
        return point, jacobian
    theta = np.array(point.theta)
    theta[[*at]] = effect_beside(tolerance), tolerance
    # the prediction depends on the joint change t alone: each derivative is that by t times the slope of t
    ratio = share_of(tolerance) / share_of(eta) if is_product else 1.0
    factors = np.ones(theta.size)
    factors[[*at]] = ratio, _slope(share_of, tolerance) / _slope(share_of, eta) / ratio
    moved = point._replace(theta=theta, cost=point.cost + optimum.fun - cost)
    return moved, [(j * factors).astype(j.dtype) for j in jacobian]


def _slope(function: Callable[[float], float], at: float, step: float = 1e-6) -> float:
    """Derivative of a smooth function of order one, by central differences: the error is of the order of step²."""
    return float((function(at + step) - function(at - step)) / (2.0 * step))
