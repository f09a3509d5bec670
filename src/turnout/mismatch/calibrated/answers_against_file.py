"""What differs from the owner's file: the effect of the first visit, else the clearest deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnout.mismatch.calibrated.belief import Innovation, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, change_sd
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import Deviation, deviations_from_file, evidence_from_first
from turnout.mismatch.calibrated.history import Event, History, estimate_history
from turnout.mismatch.calibrated.information import VisitInformation
from turnout.mismatch.calibrated.model_answer import (
    FILE,
    NAMES,
    LeadingEffect,
    ModelAnswer,
    group_of,
    is_explained,
    least_size,
    name_of,
    position_of,
    with_rivals,
)
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
    if not order or gains[order[0]] < least:
        deviation = _deviation_answer(parameters, visits, events, history, visit, steps, margin)
        return _at_dip(deviation, history, surface)
    first = order[0]
    stated = LeadingEffect.of(
        steps[first], by_name, (float(sizes[first]), float(sds[first])), float(gains[first]) - penalty
    )
    jump = history.steps[0].innovation  # without a visit nothing has evidence
    if not _explains_first_visit(parameters, visits, events, steps[first], jump):
        return _at_dip(stated.unknown(visit, FILE, by_name[jump.parameter]), history, surface)
    names = [stated.name]
    if stated.name == "local_ballast" and sizes[first] < 0.0:
        names = names_of_softer_ballast(parameters, visits, events, steps[first], stated.size, margin)
    rivals = [name_of(steps[k], by_name) for k in order if gains[k] > gains[first] - margin]
    return stated.answer(visit, FILE, with_rivals(names, stated, rivals))


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
    if not deviations:
        jump = history.steps[0].innovation if history.steps else None
        if jump is None or jump.is_expected:
            return ModelAnswer(visit, FILE, "none")
        at = by_name[jump.parameter]
        return ModelAnswer(visit, FILE, "unknown", (), at.name, at.group, position_of(at.name, at))
    first: Deviation = deviations[0]
    middle = None if first.positions is None else 0.5 * sum(first.positions)
    position = middle if middle is not None else position_of(first.names[0], by_name[first.names[0]])
    names: tuple[str, ...] = (NAMES[first.group],)
    if names == ("local_ballast",) and first.size < 0.0:
        run = [by_name[name] for name in first.names]
        effect = ChangeEffect(", ".join(first.names), dict.fromkeys(first.names, 1.0), change_sd(run[0], parameters))
        names = tuple(names_of_softer_ballast(parameters, visits, events, effect, (first.size, first.sd), margin))
    return ModelAnswer(
        visit, FILE, "named" if len(names) == 1 else "a_or_b", names, ", ".join(first.names), first.group,
        position, first.size, first.sd, first.unit,
    )  # fmt: skip
