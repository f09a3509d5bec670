"""Joint maximum a posteriori fit of nuisances and term parameters: damped Gauss-Newton steps within a trust region."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.joint_change import with_probable_division
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import DampedSteps, FitPoint, broyden_update
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.observation import Observation


def fit_jointly(
    case: Case,
    candidates: Iterable[Candidate] = (),
    start: ArrayLike | None = None,
    values: Mapping[str, float] | None = None,
    reused_jacobian: Sequence[np.ndarray] | None = None,
    observations: Iterable[Observation] | None = None,
    iterations: int = THRESHOLDS.n_steps,
    min_gain: float = THRESHOLDS.min_gain,
    stall: float = THRESHOLDS.stall,
    sought_cost: float = np.inf,
) -> Fit:
    r"""Maximum of the posterior of nuisances and term parameters together.

    .. math:: \min_{\eta,\psi} \sum_k n_k \left[\ln s_k^2 + \overline{r^2}_k / s_k^2\right]
              + \sum (\eta - \mu)^2 / \sigma_\eta^2, \quad s_k \ge 1

    Damped Gauss-Newton steps (Levenberg and Marquardt).

    Parameters
    ----------
    case : Case
    candidates : iterable of Candidate
        Effects in the model.
    start : (n_term,) array of float or None
        Parameters of the effects where the fit starts; None: neutral.
    values : mapping or None
        Nuisance parameters where the fit starts; others start where the case says, or at their prior mean.
    reused_jacobian : sequence of (n, p) array of float or None
        A Jacobian by observation. Its nuisance columns are used instead of new ones, and updated by Broyden's formula.
    observations : iterable of Observation or None
        Those that are fitted; None: all of the case.
    iterations : int
        Largest number of steps.
    min_gain : float
        A step that gains less is the last. [nats]
    stall : float
        The same for a large case, as a share of the cost per sample.
    sought_cost : float
        The fit ends where it is if even a multiple of what a step promises leads to a higher cost.

    Returns
    -------
    Fit

    Raises
    ------
    SimulationError
        If the model cannot be simulated at the start, or beside a point at which derivatives are needed.
    """
    joint = JointProblem(case, candidates, observations, iterations, min_gain, stall)
    point = _start_point(joint, start, values)
    theta, predictions, *_ = point
    if not theta.size:
        return _fit_result(joint, point, [np.zeros((o.data.size, 0)) for o in joint.observations])
    jacobian = joint.jacobian(theta, predictions, reused_jacobian)
    if reused_jacobian is not None:
        jacobian = joint.with_new_hammer_columns(theta, predictions, jacobian)
    refresh_steps = THRESHOLDS.n_refresh_steps if reused_jacobian is None else 0
    end = _iterate(joint, point, jacobian, refresh_steps, sought_cost)
    return _fit_result(joint, *with_probable_division(joint, *end))


def steps_from(
    case: Case,
    candidates: Iterable[Candidate],
    start: ArrayLike,
    values: Mapping[str, float],
    iterations: int,
    sought_cost: float = np.inf,
) -> tuple[float, dict[str, float], np.ndarray]:
    """End of a few steps of a joint fit to hammer tests, without the derivatives that a ``Fit`` needs.

    Parameters
    ----------
    case : Case
        A small one.
    candidates : iterable of Candidate
        Effects in the model.
    start : (n_term,) array of float
        Parameters of the effects where the steps start.
    values : mapping
        Nuisance parameters there.
    iterations : int
        Largest number of steps.
    sought_cost : float
        The steps end where they are if even a multiple of what the next promises leads to a higher cost.

    Returns
    -------
    cost : float
    values : dict
        Nuisance parameters there.
    psi : (n_term,) array of float
        Parameters of the effects there.

    Raises
    ------
    SimulationError
        If the model cannot be simulated at the start, or beside a point at which derivatives are needed.
    """
    joint = JointProblem(case, candidates, iterations=iterations)
    point = _start_point(joint, start, values)
    end, _ = _iterate(joint, point, joint.jacobian(point.theta, point.predictions), 0, sought_cost)
    return end.cost, *joint.split(end.theta)


def _start_point(joint: JointProblem, start: ArrayLike | None, values: Mapping[str, float] | None) -> FitPoint:
    """Start of a fit: effects at ``start``, None: neutral; other nuisances where the case says, or at their mean."""
    psi = np.array([p.neutral for p in joint.parameters]) if start is None else np.asarray(start, dtype=float)
    start_values = {**joint.case.start_values, **(values or {})}
    theta = np.concatenate([[start_values.get(n.name, n.mean) for n in joint.case.nuisances], psi])
    predictions = joint.predict(theta)
    residuals = joint.residuals(predictions)
    return FitPoint(theta, predictions, residuals, joint.cost(theta, residuals))


def _iterate(
    joint: JointProblem, point: FitPoint, jacobian: list[np.ndarray], refresh_steps: int, sought_cost: float
) -> tuple[FitPoint, list[np.ndarray]]:
    """Steps until nothing is gained.

    The Jacobian of a large case is updated. It is recomputed after every ``refresh_steps`` steps (0: never)
    and before the last one, since after many updates its directions are wrong.
    """
    is_large = joint.case.is_large
    min_decrease, n_since_refresh, damping = joint.min_decrease, 0, 0.0
    for iteration in range(joint.iterations):
        steps = DampedSteps(joint, point.theta, point.residuals, jacobian)
        if point.cost - THRESHOLDS.promise_factor * steps.promise > sought_cost:
            break
        is_updated = joint.case.reuses_derivatives and refresh_steps > 0 and n_since_refresh > 0
        improvement, damping = steps.first_improvement(point.cost, damping, 1 if is_updated else None)
        if is_updated and not improvement:  # new derivatives before smaller steps
            jacobian, n_since_refresh = _refreshed_jacobian(joint, point, jacobian), 0
            steps = DampedSteps(joint, point.theta, point.residuals, jacobian)
            improvement, damping = steps.first_improvement(point.cost, damping)
        gain = point.cost - improvement.cost if improvement else 0.0
        if improvement:
            if is_large:
                jacobian = _updated_jacobian(joint, jacobian, point, improvement)
            point = improvement
        n_since_refresh += 1
        if (
            gain < min_decrease
            and not (improvement and damping >= THRESHOLDS.first_damping)
            and (n_since_refresh == 1 or not (is_large and refresh_steps))
        ):
            break
        if iteration + 1 == joint.iterations:  # no step follows
            continue
        if not is_large or 0 < refresh_steps <= n_since_refresh or (refresh_steps and gain < min_decrease):
            jacobian, n_since_refresh = _refreshed_jacobian(joint, point, jacobian), 0
    else:
        if refresh_steps and n_since_refresh:
            jacobian = _refreshed_jacobian(joint, point, jacobian)
    return point, jacobian


def _updated_jacobian(
    joint: JointProblem, jacobian: list[np.ndarray], before: FitPoint, after: FitPoint
) -> list[np.ndarray]:
    """The Jacobian after a step: updated for passages, new for hammer tests."""
    step, updated = after.theta - before.theta, list(jacobian)
    chosen = [i for i, o in enumerate(joint.observations) if not joint.case.is_hammer_test(o)]
    old, residuals_before, residuals_after = (
        [values[i] for i in chosen] for values in (jacobian, before.residuals, after.residuals)
    )
    for i, new in zip(chosen, broyden_update(old, step / joint.sd**2, step, residuals_before, residuals_after)):
        updated[i] = new
    return joint.with_new_hammer_columns(after.theta, after.predictions, updated)


def _refreshed_jacobian(joint: JointProblem, point: FitPoint, updated: list[np.ndarray]) -> list[np.ndarray]:
    """A new Jacobian. In a large case the ``updated`` one if the simulation fails close to the point."""
    try:
        return joint.jacobian(point.theta, point.predictions)
    except SimulationError:
        if joint.case.is_large:
            return updated
        raise


def _fit_result(joint: JointProblem, point: FitPoint, jacobian: list[np.ndarray]) -> Fit:
    """The fit that ends at this point, with its covariance and evidence."""
    level, n = joint.level(point.residuals), point.theta.size
    scale = {data_type: max(1.0, v) for data_type, v in level.items()}
    covariance: np.ndarray = np.zeros((n, n))
    evidence = -0.5 * point.cost
    if n:
        normal = np.eye(n)
        for o, j in zip(joint.observations, jacobian):
            scaled = np.sqrt(o.effective / scale[o.data_type]) * j * joint.sd
            normal += scaled.T @ scaled
        covariance = np.linalg.inv(normal) * np.outer(joint.sd, joint.sd)
        evidence -= 0.5 * float(np.linalg.slogdet(normal)[1])
    values, psi = joint.split(point.theta)
    plain = [o.data - p for o, p in zip(joint.observations, point.predictions)]
    return Fit(
        values, joint.candidates, psi, point.predictions, plain, jacobian, scale, level, point.cost, covariance,
        joint.evaluations, point.residuals, evidence,
    )  # fmt: skip
