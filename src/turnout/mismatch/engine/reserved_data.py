"""Predictions of reserved recordings, with the nuisances that these own fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.fit_quality import fit_percent
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import FitPoint
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation


def reserved_fit(case: Case, fit: Fit) -> tuple[list[np.ndarray], float] | tuple[None, None]:
    """Predictions of the reserved recordings by a fitted model, and how well they fit.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    predictions : list of (n,) array of float or None
        None if the simulation fails.
    percent : float or None
        As ``fit_percent``. [%]
    """
    try:
        predictions = predict_reserved(case, fit, case.reserved)
    except SimulationError:
        return None, None
    return predictions, fit_percent(case.reserved, predictions)


def predict_reserved(case: Case, fit: Fit, observations: Sequence[Observation]) -> list[np.ndarray]:
    """Predictions by the fitted model; only nuisances that the observations own are fitted to them.

    Any model gets the same freedom (speed, time and load of a passage), so that models stay comparable.

    Parameters
    ----------
    case : Case
    fit : Fit
    observations : sequence of Observation
        Reserved ones.

    Returns
    -------
    list of (n,) array of float

    Raises
    ------
    SimulationError
        If the model cannot be simulated there.
    """
    return fit_reserved(case, fit, observations)[1]


def fit_reserved(case: Case, fit: Fit, observations: Sequence[Observation]) -> tuple[Fit, list[np.ndarray]]:
    """The fit with the nuisances that reserved observations own fitted to them, and its predictions.

    Parameters
    ----------
    case : Case
    fit : Fit
    observations : sequence of Observation
        Reserved ones.

    Returns
    -------
    fit : Fit
        With these values alone changed.
    predictions : list of (n,) array of float

    Raises
    ------
    SimulationError
        If the model cannot be simulated there.
    """
    joint = JointProblem(case, fit.candidates, observations)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    owners = {o.name for o in observations}
    is_owned = np.array([n.owner in owners for n in case.nuisances] + [False] * fit.psi.size, dtype=bool)
    predictions = joint.predict(theta)
    if not is_owned.any():
        return fit, predictions
    residuals = joint.residuals(predictions)
    cost = joint.cost(theta, residuals)
    for _ in range(THRESHOLDS.max_reserved_steps):
        step = _owned_step(case, joint, theta, fit.terms, predictions, residuals, is_owned)
        trials = (_try_step(joint, theta, is_owned, 0.5**h * step) for h in range(THRESHOLDS.n_step_trials))
        improvement = next((f for f in trials if f is not None and f.cost < cost), None)
        if improvement is None:
            break
        gain = cost - improvement.cost
        theta, predictions, residuals, cost = improvement
        if gain < THRESHOLDS.min_cost_decrease:
            break
    return replace(fit, values=joint.split(theta)[0]), predictions


def _owned_step(
    case: Case,
    joint: JointProblem,
    theta: np.ndarray,
    terms: tuple[Any, ...],
    predictions: Sequence[np.ndarray],
    residuals: Sequence[np.ndarray],
    is_owned: np.ndarray,
) -> np.ndarray:
    """Gauss-Newton step of the nuisances that the observations own, at most one prior standard deviation each."""
    white = _owned_columns(case, joint, theta, terms, predictions, is_owned)
    scale = {data_type: max(1.0, v) for data_type, v in joint.level(residuals).items()}
    rows, right = joint.stack(white, residuals, scale)
    scaled = rows * joint.sd[is_owned]
    pull = (joint.mean[is_owned] - theta[is_owned]) / joint.sd[is_owned]
    step = np.linalg.solve(scaled.T @ scaled + np.eye(int(is_owned.sum())), scaled.T @ right + pull)
    return joint.sd[is_owned] * np.clip(step, -1.0, 1.0)


def _try_step(joint: JointProblem, theta: np.ndarray, is_owned: np.ndarray, step: np.ndarray) -> FitPoint | None:
    trial = theta.copy()
    trial[is_owned] += step
    predictions = joint.predict_or_none(trial)
    if predictions is None:
        return None
    residuals = joint.residuals(predictions)
    return FitPoint(trial, predictions, residuals, joint.cost(trial, residuals))


def _owned_columns(
    case: Case,
    joint: JointProblem,
    theta: np.ndarray,
    terms: tuple[Any, ...],
    predictions: Sequence[np.ndarray],
    is_owned: np.ndarray,
) -> list[np.ndarray]:
    """Whitened derivatives by the owned nuisances, for each observation by its own alone."""
    values, jacobians = joint.split(theta)[0], []
    owned = [n for n, selected in zip(case.nuisances, is_owned) if selected]
    for o, p in zip(joint.observations, predictions):
        columns = np.zeros((o.data.size, len(owned)))
        selected = [k for k, n in enumerate(owned) if n.owner == o.name]
        if selected:
            columns[:, selected] = case.own_jacobian(values, terms, o, p, [owned[k].name for k in selected])
        jacobians.append(o.whiten(columns))
    return jacobians
