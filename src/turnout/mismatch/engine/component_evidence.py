r"""Evidence that the value of a single component is unusual, whatever the cause.

A component is one of several of a kind, such as one railpad. An effect that no candidate describes shows in its value:

- *changes*: the value differs between passages and hammer tests. What depends on load, motion or preload does so,
  because it acts on trains and impacts differently;
- *deviations*: the value differs from those of the other components of its kind by more than these differ among
  themselves. The base fit has moved the value to explain the effect, so the residual looks intact.

Both need no simulation. Their evidence follows from the derivatives of the fit.
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
from turnout.mismatch.engine.single_source import impact_repetitions
from turnout.mismatch.engine.space_evidence import SpaceEvidence
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance

    Gains = Sequence[tuple[Nuisance, float]]


def evidence_of_any_component(gains: Gains) -> float:
    """Evidence that one component is unusual, whichever it is.

    All components are equally probable, so it is the mean of their likelihood ratios.

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
    """Evidence for each position that an unusual component is there.

    Parameters
    ----------
    gains : sequence of (Nuisance, float)
        Gain of each component, of ``local_changes`` or ``local_deviations``. [nats]

    Returns
    -------
    list of SpaceEvidence
        The largest first. Components without a known position or lock are left out.
    """
    by_level: dict[tuple[str, Any], list[float]] = {}
    for nuisance, nats in gains:
        if nuisance.at is not None:
            by_level.setdefault(nuisance.at, []).append(nats)
    n = sum(map(len, by_level.values()))
    evidence = [SpaceEvidence(*at, float(np.logaddexp.reduce(g) - np.log(n))) for at, g in by_level.items()]
    return sorted(evidence, key=lambda e: -e.nats)


def local_changes(case: Case, fit: Fit) -> list[tuple[Nuisance, float]]:
    r"""Gain of each component by a value of its own in the passages.

    The hammer tests keep the shared value. The gain of a change is

    .. math:: \frac{(c^T C^{-1} y)^2}{2 (1 + i)} - \frac12 \ln(1 + i), \quad i = c^T C^{-1} c

    nats. c is the derivative of the passages by the value, in units of a wide prior of the change. C is the
    covariance of errors and nuisances.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    list of (Nuisance, float)
        [nats]; [] without derivatives, without components of one kind, or with one kind of recordings alone.
    """
    numbers, gram, slopes = _changes_under_trains(case, fit)
    information = np.diag(gram)
    gains = 0.5 * slopes**2 / (1.0 + information) - 0.5 * np.log1p(information)
    return [(case.nuisances[k], float(nats)) for k, nats in zip(numbers, gains)]


def evidence_of_a_changed_stretch(case: Case, fit: Fit) -> float:
    """Evidence that all components of neighbouring positions have values of their own in the passages.

    The prior is that of ``local_changes``, and all stretches are equally probable. One component imitates a cause that
    acts on several in part alone.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    float
        Of the stretch with the most, of up to ``THRESHOLDS.max_changed_positions`` positions. [nats]; 0 without any.
    """
    numbers, gram, slopes = _changes_under_trains(case, fit)
    levels = [case.nuisances[k].at for k in numbers]
    positions = [at[1] if at is not None and isinstance(at[1], float) else None for at in levels]
    ordered = sorted({x for x in positions if x is not None})
    gains = []
    for first in range(len(ordered)):
        for n in range(1, min(THRESHOLDS.max_changed_positions, len(ordered) - first) + 1):
            chosen = [i for i, x in enumerate(positions) if x in ordered[first : first + n]]
            covariance = np.eye(len(chosen)) + gram[np.ix_(chosen, chosen)]
            explained = slopes[chosen] @ np.linalg.solve(covariance, slopes[chosen])
            gains.append(0.5 * (explained - np.linalg.slogdet(covariance)[1]))
    return float(max(gains) - np.log(len(gains))) if gains else 0.0


def _changes_under_trains(case: Case, fit: Fit) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Numbers (k,) of components, products (k, k) of the columns of their changes and (k,) of these with the residual.

    Empty without derivatives, without components of one kind, or with one kind of recordings alone.
    """
    numbers = _components(case)
    no_change: tuple[list[int], np.ndarray, np.ndarray] = [], np.zeros((0, 0)), np.zeros(0)
    if not numbers or not fit.jacobian:
        return no_change
    is_passage = np.concatenate([np.full(o.data.size, not case.is_hammer_test(o)) for o in case.observations])
    if np.all(is_passage) or not np.any(is_passage):
        return no_change
    projector = Projector(case, fit)
    columns = projector.scaled[:, numbers] * (THRESHOLDS.max_ordinary_spreads * is_passage[:, None])
    across = projector.scaled.T @ columns
    gram = columns.T @ columns - across.T @ (projector.normal @ across)
    return numbers, gram, projector.right @ columns - projector.shift @ across


def local_deviations(case: Case, fit: Fit) -> list[tuple[Nuisance, float]]:
    """Gain of each component by a value beyond the scatter of the other components of its kind.

    The scatter is that of the prior, or ``spread_of_others`` without outliers where that is larger. The prior of a
    value beyond it is as wide as that of a change in ``local_changes`` (see ``evidence_of_large_values``). Hammer tests
    that repeat impacts at one position count as one, since the model errs alike in them.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.

    Returns
    -------
    list of (Nuisance, float)
        [nats]; [] without derivatives or components of one kind. 0 where the data do not determine the value.
    """
    components = [case.nuisances[k] for k in _components(case)]
    if not components or not fit.jacobian:
        return []
    spreads = {n.name: max(n.sd, spread_of_others(case, fit, n, without_outliers=True) or 0.0) for n in components}
    scattered = copy(case)
    scattered.nuisances = tuple(replace(n, sd=spreads.get(n.name, n.sd)) for n in case.nuisances)
    repetitions = impact_repetitions(case.hammer_positions())
    scattered.observations = tuple(
        replace(o, effective=o.effective / repetitions.get(o.condition, 1)) for o in case.observations
    )
    gains = evidence_of_large_values(scattered, fit, spreads, THRESHOLDS.max_ordinary_spreads)
    return [(n, gains.get(n.name, 0.0)) for n in components]


def _components(case: Case) -> list[int]:
    """Numbers of the nuisances that belong to one component of several."""
    return [k for k, n in enumerate(case.nuisances) if n.index is not None]
