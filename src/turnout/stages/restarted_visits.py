"""Visits whose fit ended at a wrong maximum, fitted again from the values that other visits predict.

A visit is fitted from the values of the file, and where something has changed much, such a fit may end at a wrong
maximum. The turnout itself is known better from its other visits. Of the two fits the one with more evidence counts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, MutableMapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import Event, StateParameter, VisitInformation, estimate_history
from turnout.mismatch.turnout.calibration import channel_levels, visit_groups
from turnout.stages.agreeing_visits import FittedGroup, key_of, packed_groups, unpacked_groups
from turnout.stages.visits_unlike_others import MIN_OTHER_VISITS

if TYPE_CHECKING:
    from turnout.mismatch.calibrated.belief import Belief
    from turnout.mismatch.calibrated.history import Step


def restarted_visits(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    fitted_groups: Callable[[str], Sequence[FittedGroup]],
    fit_from: Callable[[str, Belief], Sequence[FittedGroup]],
    store: MutableMapping[str, Mapping[str, Any]],
    unlike: Collection[str] = (),
) -> tuple[list[VisitInformation], dict[tuple[str, str], Mapping[str, float]]]:
    """The visits, with the fits that begin where other visits predict them to be where these are better.

    Fitted again are the visits ``unlike`` the others, and those that differ from all before. They begin at the values
    of the visits before; the first of those unlike the others have too few, and begin at the values of the next.

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
        Key of a visit and the belief that it begins from -> "groups" and "levels" of the better fits, empty where there
        is none.
    unlike : collection of str
        Visits whose fits leave more of a channel than those of the others.

    Returns
    -------
    visits : list of VisitInformation
        In the order of time.
    levels : dict
        Visit and sections of each better fit -> its ``channel_levels``.
    """
    current = sorted(visits, key=lambda v: (v.time, v.visit))
    levels: dict[tuple[str, str], Mapping[str, float]] = {}

    def steps(chosen: Sequence[VisitInformation]) -> Sequence[Step]:
        return estimate_history(parameters, chosen, events, repeats_between_visits=False, accepted=None).steps

    def use_better_fit(k: int, belief: Belief) -> None:
        visit, key = current[k].visit, key_of(current[k], belief)
        if (new_fit := store.get(key)) is None:
            again = partial(fit_from, visit, belief)
            store[key] = new_fit = _better_fits(fitted_groups(visit), again)
        replaced = {g.group: g for g in unpacked_groups(new_fit["groups"])}
        current[k] = replace(current[k], groups=tuple(replaced.get(g.group, g) for g in current[k].groups))
        levels.update({(visit, sections): by_channel for sections, by_channel in new_fit["levels"].items()})

    for k, visit in enumerate(current):
        reference = current[:k] if k >= MIN_OTHER_VISITS else [*current[:k], *current[k + 1 :]][:MIN_OTHER_VISITS]
        if visit.visit in unlike and reference:
            use_better_fit(k, steps(reference)[-1].belief)
    history = steps(current)
    for k in range(1, len(current)):
        if current[k].visit not in unlike and not history[k].innovation.is_expected:
            use_better_fit(k, history[k].predicted)
            history = steps(current)  # what later visits are compared with
    return current, levels


def _better_fits(fitted: Sequence[FittedGroup], fit_again: Callable[[], Sequence[FittedGroup]]) -> dict[str, Any]:
    """Groups of sections whose second fit has more evidence than the first: information, and levels by sections."""
    evidence = {g.sections: g.fit.evidence for g in fitted}
    try:
        again = fit_again()
    except (SimulationError, np.linalg.LinAlgError):
        again = ()
    better = [g for g in again if g.fit.evidence > evidence.get(g.sections, np.inf)]
    information = [i for g in better for i in visit_groups(g.case, g.fit, g.sections, g.route)]
    levels = {g.sections: channel_levels(g.case, g.fit) for g in better}
    return {"groups": packed_groups(information), "levels": levels}
