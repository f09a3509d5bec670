"""Recorded work on a turnout, as what it makes uncertain again in the calibrated model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from turnout.constants import DAYS_PER_YEAR
from turnout.mismatch.calibrated import Event, StateParameter, VisitInformation, change_candidates
from turnout.mismatch.turnout.calibration import dip_directions
from turnout.stages.accepted_changes import change_events, effect_events
from turnout.stages.work_days import further_resonances, opened_groups, recorded_events

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.stages.accepted_changes import AcceptedChange
    from turnout.stages.accepted_effects import AcceptedEffect

# Parameters that all supports share, which work on the whole turnout makes uncertain, too
BALLAST, PADS = ("ballast_stiffness", "ballast_damping"), ("pad_stiffness", "pad_damping")
OPENED_COMMON = {
    "tamping": BALLAST,
    "ballast_cleaning": BALLAST,
    "pad_exchange": PADS,
    "sleeper_change": ("sleeper_mass", *BALLAST, *PADS),
}
COMMON_OF_RESONANCE = {"ballast": BALLAST, "railpad": PADS}
EVENT_REACH = 6.0  # m from a section that work there may touch


def events_of(
    turnout: TurnoutConfig,
    parameters: Sequence[StateParameter],
    changes: Sequence[AcceptedChange] = (),
    visits_used: Sequence[VisitInformation] = (),
    effects: Sequence[AcceptedEffect] = (),
) -> list[Event]:
    """Recorded work on the turnout, as parameters that it makes as uncertain as the file, and accepted changes.

    Work of one day is one event, whether it is entered once or section by section.

    Parameters
    ----------
    turnout : TurnoutConfig
    parameters : sequence of StateParameter
    changes : sequence of AcceptedChange
        Of its track file.
    visits_used : sequence of VisitInformation
        Visits between which accepted changes lie.
    effects : sequence of AcceptedEffect
        Those of its track file.

    Returns
    -------
    list of Event
        Work in the order of time, then accepted changes, the work that may have ended these, and accepted effects.
    """
    positions = {s.label: s.position for s in turnout.sections}
    by_day: dict[int, dict[str, float]] = {}
    for event in recorded_events(turnout):
        groups = opened_groups(event)
        if not groups:
            continue
        if event.section is not None and event.section not in positions:  # misspelt, as ``turnout check`` reports
            continue
        at = None if event.section is None else positions[event.section]
        opened = by_day.setdefault(event.first_day_after.toordinal(), {})
        opened |= {p.name: p.sd for p in parameters if p.group in groups and (at is None or _is_near(p, at))}
        if at is None:
            common = {
                *OPENED_COMMON.get(event.kind, ()),
                *(g for r in further_resonances(event) for g in COMMON_OF_RESONANCE[r]),
            }
            opened |= {p.name: p.sd for p in parameters if p.name.split(" ")[-1] in common}
    events = [Event(day / DAYS_PER_YEAR, opened) for day, opened in sorted(by_day.items())]
    candidates = change_candidates(parameters, dip_directions(parameters)) if changes else []
    accepted = change_events(changes, parameters, candidates, visits_used)
    of_effects = effect_events(effects, parameters, visits_used)
    return [*events, *accepted, *_repairs(events, accepted), *of_effects]


def _is_near(parameter: StateParameter, at: float) -> bool:
    """Whether work on the section at a position [m] may touch what a parameter describes, or this has no position."""
    start = parameter.position if parameter.start is None else parameter.start
    end = parameter.position if parameter.end is None else parameter.end
    return start is None or end is None or start - EVENT_REACH <= at <= end + EVENT_REACH


def _repairs(works: Sequence[Event], accepted: Sequence[Event]) -> list[Event]:
    """Process noise of later work on what an accepted change has changed: the work may have ended it."""
    repairs = []
    for work in works:
        before = (e for e in accepted if e.time < work.time and work.opened.keys() & e.direction.keys())
        shapes = {tuple(sorted(e.direction.items())): e for e in before}  # one of each, however often it was accepted
        repairs += [replace(e, time=work.time) for e in shapes.values()]
    return repairs
