"""What differs from the owner's file: the effect of the first visit, else the clearest deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnout.mismatch.calibrated.belief import Innovation, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, change_sd
from turnout.mismatch.calibrated.change_size import error_of_stiff_spring
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import Deviation, deviations_from_file, evidence_from_first
from turnout.mismatch.calibrated.history import BEFORE_ALL, Event, History, estimate_history
from turnout.mismatch.calibrated.information import VisitInformation
from turnout.mismatch.calibrated.model_answer import (
    FILE,
    NAMES,
    LeadingEffect,
    ModelAnswer,
    free_shape,
    group_of,
    is_explained,
    least_size,
    name_of,
    position_of,
    with_rivals,
)
from turnout.mismatch.calibrated.repairs import agrees_with_file, newest_work, repair_events
from turnout.mismatch.calibrated.soft_ballast_or_gap import names_of_softer_ballast

INTOLERABLE = {"depth": CALIBRATION.worn_depth}


def file_answer(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    visit: str,
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
    surface: Sequence[ChangeEffect] = (),
) -> ModelAnswer:
    """What differs from the file: the effect of the first visit with the most evidence, else the clearest deviation.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
        Those that lie before any change.
    events : sequence of Event
    visit : str
        Visit after which the answer is given.
    candidates : sequence of ChangeEffect
        As ``change_candidates``.
    threshold : float
        Evidence that an effect needs. [nats]
    margin : float
        A rival of another name within it makes the answer "a or b". [nats]
    surface : sequence of ChangeEffect
        As ``surface_changes``: they locate what differs of the running surface and has no name.

    Returns
    -------
    ModelAnswer
        "unknown" where what differs has no name, or no name explains it.
    """
    by_name = {p.name: p for p in parameters}
    steps = [c for c in candidates if not c.grows]
    history = estimate_history(parameters, visits, events, accepted=None)
    penalty = float(np.log(max(len(steps), 1)))
    least = threshold + penalty
    gains, sizes, sds = evidence_from_first(history, steps)
    order = [
        k for k in np.argsort(-gains) if gains[k] > least - margin and abs(sizes[k]) >= least_size(steps[k], by_name)
    ]
    jump = history.steps[0].innovation if visits else None
    is_explained_by_first = bool(
        order and jump and _explains_first_visit(parameters, visits, events, steps[order[0]], jump)
    )
    for k in order[:1] if is_explained_by_first else order:  # beside it there may be one that was repaired
        if repair := _repair_of(steps[k], float(sizes[k]), parameters, visits, events, steps):
            return file_answer(parameters, visits, [*events, *repair], visit, candidates, threshold, margin, surface)
    if not order or jump is None or gains[order[0]] < least:
        deviation = _deviation_answer(parameters, visits, events, history, visit, steps, margin)
        return _at_dip(deviation, history, surface)
    first = order[0]
    size = float(sizes[first])
    sd = float(np.hypot(sds[first], error_of_stiff_spring(steps[first], size, by_name)))
    stated = LeadingEffect.of(steps[first], by_name, (size, sd), float(gains[first]) - penalty)
    if not is_explained_by_first:
        return _at_dip(stated.unknown(visit, FILE, by_name[jump.parameter]), history, surface)
    names = [stated.name]
    if stated.name == "local_ballast" and sizes[first] < 0.0:
        names = names_of_softer_ballast(parameters, visits, events, steps[first], stated.size, margin)
    rivals = [name_of(steps[k], by_name) for k in order if gains[k] > gains[first] - margin]
    return stated.answer(visit, FILE, with_rivals(names, stated, rivals))


def _repair_of(
    effect: ChangeEffect,
    size: float,
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
) -> list[Event]:
    """Noise in place of an effect of the first visit that recorded work has ended; [] where it lasts, or once there."""
    is_known = any(e.time == BEFORE_ALL and e.direction == effect.direction for e in events)
    work = _work_on(effect, visits, events)
    if is_known or work is None or not _is_repaired(effect, parameters, visits, events):
        return []
    return repair_events(free_shape(effect, parameters, candidates), size, [BEFORE_ALL, work])


def _work_on(effect: ChangeEffect, visits: Sequence[VisitInformation], events: Sequence[Event]) -> float | None:
    """Time of the newest recorded work on an effect after the first of these visits and up to the last."""
    return newest_work(effect, events, visits[0].time, visits[-1].time) if visits else None


def _is_repaired(
    effect: ChangeEffect,
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
) -> bool:
    """Whether the visits since recorded work on an effect agree with the file."""
    work = _work_on(effect, visits, events)
    later = [v for v in visits if work is not None and v.time >= work]
    return bool(later) and agrees_with_file(effect, parameters, later, events)


def _first_visit_is_outdated(
    at: StateParameter,
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
) -> bool:
    """Whether the visits since recorded work on the parameter ``at`` are what the file expects."""
    work = _work_on(ChangeEffect(at.name, {at.name: 1.0}, at.sd), visits, events)
    later = [v for v in visits if work is not None and v.time >= work]
    return bool(later) and estimate_history(parameters, later, events, accepted=None).steps[0].innovation.is_expected


def _effect_of(deviation: Deviation, parameters: Sequence[StateParameter]) -> ChangeEffect:
    """The deviation as an effect: all of its values change alike."""
    first = next(p for p in parameters if p.name == deviation.names[0])
    return ChangeEffect(", ".join(deviation.names), dict.fromkeys(deviation.names, 1.0), change_sd(first, parameters))


def _at_dip(answer: ModelAnswer, history: History, surface: Sequence[ChangeEffect]) -> ModelAnswer:
    """An "unknown" at a wave, which runs along the whole surface, is where a dip has the most evidence."""
    if answer.verdict != "unknown" or answer.group != "wave" or not surface:
        return answer
    gains, _, _ = evidence_from_first(history, surface)
    return replace(answer, position=position_of(surface[int(np.argmax(gains))].name, None))


def _explains_first_visit(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    effect: ChangeEffect,
    jump: Innovation,
) -> bool:
    """Whether an effect explains how far the first visit is from the file. A dip is taken at its evidence."""
    if group_of(effect, {p.name: p for p in parameters}) == "dip":
        return True
    wide = [replace(p, sd=float(np.hypot(p.sd, effect.sd * effect.direction.get(p.name, 0.0)))) for p in parameters]
    return is_explained(jump, estimate_history(wide, visits, events, accepted=None).steps[0].innovation)


def _deviation_answer(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    history: History,
    visit: str,
    candidates: Sequence[ChangeEffect],
    margin: float,
) -> ModelAnswer:
    """The clearest deviation from the file; without one "unknown" if the first visit is not what the file expects."""
    by_name = {p.name: p for p in parameters}
    groups = {by_name[c.name].group for c in candidates if c.name in by_name}
    least = {g: size for g, size in CALIBRATION.least_sizes if g in groups}
    deviations = deviations_from_file(history, parameters, least, intolerable=INTOLERABLE)
    present = (d for d in deviations if not _is_repaired(_effect_of(d, parameters), parameters, visits, events))
    first: Deviation | None = next(present, None)
    if first is None:
        jump = history.steps[0].innovation if history.steps else None
        if (
            jump is None
            or jump.is_expected
            or _first_visit_is_outdated(by_name[jump.parameter], parameters, visits, events)
        ):
            return ModelAnswer(visit, FILE, "none")
        at = by_name[jump.parameter]
        return ModelAnswer(visit, FILE, "unknown", (), at.name, at.group, position_of(at.name, at))
    middle = None if first.positions is None else 0.5 * sum(first.positions)
    position = middle if middle is not None else position_of(first.names[0], by_name[first.names[0]])
    names: tuple[str, ...] = (NAMES[first.group],)
    if names == ("local_ballast",) and first.size < 0.0:
        effect = _effect_of(first, parameters)
        names = tuple(names_of_softer_ballast(parameters, visits, events, effect, (first.size, first.sd), margin))
    return ModelAnswer(
        visit, FILE, "named" if len(names) == 1 else "a_or_b", names, ", ".join(first.names), first.group,
        position, first.size, first.sd, first.unit,
    )  # fmt: skip
