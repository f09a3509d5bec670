r"""Changes of single components that only expensive recordings show: a generic law at one place, of any cause.

Whatever depends on load, motion or preload acts on trains and not on impacts, or differently. To first order it is then
another value of a component in passages than in hammer tests. The derivatives of the fit tell its evidence.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.engine.space_evidence import SpaceEvidence
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance


def local_change_evidence(case: Case, fit: Fit) -> float:
    """Evidence that one component has another value in expensive recordings than in cheap ones.

    All components are equally probable: it is the mean of the likelihood ratios of their ``local_changes``.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    float
        [nats]; 0 without derivatives, alike components, or one of the two kinds of recordings.
    """
    gains = [nats for _, nats in local_changes(case, fit)]
    return float(np.logaddexp.reduce(gains) - np.log(len(gains))) if gains else 0.0


def changed_positions(case: Case, fit: Fit) -> list[SpaceEvidence]:
    """Evidence for each position that a component there has another value in expensive recordings than in cheap ones.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    list of SpaceEvidence
        The largest first. Components of which it is not known what they are fixed to are left out.
    """
    by_level: dict[tuple[str, Any], list[float]] = {}
    for nuisance, nats in local_changes(case, fit):
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
    numbers = [k for k, n in enumerate(case.nuisances) if n.index is not None]
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
