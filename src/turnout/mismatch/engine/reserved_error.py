r"""Error of what a name gains on reserved recordings that comes from the recordings that were fitted.

Both models, with and without the name, have parameters from few recordings. With other ones the gain would be another,
also of a name that the reserved recordings do not show. This is estimated by a jackknife over the fitted recordings.
Without recording i both fits move by a Gauss-Newton step, to :math:`\theta_i` and :math:`\theta'_i`, and so does the
gain:

.. math:: s^2 = \frac{m - 1}{m} \sum_i (g_i - \bar g)^2, \quad
          g_i = F(\theta'_i) - F(\theta_i)

with F the fit of the reserved recordings (Efron and Stein 1981, The jackknife estimate of variance).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import jackknife_errors, jackknife_steps
from turnout.mismatch.engine.fit_quality import fit_percent
from turnout.mismatch.engine.reserved_data import fit_reserved

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation


def error_of_fitted(case: Case, base: Fit, fit: Fit) -> float:
    """Standard error of the gain on the reserved recordings by the scatter between the fitted ones.

    Parameters
    ----------
    case : Case
    base, fit : Fit
        Without the name and with it, with their Jacobians.

    Returns
    -------
    float
        In points of fit. 0 if a fit has no Jacobian, if fewer than three recordings of that type were fitted, or if a
        model cannot be simulated beside its optimum.
    """
    if not (base.jacobian and fit.jacobian):
        return 0.0
    variance = 0.0
    for data_type in {o.data_type for o in case.reserved}:
        try:
            percents = [_percents_without_one(case, f, jackknife_steps(case, f, data_type)) for f in (base, fit)]
        except SimulationError:
            return 0.0
        variance += float(jackknife_errors((percents[1] - percents[0])[:, None])[0]) ** 2
    return float(np.sqrt(variance))


def _percents_without_one(case: Case, fit: Fit, steps: np.ndarray) -> np.ndarray:
    """(m,) fit of the reserved recordings after each of ``steps`` (m, n) of nuisances and effects. [%]"""
    if not len(steps):
        return np.zeros(0)
    at_optimum, predictions = fit_reserved(case, fit, case.reserved)
    reserved_names = {o.name for o in case.reserved}
    own = [k for k, n in enumerate(case.nuisances) if n.owner in reserved_names]
    columns = _own_columns(case, at_optimum, predictions, own)
    percents = []
    for step in steps:
        step = np.where(np.isin(np.arange(step.size), own), 0.0, step)
        stepped = _fit_after_step(case, at_optimum, step)
        shifted = case.predict(stepped.values, stepped.terms, case.reserved)
        after = [_with_own_refitted(*entry) for entry in zip(case.reserved, predictions, shifted, columns)]
        percents.append(fit_percent(case.reserved, after))
    return np.array(percents)


def _fit_after_step(case: Case, fit: Fit, step: np.ndarray) -> Fit:
    """The fit with ``step`` added to its nuisances and effects, within their bounds."""
    n = len(case.nuisances)
    values = {
        p.name: float(np.clip(fit.values[p.name] + s, *p.bounds)) for p, s in zip(case.nuisances, step[:n].tolist())
    }
    bounds = [p.bounds for c in fit.candidates for p in c.parameters]
    psi = np.array([np.clip(v + s, *b) for v, s, b in zip(fit.psi, step[n:], bounds)])
    return replace(fit, values=values, psi=psi)


def _own_columns(case: Case, fit: Fit, predictions: list[np.ndarray], own: list[int]) -> list[np.ndarray]:
    """Derivatives of each reserved recording by its own nuisances, times their prior standard deviations."""
    columns = []
    for o, p in zip(case.reserved, predictions):
        owned = [case.nuisances[k] for k in own if case.nuisances[k].owner == o.name]
        if not owned:
            columns.append(np.zeros((o.data.size, 0)))
            continue
        jacobian = case.own_jacobian(fit.values, fit.terms, o, p, [n.name for n in owned])
        columns.append(jacobian * [n.sd for n in owned])
    return columns


def _with_own_refitted(o: Observation, at_optimum: np.ndarray, shifted: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """The ``shifted`` prediction with the recording's own nuisances fitted again, by one linear step."""
    if not columns.shape[1]:
        return shifted
    rows = np.sqrt(o.effective) * o.whiten(columns)
    right = np.sqrt(o.effective) * o.whiten(at_optimum - shifted)
    return shifted + columns @ np.linalg.solve(rows.T @ rows + np.eye(columns.shape[1]), rows.T @ right)
