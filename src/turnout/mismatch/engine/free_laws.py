"""Test of a name by free laws: what stiffness and damping of any form still explain of its residual.

The test compares two fits on held-out recordings. It does not depend on the error that the user tolerates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import weighted_mean_square
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.reserved_data import predict_reserved
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.search import Search


def free_law_share(search: Search, base: Fit, fit: Fit) -> float:
    r"""Share of the gain on held-out recordings that the names miss, and free laws beside them reach.

    .. math:: \frac{\overline{r^2}_{names} - \overline{r^2}_{names + free}}
                   {\overline{r^2}_{base} - \overline{r^2}_{names + free}}

    Several laws of one component are parts of a free law themselves. The first of them alone is then the name.

    All models are fitted until nothing is gained at all: fits that stop at the tolerated error differ by less than
    it. Without held-out recordings the fitted ones are compared.

    Parameters
    ----------
    search : Search
    base : Fit
        Without effects.
    fit : Fit
        Of the named effects.

    Returns
    -------
    float
        0 if the case has no free laws, or if they explain nothing; 1 if the names alone explain nothing.
    """
    case = search.case
    if not case.free_laws:
        return 0.0
    first = _first_of_component(fit)
    laws = tuple(c for c in case.free_laws if c.family not in {named.family for named in first})
    if not laws or not first:
        return 0.0
    observations = case.reserved or case.observations
    squares = []
    first_psi = np.concatenate([fit.psi[fit.part(c)] for c in first])
    for start, candidates, psi in (
        (base, (), base.psi[:0]),
        (fit, first, first_psi),
        (fit, (*first, *laws), np.concatenate([first_psi, *(c.neutral for c in laws)])),
    ):
        try:
            refit = fit_jointly(
                case, candidates, psi, start.values, iterations=THRESHOLDS.max_hammer_steps,
                min_gain=THRESHOLDS.least_gain,
            )  # fmt: skip
            squares.append(weighted_mean_square(observations, predict_reserved(case, refit, observations)))
        except SimulationError:
            return 0.0
    without, named, free = squares
    if free >= named:
        return 0.0
    return min(1.0, (named - free) / (without - free)) if without > free else 1.0


def _first_of_component(fit: Fit) -> tuple[Candidate, ...]:
    """The candidates of a fit, of each component the first alone."""
    first: dict[Any, Candidate] = {}
    for candidate in fit.candidates:
        first.setdefault(candidate.part if candidate.effect.component else candidate.key, candidate)
    return tuple(first.values())
