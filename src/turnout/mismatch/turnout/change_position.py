r"""Where both tops of a switch are level: the number of its running surface that trains measure.

Wheels touch both rails for 5 to 20 cm. Depth, length and exponent of a top are extrapolated from there. So the depth of
a blade at its toe may come out as 1.5 times that of the file, although its top is right to 0.1 mm where wheels meet it.
The position :math:`x` of the change follows from all of them with its own error. With its gradient g, the covariance C
of the fit and the prior variances D, its variance is :math:`g^T C g`, and :math:`g^T D g` without the recordings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.cross_validation import jackknife_errors
from turnout.mismatch.turnout.surface_priors import SURFACE
from turnout.simulate.blade import transfer_position

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.predictions import Values
    from turnout.mismatch.turnout.running_surface import RunningSurface


def level_position(surface: RunningSurface, route: str, values: Values) -> float | None:
    """Where both tops of a route are level.

    Parameters
    ----------
    surface : RunningSurface
        With the numbers of the tops that may be off.
    route : str
        Route through the turnout.
    values : mapping of str to float
        Of these numbers and of the form of the tops, by name.

    Returns
    -------
    float or None
        [m]; None where no wheel changes to a blade.
    """
    blade = surface.turnout.track_of(route).blade
    return None if blade is None else transfer_position(surface.surfaces(route, values), blade)


def change_estimate(
    surface: RunningSurface, route: str, case: Case, fit: Fit, steps: np.ndarray
) -> dict[str, Any] | None:
    """The position of the change as a fit has it.

    Parameters
    ----------
    surface : RunningSurface
        With the numbers of the tops that may be off.
    route : str
        Route through the turnout.
    case : Case
        The case that was fitted.
    fit : Fit
        A fit of the case.
    steps : (m, n) array of float
        Change of all nuisances without one train each, see ``jackknife_steps``.

    Returns
    -------
    dict or None
        As ``SurfaceParameter.estimate``, with ``is_measured``: determined better than by the file, or in contradiction
        to it. None where no wheel changes to a blade, on this route or in this fit.
    """
    nuisances = {n.name: (k, n) for k, n in enumerate(case.nuisances) if n.name in surface.names}
    values = {name: fit.values[name] for name in nuisances}
    file_position = level_position(surface, route, dict.fromkeys(values, 0.0))
    position = level_position(surface, route, values)
    if position is None or file_position is None:
        return None
    gradient, columns, sds = [], [], []
    for name, (k, nuisance) in nuisances.items():
        beside = np.clip(values[name] + SURFACE.gradient_step * nuisance.sd * np.array([-1.0, 1.0]), *nuisance.bounds)
        ends = [level_position(surface, route, {**values, name: float(v)}) for v in beside]
        span = float(np.ptp(beside))
        gradient.append((ends[1] - ends[0]) / span if span and ends[0] is not None and ends[1] is not None else 0.0)
        columns.append(k)
        sds.append(nuisance.sd)
    g = np.array(gradient)
    prior_sd = float(np.linalg.norm(g * sds))
    own_error = float(np.sqrt(g @ fit.covariance[np.ix_(columns, columns)] @ g))
    between_trains = float(jackknife_errors((steps[:, columns] @ g)[:, None])[0])
    error = float(np.linalg.norm([own_error, between_trains, SURFACE.model_position_error]))
    deviation = abs(position - file_position)
    contradicts = deviation > SURFACE.min_deviation_ratio * max(prior_sd, error)
    return {
        "term": "running_surface_change_to_the_blade",
        "place": file_position,
        "name": "place",
        "value": position,
        "se": error,
        "unit": "m",
        "filed": file_position,
        "off": deviation / prior_sd,
        "is_measured": error < SURFACE.max_error_ratio * prior_sd or contradicts,
    }
