r"""Generic laws of single components, of any cause: what no candidate describes shows as another value of a component.

Two laws need no simulation, as the derivatives of the fit tell their evidence:

- *changes*: whatever depends on load, motion or preload acts on trains and not on impacts, or differently. To first
  order it is then another value of a component in passages than in hammer tests;
- *deviations*: a component differs from those that are alike by more than they differ among themselves. The base fit
  has moved it and its neighbours to explain that, so the residual is as small as that of intact recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.component_spread import spread_of_others
from turnout.mismatch.engine.large_values import evidence_of_large_values
from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.engine.space_evidence import SpaceEvidence
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance

    Gains = Sequence[tuple[Nuisance, float]]


def evidence_of_any(gains: Gains) -> float:
    """Evidence for one component, whichever it is.

    All are equally probable: it is the mean of their likelihood ratios.

    Parameters
    ----------
    gains : sequence of (Nuisance, float)
        Gain of each component, of ``local_changes`` or ``local_deviations``. [nats]

    Returns
    -------
    float
        [nats]; 0 without components.
    """
    return float(np.logaddexp.reduce([nats for _, nats in gains]) - np.log(len(gains))) if gains else 0.0


def evidence_by_position(gains: Gains) -> list[SpaceEvidence]:
    """Evidence for each position that a component there is the one.

    Parameters
    ----------
    gains : sequence of (Nuisance, float)
        Gain of each component, of ``local_changes`` or ``local_deviations``. [nats]

    Returns
    -------
    list of SpaceEvidence
        The largest first. Components of which it is not known what they are fixed to are left out.
    """
    by_level: dict[tuple[str, Any], list[float]] = {}
    for nuisance, nats in gains:
        if nuisance.at is not None:
            by_level.setdefault(nuisance.at, []).append(nats)
    n = sum(map(len, by_level.values()))
    evidence = [SpaceEvidence(*at, float(np.logaddexp.reduce(g) - np.log(n))) for at, g in by_level.items()]
    return sorted(evidence, key=lambda e: -e.nats)


def local_changes(case: Case, fit: Fit) -> list[tuple[Nuisance, float]]:
    r"""Components, and the gain of each by another value in expensive recordings than in cheap ones.

    With c the column of a value on the expensive recordings alone, in units of a wide prior of the change, C the
    covariance of errors and nuisances, and :math:`i = c^T C^{-1} c`, a change gains

    .. math:: \frac{(c^T C^{-1} y)^2}{2 (1 + i)} - \frac12 \ln(1 + i)

    nats.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    list of (Nuisance, float)
        [nats]; [] without derivatives, alike components, or one of the two kinds of recordings.
    """
    numbers = _components(case)
    if not numbers or not fit.jacobian:
        return []
    is_expensive = np.concatenate([np.full(o.data.size, not case.is_cheap(o)) for o in case.observations])
    if np.all(is_expensive) or not np.any(is_expensive):
        return []
    projector = Projector(case, fit)
    columns = projector.scaled[:, numbers] * (THRESHOLDS.max_ordinary_spreads * is_expensive[:, None])
    across = projector.scaled.T @ columns
    information = np.sum(columns**2, axis=0) - np.sum(across * (projector.normal @ across), axis=0)
    slopes = projector.right @ columns - projector.shift @ across
    gains = 0.5 * slopes**2 / (1.0 + information) - 0.5 * np.log1p(information)
    return [(case.nuisances[k], float(nats)) for k, nats in zip(numbers, gains)]


def local_deviations(case: Case, fit: Fit) -> list[tuple[Nuisance, float]]:
    """Components, and the gain of each by a value beyond the ordinary scatter of those that are alike.

    The scatter is that of the prior, or ``spread_of_others`` without outliers where that is larger. A value beyond it
    has a prior as wide as changes have in ``local_changes`` (``evidence_of_large_values``).

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    list of (Nuisance, float)
        [nats]; [] without derivatives or alike components. 0 for components of which the data say nothing.
    """
    components = [case.nuisances[k] for k in _components(case)]
    if not components or not fit.jacobian:
        return []
    spreads = {n.name: max(n.sd, spread_of_others(case, fit, n, without_outliers=True) or 0.0) for n in components}
    scattered = copy(case)
    scattered.nuisances = tuple(replace(n, sd=spreads.get(n.name, n.sd)) for n in case.nuisances)
    gains = evidence_of_large_values(scattered, fit, spreads, THRESHOLDS.max_ordinary_spreads)
    return [(n, gains.get(n.name, 0.0)) for n in components]


def _components(case: Case) -> list[int]:
    """Numbers of the nuisances of single components that have their like."""
    return [k for k, n in enumerate(case.nuisances) if n.index is not None]
