"""What has changed: candidates of changes, and the effect that has appeared since when."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from turnout.constants import Z95
from turnout.mismatch.calibrated.belief import StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence, change_sd, compare_onsets
from turnout.mismatch.calibrated.change_course import courses_of, visits_of_ended_change
from turnout.mismatch.calibrated.change_size import is_material, present_size, with_model_error
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import Event, History, estimate_history
from turnout.mismatch.calibrated.information import VisitInformation
from turnout.mismatch.calibrated.levels import error_levels
from turnout.mismatch.calibrated.model_answer import (
    CHANGE,
    NAMES,
    LeadingEffect,
    ModelAnswer,
    free_shape,
    is_explained,
    name_of,
    position_of,
    with_rivals,
)
from turnout.mismatch.calibrated.repairs import agrees_with_file, newest_work, repair_events, size_after_work
from turnout.mismatch.calibrated.soft_ballast_or_gap import names_of_softer_ballast
from turnout.mismatch.calibrated.stiffness_under_load import (
    is_all_explained,
    is_under_load,
    with_evidence_under_load,
    with_offsets,
)
from turnout.mismatch.calibrated.stretch_ends import STRETCH_GROUPS, changes_alike, stretch_ends

DAMPER_SHARES = (0.5, 1.0)  # change of the logarithm of the damping over that of the stiffness


def change_candidates(
    parameters: Sequence[StateParameter],
    shapes: Mapping[str, Mapping[str, float]] | None = None,
    without: Collection[str] = (),
) -> list[ChangeEffect]:
    """Steps of each parameter of a single support, sensor or nose at an unknown visit, and their growth.

    A spring changes alone, or with its damper, see ``stretch_candidates``.

    Parameters
    ----------
    parameters : sequence of StateParameter
    shapes : mapping or None
        Further candidates: name -> direction (parameter -> change per unit of size), with a prior standard deviation
        of the size of ``CALIBRATION.dip_sd``.
    without : collection of str
        Names of effects that are left out.

    Returns
    -------
    list of ChangeEffect
    """
    local = [p for p in parameters if p.may_change and p.group in NAMES and NAMES[p.group] not in without]
    shapes = {} if shapes is None or NAMES["dip"] in without else shapes
    candidates = [(p.name, {p.name: 1.0}, change_sd(p, parameters)) for p in local]
    steps = [ChangeEffect(name, d, sd, grows) for name, d, sd in candidates for grows in (False, True)]
    steps += surface_changes(shapes)
    springs = [p for p in local if p.group in STRETCH_GROUPS and p.position is not None]
    with_dampers = [e for p in springs for share in DAMPER_SHARES for e in _stretch(p.group, [p], share, parameters)]
    return steps + [e for e in with_dampers if len(e.direction) > 1]


def stretch_candidates(parameters: Sequence[StateParameter]) -> list[ChangeEffect]:
    """Changes of two to ``CALIBRATION.max_stretch`` adjacent supports alike, with their dampers.

    Ballast and pads often change over a stretch: drainage and traffic do not end at a sleeper. Their dampers change by
    half the logarithm of the stiffness, as the effects of the library assume. That of a single support may also change
    by all of it, where a sleeper has lost its support.

    Parameters
    ----------
    parameters : sequence of StateParameter

    Returns
    -------
    list of ChangeEffect
        Named by the group, the first and last position, and the share of the dampers.
    """
    candidates = []
    routes = dict.fromkeys(p.route for p in parameters)
    for group, route in ((g, r) for g in STRETCH_GROUPS for r in routes):
        along = [
            p for p in parameters if p.may_change and (p.group, p.route) == (group, route) and p.position is not None
        ]
        along.sort(key=_order)
        for n in range(2, CALIBRATION.max_stretch + 1):
            for k in range(len(along) - n + 1):
                run = along[k : k + n]
                if _order(run[-1]) - _order(run[0]) == n - 1:
                    candidates += _stretch(group, run, DAMPER_SHARES[0], parameters)
    return candidates


def _order(parameter: StateParameter) -> int:
    assert parameter.index is not None
    return parameter.index


def _stretch(
    group: str, run: Sequence[StateParameter], share: float, parameters: Sequence[StateParameter]
) -> list[ChangeEffect]:
    dampers = {p.name.replace(f"{group}@", f"{group}_damper@") for p in run}
    direction = {p.name: 1.0 for p in run} | {p.name: share for p in parameters if p.name in dampers}
    first, last = run[0].position, run[-1].position
    assert first is not None and last is not None
    where = run[0].name if len(run) == 1 else f"{run[0].name} to {last:.2f}"
    name, sd = f"{where}, dampers {share:g}", change_sd(run[0], parameters)
    return [ChangeEffect(name, direction, sd, grows, group, 0.5 * (first + last)) for grows in (False, True)]


def change_answer(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
    is_alarmed: bool = False,
    with_trains: tuple[Sequence[StateParameter], Sequence[VisitInformation]] | None = None,
    surface: Sequence[ChangeEffect] = (),
) -> ModelAnswer:
    """What has changed up to the last of these visits.

    Every candidate is equally probable before. The evidence of a name is that of all of its candidates together: the
    sum of their likelihood ratios over the number of all candidates, however finely positions are spaced. By Markov's
    inequality an intact history exceeds ``threshold`` with a probability of at most exp(-threshold).

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
        In the order of time.
    events : sequence of Event
    candidates : sequence of ChangeEffect
    threshold : float
        [nats]
    margin : float
        [nats]
    is_alarmed : bool
        Whether an open alarm asks: then a change of any size is stated.
    with_trains : (sequence of StateParameter, sequence of VisitInformation) or None
        What tells soft ballast from a gap, None: ``parameters`` and ``visits``.
    surface : sequence of ChangeEffect
        As ``surface_changes``: they locate a change of the running surface that has no name.

    Returns
    -------
    ModelAnswer
        "unknown" if a visit differs from all before, and no name explains it. A change that has ended before the last
        visit is none: the visits that show it are left out.
    """
    visit = visits[-1].visit
    levels, history, evidence = _evidence_of_changes(parameters, visits, events, candidates, is_alarmed)
    penalty = float(np.log(max(len(candidates), 1)))
    with_loads = with_offsets(parameters, visits)
    by_name = {p.name: p for p in with_loads[0]}
    least = threshold + penalty
    relevant = [e for e in evidence if e.gain > least - margin and (is_alarmed or is_material(e, by_name))]
    relevant = [e for e in relevant if e.gain >= e.from_first]
    gain = _evidence_of_name(relevant, by_name)
    if gain < least:
        by_stated_errors = estimate_history(parameters, visits, events, repeats_between_visits=False, accepted=None)
        answer = _answer_without_name(by_stated_errors, visit, by_name)
        if answer.verdict == "none" or is_alarmed:
            if _has_ended(answer, parameters, visits, events, by_name):
                return ModelAnswer(visit, CHANGE, "none")
            return _on_surface(answer, by_stated_errors, surface)
        return change_answer(  # what makes a visit differ has a name, however small it is
            parameters, visits, events, candidates, threshold, margin, True, with_trains, surface
        )
    leader = relevant[0]
    present, repair, ended = _after_work(leader, parameters, visits, events, candidates, levels, margin)
    if repair:
        return change_answer(
            parameters, visits, [*events, *repair], candidates, threshold, margin, is_alarmed, with_trains, surface
        )
    jump = history.steps[1 + int(np.argmax(leader.gains))].innovation
    without_loads = parameters, visits
    if is_under_load(leader.effect):
        parameters, visits = with_loads
        history = _history_of_changes(parameters, visits, events, levels)
    if not ended and present is None:
        ended = visits_of_ended_change(history, leader.effect, margin)
    if ended:
        parameters, visits = without_loads[0], _without(ended, without_loads[1])
        with_trains = with_trains and (with_trains[0], _without(ended, with_trains[1]))
        return change_answer(
            parameters, visits, events, candidates, threshold, margin, is_alarmed, with_trains, surface
        )
    courses = courses_of(history, leader.effect)
    if present is not None and abs(present[0] - courses.last_size[0]) <= Z95 * present[1]:
        present = None  # the work has not changed it
    grows = leader.effect.grows and present is None
    sizes = (leader.size if grows else present or courses.last_size, present or courses.last_size)
    size, total = (with_model_error(leader.effect, s, by_name) for s in sizes)
    effect = replace(leader.effect, grows=grows)
    stated = LeadingEffect.of(effect, by_name, size, gain - penalty, courses.onset_interval())
    opened = [*events, *_events_of_change(leader, parameters, candidates)]
    with_change = _history_of_changes(parameters, visits, opened, levels)
    explained = next(s.innovation for s in with_change.steps if s.visit == leader.onset)
    since = float(leader.times[int(np.argmax(leader.gains))])
    is_rest_expected = not is_under_load(leader.effect) or is_all_explained(parameters, visits, opened, since)
    if not (is_explained(jump, explained) and is_rest_expected):
        return _on_surface(stated.unknown(visit, CHANGE, by_name[jump.parameter]), history, surface)
    names = [stated.name]
    if stated.name == "local_ballast" and leader.size[0] < 0.0:
        information = with_trains or (parameters, visits)
        names = names_of_softer_ballast(*information, events, leader, present_size(leader), margin, levels)
    rivals = [name_of(e.effect, by_name) for e in relevant if e.gain > leader.gain - margin]
    answer = stated.answer(visit, CHANGE, with_rivals(names, stated, rivals))
    ends = stretch_ends(changes_alike(evidence, leader, by_name), by_name)
    return replace(answer, changed=tuple(leader.effect.direction), total=total[0], total_sd=total[1], ends=ends)


def _after_work(
    leader: OnsetEvidence,
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    levels: Mapping[str, float],
    margin: float,
) -> tuple[tuple[float, float] | None, list[Event], tuple[str, ...]]:
    """Size of a change that lasts after recorded work on it (None without work), and the noise of one that does not.

    A change between the visits before and after the work is the work itself, where the later visits agree with the
    file. Where the visits after the work show another effect in its place, the noise of this one would hide that: the
    third part is the visits that are left out then, those between this change and the work.
    """
    if is_under_load(leader.effect):
        return None, [], ()
    first = int(np.argmax(leader.gains))
    since, onset, last = (float(leader.times[k]) for k in (first, first + 1, -1))
    shapes = free_shape(leader.effect, parameters, candidates)
    size = leader.size[0] * ((last - since) if leader.effect.grows else 1.0)
    work = newest_work(leader.effect, events, since, onset)
    later = [v for v in visits if v.time >= onset]
    if work is not None and agrees_with_file(leader.effect, parameters, later, events):
        return None, _new_events(repair_events(shapes, size, [work]), events), ()
    work = newest_work(leader.effect, events, onset, last)
    if work is None:
        return None, [], ()
    between = [v for v in visits if since < v.time < work]
    without = _history_of_changes(parameters, [v for v in visits if not since < v.time < work], events, levels)
    before = _history_of_changes(parameters, [v for v in visits if v.time < work], events, levels)
    before_work = courses_of(before, leader.effect).last_size
    after_work = size_after_work(without, leader.effect, since, before_work)
    if after_work is None:
        times = [*(v.time for v in between), work]
        return None, _new_events(repair_events(shapes, size, times), events), ()
    is_other = after_work * before_work[0] < 0.0 or _is_elsewhere(without, leader.effect, candidates, margin)
    if is_other:
        return None, [], tuple(v.visit for v in between)
    return courses_of(without, leader.effect).last_size, [], ()


def _is_elsewhere(history: History, effect: ChangeEffect, candidates: Sequence[ChangeEffect], margin: float) -> bool:
    """Whether another change, of none of its parameters, has more evidence than an effect by the margin [nats]."""
    candidates_elsewhere = [
        c for c in candidates if not is_under_load(c) and not c.direction.keys() & effect.direction.keys()
    ]
    (evidence,) = compare_onsets(history, [replace(effect, grows=False)])  # one visit shows no growth
    leader = next(iter(compare_onsets(history, candidates_elsewhere)), None)
    return leader is not None and leader.gain > evidence.gain + margin


def _new_events(repair: list[Event], events: Sequence[Event]) -> list[Event]:
    """The events, [] if the first of them is there already: what its noise does not explain is stated."""
    is_there = any((e.time, e.direction) == (repair[0].time, repair[0].direction) for e in events)
    return [] if is_there else repair


def _without(ended: Collection[str], visits: Sequence[VisitInformation]) -> list[VisitInformation]:
    return [v for v in visits if v.visit not in ended]


def _has_ended(
    answer: ModelAnswer,
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    by_name: Mapping[str, StateParameter],
) -> bool:
    """Whether the other visits agree, the last one among them, if those that differ are left out one after another."""
    while answer.onset is not None and answer.onset[1] < visits[-1].time:
        first = answer.onset[1]
        visits = [v for v in visits if v.time != first]
        history = estimate_history(parameters, visits, events, repeats_between_visits=False, accepted=None)
        answer = _answer_without_name(history, visits[-1].visit, by_name)
    return answer.verdict == "none"


def _history_of_changes(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    levels: Mapping[str, float],
) -> History:
    """History with errors of the model that are constant, but for their ``levels``; {}: with the stated errors."""
    return estimate_history(
        parameters, visits, events, repeats_between_visits=False, accepted=None, levels=levels,
        constant_errors=bool(levels),
    )  # fmt: skip


def _evidence_of_changes(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    is_alarmed: bool,
) -> tuple[dict[str, float], History, list[OnsetEvidence]]:
    """Levels of the errors, history and evidence. The levels are those that the most evident change leaves.

    Where an alarm asks, a change of any size is stated: there the errors are the stated ones.
    """
    ordinary = [c for c in candidates if not is_under_load(c)]
    levels = {} if is_alarmed else error_levels(parameters, visits, events)
    for is_last in (is_alarmed, True):
        history = _history_of_changes(parameters, visits, events, levels)
        evidence = compare_onsets(history, ordinary)
        if is_last or not evidence:
            break
        change = _events_of_change(evidence[0], parameters, ordinary)
        levels = error_levels(parameters, visits, [*events, *change])
    return levels, history, with_evidence_under_load(evidence, parameters, visits, events, candidates, levels)


def _evidence_of_name(relevant: Sequence[OnsetEvidence], by_name: Mapping[str, StateParameter]) -> float:
    """Sum of the likelihood ratios of all candidates with the name and the sign of the first one. [nats]"""
    if not relevant:
        return -np.inf
    return float(np.logaddexp.reduce([e.gain for e in changes_alike(relevant, relevant[0], by_name)]))


def _events_of_change(
    evidence: OnsetEvidence, parameters: Sequence[StateParameter], candidates: Sequence[ChangeEffect]
) -> list[Event]:
    """Events that open the directions of an effect from its most probable onset on."""
    first = int(np.argmax(evidence.gains))
    times, directions = evidence.times, free_shape(evidence.effect, parameters, candidates)
    if not evidence.effect.grows:
        return [Event(float(times[first + 1]), {}, *d) for d in directions]
    steps = list(zip(times[first:-1], times[first + 1 :]))
    return [Event(float(now), {}, d, sd * float(now - before)) for before, now in steps for d, sd in directions]


def surface_changes(shapes: Mapping[str, Mapping[str, float]]) -> list[ChangeEffect]:
    """Steps and growth of dips of the running surface.

    Parameters
    ----------
    shapes : mapping
        Name with its position -> direction (parameter -> change per metre of depth).

    Returns
    -------
    list of ChangeEffect
    """
    sd = CALIBRATION.dip_sd
    return [ChangeEffect(name, dict(d), sd, grows) for name, d in shapes.items() for grows in (False, True)]


def _on_surface(answer: ModelAnswer, history: History, surface: Sequence[ChangeEffect]) -> ModelAnswer:
    """An "unknown" at a wave, which runs along the whole surface, is where the most evident dip is."""
    dips = compare_onsets(history, surface) if answer.group == "wave" else ()
    return replace(answer, position=position_of(dips[0].effect.name, None)) if dips else answer


def _answer_without_name(history: History, visit: str, by_name: Mapping[str, StateParameter]) -> ModelAnswer:
    """ "none", or "unknown" since the first visit that differs from all before by more than those from the expected."""
    level = 1.0
    for before, step in pairwise(history.steps):
        level = max(level, before.innovation.statistic / max(before.innovation.n_directions, 1))
        if not step.innovation.is_expected_at(level):
            at = by_name[step.innovation.parameter]
            return ModelAnswer(
                visit, CHANGE, "unknown", (), at.name, at.group, position_of(at.name, at),
                onset=(before.time, step.time),
            )  # fmt: skip
    return ModelAnswer(visit, CHANGE, "none")
