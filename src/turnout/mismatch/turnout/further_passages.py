"""Passages that a fit has not read, as information about it: one linear model each, instead of hundreds of simulations.

Only few passages are fitted, since each is simulated at every step. The others are linear about the fit.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout.priors import PASSAGE

if TYPE_CHECKING:
    from collections.abc import Collection

    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.campaign import CampaignInput
    from turnout.mismatch.turnout.case import TrackCase


def names_beyond(campaign: CampaignInput, max_axles: int) -> tuple[str, ...]:
    """Names of the passages that are not fitted where fits read ``max_axles`` axles: the longest trains.

    Parameters
    ----------
    campaign : CampaignInput
    max_axles : int
        At least one passage is fitted, however many axles it has.

    Returns
    -------
    tuple of str
    """
    by_length = sorted(campaign.passages, key=lambda p: (len(p.vehicle.wheels), p.name))
    total = np.cumsum([len(p.vehicle.wheels) for p in by_length])
    return tuple(p.name for p, n in zip(by_length[1:], total[1:]) if n > max_axles)


def with_reserved_passages(case: TrackCase, fit: Fit, names: Collection[str] | None = None) -> tuple[TrackCase, Fit]:
    r"""The case and its fit with the reserved passages among the observations, linear about the fit.

    Time, speed and load of each passage are fitted to it, all else stays as the fit has it. The noise scale of
    passages is that of all of them, at the maximum of the linear model:

    .. math:: x = \operatorname{argmin} \sum_r w_r |e_r - J_r (x - x_0)|^2 + |(x - m) / s|^2

    Parameters
    ----------
    case : TrackCase
        The case that was fitted.
    fit : Fit
        Without effects, with its Jacobian.
    names : collection of str or None
        Those passages alone: the others stay reserved. None: all.

    Returns
    -------
    case : TrackCase
    fit : Fit
        With values, derivatives, whitened residuals and noise scale of all observations. The other fields are those of
        the fit.
    """
    values = dict(fit.values)
    added: list[tuple[Observation, np.ndarray, np.ndarray]] = []
    for o in case.reserved:
        if o.name not in case.aligned_passages or (names is not None and o.name not in names):
            continue
        try:
            own_values, rows, residual = _linear_model(case, values, o)
        except SimulationError:  # a passage that cannot be simulated says nothing
            continue
        values |= own_values
        added.append((o, rows, residual))
    if not added:
        return case, fit
    observations, jacobian, white = zip(*added)
    extended = copy(case)
    extended.observations = (*case.observations, *observations)
    extended.reserved = tuple(o for o in case.reserved if names is not None and o.name not in names)
    fit = replace(fit, values=values, jacobian=[*fit.jacobian, *jacobian], white=[*fit.white, *white])
    return extended, replace(fit, scale={**fit.scale, **noise_scales(extended, fit)})


def _linear_model(
    case: TrackCase, values: dict[str, float], observation: Observation
) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """Own values of a passage, its whitened derivatives by all nuisances, and its whitened residual."""
    own = [k for k, n in enumerate(case.nuisances) if n.owner == observation.name]
    nuisances = [case.nuisances[k] for k in own]
    at = {**values, **{n.name: n.mean for n in nuisances}}
    mean, sd = (np.array([getattr(n, field) for n in nuisances]) for field in ("mean", "sd"))
    (predicted,) = case.predict(at, (), [observation])
    (derivatives,) = case.nuisance_jacobian(at, (), [observation], [predicted])
    rows = np.asarray(observation.whiten(derivatives), dtype=np.float32)
    columns = np.asarray(rows[:, own], dtype=float)
    matrix = observation.effective * columns.T @ columns + np.diag(sd**-2)
    for _ in range(PASSAGE.own_steps):
        residual = observation.whiten(observation.data - predicted)
        current = np.array([at[n.name] for n in nuisances])
        gradient = observation.effective * columns.T @ residual - (current - mean) / sd**2
        moved = current + np.linalg.solve(matrix, gradient)
        at |= {n.name: float(np.clip(v, *n.bounds)) for n, v in zip(nuisances, moved)}
        (predicted,) = case.predict(at, (), [observation])
    residual = np.asarray(observation.whiten(observation.data - predicted), dtype=float)
    return {n.name: at[n.name] for n in nuisances}, rows, residual


def noise_scales(case: Case, fit: Fit) -> dict[str, float]:
    """Noise scale by data type at the maximum of the linear model, at least 1.

    Parameters
    ----------
    case : Case
    fit : Fit
        With derivatives and whitened residuals of all observations.

    Returns
    -------
    dict
        Data type -> scale.
    """
    values = np.array([fit.values[n.name] for n in case.nuisances])
    mean, sd = (np.array([getattr(n, field) for n in case.nuisances]) for field in ("mean", "sd"))
    precision, score = np.diag(sd**-2), (mean - values) / sd**2
    for o, rows, white in zip(case.observations, fit.jacobian, fit.white):
        weighted = o.effective * np.asarray(rows, dtype=float).T
        precision, score = precision + weighted @ rows, score + weighted @ white
    step = np.linalg.solve(precision, score)
    total: dict[str, float] = {}
    count: dict[str, float] = {}
    for o, rows, white in zip(case.observations, fit.jacobian, fit.white):
        total[o.data_type] = total.get(o.data_type, 0.0) + o.effective * float(np.sum((white - rows @ step) ** 2))
        count[o.data_type] = count.get(o.data_type, 0.0) + o.n_effective
    return {data_type: max(1.0, total[data_type] / count[data_type]) for data_type in total}
