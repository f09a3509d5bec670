"""A few nuisances with values far beyond their prior, in a fit without effects.

Under normal priors many small deviations are more probable than a single large one, and a fit explains a broken railpad
by softer ballast beside it. Here each value may be large with a small probability (a normal mixture, George and
McCulloch 1993, Variable selection via Gibbs sampling). Each explanation by a single large value is fitted to its own
maximum, and their evidences are compared there.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.joint_problem import JointProblem, cost_at
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance
    from turnout.mismatch.engine.search import Search


def fit_large_values(
    search: Search, fit: Fit, names: Collection[str], widening: float, partners: Mapping[str, str] | None = None
) -> Fit:
    """The fit, continued with wide priors for those nuisances whose large values have the most evidence.

    One value after the other is added, as long as its evidence exceeds that of the fit without it by the logarithm of
    the number of ``names``, which are equally probable before, and ``THRESHOLDS.large_value_lead``.

    Parameters
    ----------
    search : Search
        Of the case that was fitted.
    fit : Fit
        Without effects, with its Jacobian.
    names : collection of str
        Nuisances that may have large values.
    widening : float
        Wide prior standard deviation of such a value, over its own.
    partners : mapping or None
        Nuisance -> another that changes with it, as a damper with its spring: see ``with_wide_priors``.

    Returns
    -------
    Fit
        Its evidence is that with the wide priors.
    """
    penalty, partners = float(np.log(max(len(names), 1))) + THRESHOLDS.large_value_lead, partners or {}
    large: tuple[str, ...] = ()
    for _ in range(THRESHOLDS.max_large_values):
        gains, far_values = _evidence_near_and_far(search.case, fit, names, widening, large, partners)
        promising = sorted((n for n, g in gains.items() if g > penalty), key=lambda n: -gains[n])
        fits = {}
        for name in promising[: THRESHOLDS.n_large_starts]:
            try:
                fits[name] = _fit_with(search, fit, (*large, name), widening, partners, far_values.get(name))
            except SimulationError:
                continue
        leader = max(fits, key=lambda n: fits[n].evidence, default=None)
        if leader is None or fits[leader].evidence - penalty <= fit.evidence:
            break
        large, fit = (*large, leader), fits[leader]
    return fit


def with_wide_priors(
    case: Case, names: Collection[str], widening: float, partners: Mapping[str, str] | None = None
) -> Case:
    r"""The case with wide priors and bounds of some nuisances.

    The partner of one may change as much as that one, :math:`\sqrt{s_p^2 + w^2 s^2}`. A damper that could change more
    than its spring would stand for a stiff spring, with twenty times its damping.

    Parameters
    ----------
    case : Case
    names : collection of str
    widening : float
        Factor w on standard deviations and bounds.
    partners : mapping or None
        Nuisance -> its partner.

    Returns
    -------
    Case
    """
    partners, wide = partners or {}, copy(case)
    changed = sorted((n for n in case.nuisances if n.name in names and n.name in partners), key=lambda n: n.sd)
    sds = {partners[n.name]: widening * n.sd for n in changed}  # of two with one partner, the wider
    factors = {n.name: float(np.hypot(n.sd, sds[n.name])) / n.sd for n in case.nuisances if n.name in sds}
    factors |= dict.fromkeys(names, widening)
    wide.nuisances = tuple(_with_wide_prior(n, factors[n.name]) if n.name in factors else n for n in case.nuisances)
    return wide


def _with_wide_prior(nuisance: Nuisance, widening: float) -> Nuisance:
    low, high = (nuisance.mean + widening * (bound - nuisance.mean) for bound in nuisance.bounds)
    return replace(nuisance, sd=widening * nuisance.sd, bounds=(low, high))


def evidence_of_large_values(
    case: Case,
    fit: Fit,
    names: Collection[str],
    widening: float,
    large: Collection[str] = (),
    partners: Mapping[str, str] | None = None,
) -> dict[str, float]:
    r"""Evidence that a single value has a wide prior, if the model were linear about the fit.

    Of the data alone the value is :math:`N(\mu, v)`, all others integrated out. With its prior :math:`N(m, s^2)` and a
    wide one of :math:`w s`

    .. math:: g = \ln N(\mu; m, v + w^2 s^2) - \ln N(\mu; m, v + s^2)

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    names : collection of str
    widening : float
        w.
    large : collection of str
        Those that have wide priors already. They have no entry.
    partners : mapping or None
        As ``with_wide_priors``.

    Returns
    -------
    dict
        Name -> evidence [nats].
    """
    wide = with_wide_priors(case, large, widening, partners)
    precision, score = _posterior(wide, fit)
    covariance = np.linalg.inv(precision)
    mean = covariance @ score
    gains = {}
    for k, n in enumerate(wide.nuisances):
        information = 1.0 / covariance[k, k] - n.sd**-2
        if n.name not in names or n.name in large or information * n.sd**2 < THRESHOLDS.min_large_information:
            continue
        v = 1.0 / information
        distance = v * mean[k] / covariance[k, k] + (1.0 - v / covariance[k, k]) * n.mean - n.mean
        near, far = v + n.sd**2, v + (widening * n.sd) ** 2
        gains[n.name] = float(0.5 * (distance**2 / near - distance**2 / far) - 0.5 * np.log(far / near))
    return gains


def evidence_far_from_fit(
    case: Case,
    fit: Fit,
    names: Collection[str],
    widening: float,
    large: Collection[str] = (),
    partners: Mapping[str, str] | None = None,
) -> dict[str, tuple[float, float]]:
    r"""Evidence of hammer tests that a value has a wide prior, at the values where fits with a large value start.

    A stiff pad changes receptances little at first, and much where its sleeper moves with the rail. So the value itself
    is not linear here: the data are predicted with it, and all others follow linearly. With residual r, derivatives J
    and precision P of the prior, all about the fit with value k moved, the cost that remains is

    .. math:: c_k = r^T W r + (\eta - m)^T P (\eta - m) - b^T A^{-1} b + \frac{(A^{-1} b)_k^2}{(A^{-1})_{kk}}, \quad
              A = J^T W J + P, \quad b = J^T W r - P (\eta - m)

    The evidence is half of what this cost, with the wide prior for k, is below that of the fit, less
    :math:`\ln w`, the price of the wide prior where the data determine the value with both.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    names : collection of str
    widening : float
        w.
    large : collection of str
        Those that have wide priors already. They have no entry.
    partners : mapping or None
        As ``with_wide_priors``.

    Returns
    -------
    dict
        Name -> evidence [nats] and the value that has it; {} without hammer tests. A value at which the simulation
        fails has none.
    """
    wide = with_wide_priors(case, large, widening, partners)
    chosen = [i for i, o in enumerate(case.observations) if case.is_hammer_test(o)]
    if not chosen:
        return {}
    problem = JointProblem(wide, (), [case.observations[i] for i in chosen])
    at_fit = np.array([fit.values[n.name] for n in wide.nuisances])
    noise = dict.fromkeys((o.data_type for o in problem.observations), 1.0)  # as in ``_posterior``
    jacobian = [np.asarray(fit.jacobian[i], dtype=float) for i in chosen]
    rows, residual = problem.stack(jacobian, problem.residuals([fit.predictions[i] for i in chosen]), noise)
    covariance = np.linalg.inv(rows.T @ rows + np.diag(problem.sd**-2))

    def cost(residual: np.ndarray, theta: np.ndarray, sd: np.ndarray, fixed: int | None) -> float:
        deviation = (theta - problem.mean) / sd
        b = rows.T @ residual - deviation / sd
        shift = covariance @ b
        gain = b @ shift if fixed is None else b @ shift - shift[fixed] ** 2 / covariance[fixed, fixed]
        return float(residual @ residual + deviation @ deviation - gain)

    nearby, gains = cost(residual, at_fit, problem.sd, None), dict[str, tuple[float, float]]()
    for k, nuisance in enumerate(wide.nuisances):
        if nuisance.name not in names or nuisance.name in large:
            continue
        far = _with_wide_prior(nuisance, widening)
        sd = np.where(np.arange(at_fit.size) == k, far.sd, problem.sd)
        for size in (s * sign * far.sd for s in THRESHOLDS.large_start_sds for sign in (1.0, -1.0)):
            theta = at_fit.copy()
            theta[k] = np.clip(far.mean + size, *far.bounds)
            if (predictions := problem.predict_or_none(theta)) is None:
                continue
            moved = problem.stack(jacobian, problem.residuals(predictions), noise)[1]
            gain = 0.5 * (nearby - cost(moved, theta, sd, k)) - float(np.log(widening))
            gains[nuisance.name] = max((gain, float(theta[k])), gains.get(nuisance.name, (-np.inf, 0.0)))
    return gains


def _evidence_near_and_far(
    case: Case,
    fit: Fit,
    names: Collection[str],
    widening: float,
    large: Collection[str],
    partners: Mapping[str, str],
) -> tuple[dict[str, float], dict[str, float]]:
    """Evidence of each value [nats], and the large value of those that have more of it there than near the fit."""
    near = evidence_of_large_values(case, fit, names, widening, large, partners)
    far = evidence_far_from_fit(case, fit, names, widening, large, partners)
    values = {name: value for name, (gain, value) in far.items() if gain > near.get(name, -np.inf)}
    return {**near, **{name: far[name][0] for name in values}}, values


def _posterior(case: Case, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Precision (n, n) of all nuisances and its product with their mean, with the model linear about the fit.

    The noise has its own scale and not that of the fit, which a large value that is missing has raised.
    """
    values = np.array([fit.values[n.name] for n in case.nuisances])
    mean, sd = (np.array([getattr(n, field) for n in case.nuisances]) for field in ("mean", "sd"))
    precision, score = np.diag(sd**-2), mean / sd**2
    for o, jacobian, white in zip(case.observations, fit.jacobian, fit.white):
        rows = np.asarray(jacobian, dtype=float)
        precision += o.effective * rows.T @ rows
        score += o.effective * rows.T @ (white + rows @ values)
    return precision, score


def _fit_with(
    search: Search,
    fit: Fit,
    large: tuple[str, ...],
    widening: float,
    partners: Mapping[str, str],
    far_value: float | None,
) -> Fit:
    """Fit with wide priors of these values: the best of several starts.

    One is on the way to the maximum of the linear model. In the others the last value is large, and the rest is where
    fits of the case start: the fit without it has moved them to hide it, and may be at another minimum. These end where
    their steps do not lead below the best one so far. The sign of the large value is that of ``far_value``, None: that
    of the linear model.
    """
    wide = replace(search, case=with_wide_priors(search.case, large, widening, partners))
    solution = dict(zip((n.name for n in wide.case.nuisances), np.linalg.solve(*_posterior(wide.case, fit))))
    costs: list[tuple[float, dict[str, float]]] = []
    for share in (*THRESHOLDS.size_factors, 0.0):
        at = {
            n.name: float(np.clip(fit.values[n.name] + share * (solution[n.name] - fit.values[n.name]), *n.bounds))
            for n in wide.case.nuisances
        }
        try:
            costs.append((cost_at(wide.case, (), np.zeros(0), at), at))
        except SimulationError:
            continue
    starts = [min(costs, key=itemgetter(0))[1]] if costs else []
    (value,) = (n for n in wide.case.nuisances if n.name == large[-1])
    kept = {name: fit.values[name] for name in large[:-1]}
    for sds in THRESHOLDS.large_start_sds:
        size = np.copysign(sds * value.sd, (solution[value.name] if far_value is None else far_value) - value.mean)
        starts.append({**kept, value.name: float(np.clip(value.mean + size, *value.bounds))})
    fits: list[Fit] = []
    for at in starts:
        sought_cost = min((f.cost for f in fits), default=np.inf)
        try:
            fits.append(wide.fit((), np.zeros(0), at, sought_cost=sought_cost))
        except SimulationError:
            continue
    if not fits:
        raise SimulationError(f"no fit with a large value of {large[-1]}: the simulation fails at every start.")
    return wide.converge(max(fits, key=lambda f: f.evidence))
