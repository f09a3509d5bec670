"""Visits that differ from the earlier ones, fitted again from the values that these predict.

A visit is fitted from the values of the file, and where something has changed much, such a fit may end at a wrong
maximum. The turnout itself is known better from its earlier visits. Of the two fits the one with more evidence counts.
"""

from __future__ import annotations

from collections.abc import Callable, MutableMapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import Event, GroupInformation, StateParameter, VisitInformation, estimate_history
from turnout.mismatch.turnout.calibration import visit_groups
from turnout.stages.agreeing_visits import FittedGroup, key_of

if TYPE_CHECKING:
    from turnout.mismatch.calibrated.belief import Belief
    from turnout.mismatch.calibrated.history import Step


def restarted_visits(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    fitted_groups: Callable[[str], Sequence[FittedGroup]],
    fit_from: Callable[[str, Belief], Sequence[FittedGroup]],
    store: MutableMapping[str, tuple[GroupInformation, ...]],
) -> list[VisitInformation]:
    """The visits, with the fits that begin where the earlier visits predict them to be where these are better.

    Only visits that differ from all before and whose fits leave more than noise are fitted again.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
    events : sequence of Event
    fitted_groups : callable
        Visit -> its fits, from the values of the file.
    fit_from : callable
        Visit and belief -> its fits, from the means of the belief, with their Jacobians.
    store : mutable mapping
        Key of a visit and the belief before it -> information of the better fits, () where there is none.

    Returns
    -------
    list of VisitInformation
        In the order of time.
    """
    current = sorted(visits, key=lambda v: (v.time, v.visit))

    def steps() -> Sequence[Step]:
        return estimate_history(parameters, current, events, repeats_between_visits=False, accepted=None).steps

    history = steps()
    for k in range(1, len(current)):
        step = history[k]
        if step.innovation.is_expected:
            continue
        key = key_of(current[k], step.predicted)
        information = store.get(key)
        if information is None:
            information = _better_information(fitted_groups(step.visit), partial(fit_from, step.visit, step.predicted))
            store[key] = information
        if information:
            replaced = {g.group: g for g in information}
            current[k] = replace(current[k], groups=tuple(replaced.get(g.group, g) for g in current[k].groups))
            history = steps()  # what later visits are compared with
    return current


def _better_information(
    fitted: Sequence[FittedGroup], fit_again: Callable[[], Sequence[FittedGroup]]
) -> tuple[GroupInformation, ...]:
    """Information of the groups of sections whose second fit has more evidence than the first."""
    evidence = {g.sections: g.fit.evidence for g in fitted if max(g.fit.scale.values()) > 1.0}
    if not evidence:
        return ()
    try:
        again = fit_again()
    except (SimulationError, np.linalg.LinAlgError):
        return ()
    better = [g for g in again if g.fit.evidence > evidence.get(g.sections, np.inf)]
    return tuple(i for g in better for i in visit_groups(g.case, g.fit, g.sections, g.route))
