"""Answers of the calibrated model: which effect has appeared since when, and which was there from the first visit.

An answer after a visit rests on that visit and those before it, as one has it on that day.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from turnout.mismatch.calibrated.belief import Innovation, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence, compare_onsets
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import Deviation, deviations_from_file
from turnout.mismatch.calibrated.history import Event, History, estimate_history
from turnout.mismatch.calibrated.information import GroupInformation, VisitInformation
from turnout.mismatch.calibrated.levels import IMPACTS, kind_of, own_levels

CHANGE, FILE = QUESTIONS = ("change", "file")
# Group of a parameter -> the effect of the library that changes it
NAMES = {
    "ballast": "local_ballast",
    "pad": "local_pad",
    "gain": "sensor_gain",
    "seat": "sensor_position",
    "depth": "surface_dip",
    "dip": "surface_dip",
}
INTOLERABLE = {"depth": CALIBRATION.worn_depth}
STRETCH_GROUPS = ("ballast", "pad")  # of which adjacent supports change together
DAMPER_SHARES = (0.5, 1.0)  # change of the logarithm of the damping over that of the stiffness


@dataclass(frozen=True)
class ModelAnswer:
    """Answer of the calibrated model after one ``visit``.

    ``question`` of ``QUESTIONS``; ``verdict`` "none", "named", "a_or_b" or "unknown" with its ``names``.
    ``parameter`` has changed by ``size`` (standard error ``sd``, ``unit``), or by as much per year if it ``grows``.
    ``onset``: last time without and first time with the change [years], None against the file. ``gain`` is the evidence
    less the logarithm of the number of candidates [nats], None where the answer does not rest on one. ``changed`` are
    all parameters that change alike, ``total`` is the change of each at the visit.
    """

    visit: str
    question: str
    verdict: str
    names: tuple[str, ...] = ()
    parameter: str = ""
    group: str = ""
    position: float | None = None
    size: float | None = None
    sd: float | None = None
    unit: str = ""
    onset: tuple[float, float] | None = None
    gain: float | None = None
    grows: bool = False
    changed: tuple[str, ...] = ()
    total: float | None = None


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
    candidates = [(p.name, {p.name: 1.0}, CALIBRATION.change_sds * p.sd) for p in local]
    candidates += [(name, dict(direction), CALIBRATION.dip_sd) for name, direction in shapes.items()]
    steps = [ChangeEffect(name, d, sd, grows) for name, d, sd in candidates for grows in (False, True)]
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
    for group in STRETCH_GROUPS:
        along = [p for p in parameters if p.may_change and p.group == group and p.position is not None]
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
    dampers = {f"{group}_damper@" + p.name.partition("@")[2] for p in run}
    direction = {p.name: 1.0 for p in run}
    direction |= {
        p.name: share for p in parameters if p.group == f"{group}_damper" and p.name.split(" ")[-1] in dampers
    }
    first, last = run[0].position, run[-1].position
    assert first is not None and last is not None
    where = run[0].name if len(run) == 1 else f"{group}@{first:.2f} to {last:.2f}"
    name, sd = f"{where}, dampers {share:g}", CALIBRATION.change_sds * run[0].sd
    return [ChangeEffect(name, direction, sd, grows, group, 0.5 * (first + last)) for grows in (False, True)]


def answers_after_visits(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
    first: int = 1,
    against_file: tuple[Sequence[StateParameter], Sequence[Event], Sequence[ChangeEffect]] | None = None,
) -> list[ModelAnswer]:
    """What the model says after each visit, of changes and against the file.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
    events : sequence of Event
    candidates : sequence of ChangeEffect
        As ``change_candidates``.
    threshold : float
        Evidence that a name needs. [nats]
    margin : float
        A rival of another name within it makes the answer "a or b", also one below the threshold. [nats]
    first : int
        Number of the first visit after which an answer is given, from 1.
    against_file : tuple or None
        Parameters, events and candidates of the comparison with the file, None: the same.

    Returns
    -------
    list of ModelAnswer
        Two for each visit, in the order of time.
    """
    ordered = sorted(visits, key=lambda v: (v.time, v.visit))
    answers = []
    file_parameters, file_events, file_candidates = against_file or (parameters, events, candidates)
    for n in range(first, len(ordered) + 1):
        change = change_answer(parameters, ordered[:n], events, candidates, threshold, margin)
        before = _visits_before(ordered[:n], change)
        label = ordered[n - 1].visit
        answers += [
            change,
            file_answer(file_parameters, before, file_events, label, file_candidates, threshold, margin),
        ]
    return answers


def _visits_before(visits: Sequence[VisitInformation], change: ModelAnswer) -> list[VisitInformation]:
    """Visits that certainly lie before the change: with it the mean of all visits deviates from the file, too."""
    if change.onset is None:
        return list(visits)
    return [v for v in visits if v.time <= change.onset[0]]


def change_answer(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
    is_alarmed: bool = False,
) -> ModelAnswer:
    """What has changed up to the last of these visits.

    Every candidate is equally probable before, so that its evidence is less by the logarithm of their number. By
    Markov's inequality an intact history then exceeds ``threshold`` with a probability of at most exp(-threshold).

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
        Whether an open alarm asks: then a change of any size is told, and the evidence of a name is that of all of its
        candidates together, the mean of their likelihood ratios. The inequality holds for it as well.

    Returns
    -------
    ModelAnswer
        "unknown" if a visit differs from all before, and no name explains it.
    """
    visit = visits[-1].visit
    levels, history, evidence = _evidence_of_changes(parameters, visits, events, candidates, is_alarmed)
    price = float(np.log(max(len(candidates), 1)))
    by_name = {p.name: p for p in parameters}
    least = threshold + price
    material = [e for e in evidence if e.gain > least - margin and (is_alarmed or _is_material(e, by_name))]
    material = [e for e in material if e.gain >= e.from_first]
    gain = _evidence_of_name(material, by_name) if is_alarmed else max((e.gain for e in material), default=-np.inf)
    if gain < least:
        by_stated_errors = estimate_history(parameters, visits, events, repeats_between_visits=False, accepted=None)
        return _answer_without_name(by_stated_errors, visit, by_name)
    leader = material[0]
    other_form = next((e for e in evidence if e.effect.name == leader.effect.name and e is not leader), None)
    stated = _LeadingEffect.of(
        leader.effect, by_name, leader.size, gain - price, leader.interval(other_form=other_form)
    )
    jump = history.steps[1 + int(np.argmax(leader.gains))].innovation
    with_change = estimate_history(
        parameters,
        visits,
        [*events, *_events_of_change(leader, parameters, candidates)],
        repeats_between_visits=False,
        accepted=None,
        levels=levels,
    )
    explained = next(s.innovation for s in with_change.steps if s.visit == leader.onset)
    if not _is_explained(jump, explained):
        return stated.unknown(visit, CHANGE, by_name[jump.parameter])
    names = [stated.name]
    if stated.name == "local_ballast" and leader.size[0] < 0.0:
        names = _supported_names(parameters, visits, events, leader, _present_size(leader), margin, levels)
    rivals = [_name(e.effect, by_name) for e in material if e.gain > leader.gain - margin]
    answer = stated.answer(visit, CHANGE, _with_rivals(names, stated, rivals))
    return replace(answer, changed=tuple(leader.effect.direction), total=_present_size(leader)[0])


def _evidence_of_changes(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    is_alarmed: bool,
) -> tuple[dict[str, float], History, list[OnsetEvidence]]:
    """Levels of the errors, history and evidence. The levels are those that the most evident change leaves.

    Where an alarm asks, a change of any size is told: there the errors are the stated ones.
    """
    levels = {} if is_alarmed else own_levels(parameters, visits, events)
    for is_last in (is_alarmed, True):
        history = estimate_history(
            parameters, visits, events, repeats_between_visits=False, accepted=None, levels=levels
        )
        evidence = compare_onsets(history, candidates)
        if is_last or not evidence:
            break
        change = _events_of_change(evidence[0], parameters, candidates)
        levels = own_levels(parameters, visits, [*events, *change])
    return levels, history, evidence


def _evidence_of_name(material: Sequence[OnsetEvidence], by_name: Mapping[str, StateParameter]) -> float:
    """Sum of the likelihood ratios of all candidates with the name and the sign of the first one. [nats]"""
    if not material:
        return -np.inf
    effect, size = material[0].effect, material[0].size[0]
    alike = [e.gain for e in material if _name(e.effect, by_name) == _name(effect, by_name) and e.size[0] * size > 0.0]
    return float(np.logaddexp.reduce(alike))


def _is_explained(before: Innovation, after: Innovation) -> bool:
    """Whether an effect explains the innovation of its first visit: at least a share of the excess over the expected.

    A substitute for an effect that has no name explains little of it, however much evidence it has.
    """
    excess = [i.statistic - i.n_directions for i in (before, after)]
    return excess[1] <= max((1.0 - CALIBRATION.min_explained_share) * excess[0], 0.0)


def _with_rivals(names: Sequence[str], stated: _LeadingEffect, rivals: Iterable[str]) -> list[str]:
    """The names and those of rivals, each once."""
    return [*names, *(n for n in dict.fromkeys(rivals) if n not in (*names, stated.name))]


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


def free_shape(
    effect: ChangeEffect, parameters: Sequence[StateParameter], candidates: Sequence[ChangeEffect]
) -> list[tuple[Mapping[str, float], float]]:
    """Directions of an effect with their standard deviations. A dip of the surface may have any shape.

    Wear lowers a nose unevenly: beside the dip, all dips and numbers of the file's surface within
    ``CALIBRATION.nose_reach`` may change.

    Parameters
    ----------
    effect : ChangeEffect
    parameters : sequence of StateParameter
    candidates : sequence of ChangeEffect

    Returns
    -------
    list of (mapping, float)
        Parameter -> change per unit of size, and standard deviation of the size.
    """
    by_name = {p.name: p for p in parameters}
    at = position_of(effect.name, by_name.get(effect.name))
    directions: list[tuple[Mapping[str, float], float]] = [(effect.direction, effect.sd)]
    if group_of(effect, by_name) not in ("dip", "depth") or at is None:
        return directions
    dips = [c for c in candidates if group_of(c, by_name) == "dip" and c.grows == effect.grows]
    numbers = [p for p in parameters if p.group in ("surface", "depth")]
    near = [(position_of(c.name, None), (c.direction, c.sd)) for c in dips]
    near += [(position_of(p.name, p), ({p.name: 1.0}, CALIBRATION.change_sds * p.sd)) for p in numbers]
    return directions + [d for x, d in near if x is not None and abs(x - at) <= CALIBRATION.nose_reach]


@dataclass(frozen=True)
class _LeadingEffect:
    """The effect with the most evidence."""

    parameter: str
    name: str
    group: str
    position: float | None
    unit: str
    size: tuple[float, float]
    gain: float
    onset: tuple[float, float] | None
    grows: bool

    @classmethod
    def of(
        cls,
        effect: ChangeEffect,
        by_name: Mapping[str, StateParameter],
        size: tuple[float, float],
        gain: float,
        onset: tuple[float, float] | None = None,
    ) -> _LeadingEffect:
        parameter = by_name.get(effect.name)
        first = parameter or by_name.get(next(iter(effect.direction)))
        group = group_of(effect, by_name)
        unit = first.unit if first and group != "dip" else "m"
        position = position_of(effect.name, parameter) if effect.position is None else effect.position
        position = _nose_near(position, by_name.values()) if group == "dip" else position
        return cls(
            effect.name.partition(",")[0], _name(effect, by_name), group, position, unit, size, gain, onset,
            onset is not None and effect.grows,
        )  # fmt: skip

    def unknown(self, visit: str, question: str, jump: StateParameter) -> ModelAnswer:
        """Answer "unknown", at the parameter whose jump explains most."""
        return ModelAnswer(
            visit, question, "unknown", (), jump.name, jump.group, position_of(jump.name, jump), onset=self.onset,
            gain=self.gain,
        )  # fmt: skip

    def answer(self, visit: str, question: str, names: Sequence[str]) -> ModelAnswer:
        """Answer with these names."""
        return ModelAnswer(
            visit, question, "named" if len(names) == 1 else "a_or_b", tuple(names[:2]), self.parameter, self.group,
            self.position, *self.size, self.unit, self.onset, self.gain, self.grows,
        )  # fmt: skip


def _nose_near(position: float | None, parameters: Iterable[StateParameter]) -> float | None:
    """Position of the nose whose surface a dip changes, else that of the dip itself."""
    if position is None:
        return None
    at = position
    noses = [x for p in parameters if p.group == "depth" and (x := position_of(p.name, p)) is not None]
    nose = min(noses, key=lambda x: abs(x - at), default=at)
    return nose if abs(nose - at) <= CALIBRATION.nose_reach else at


def position_of(name: str, parameter: StateParameter | None) -> float | None:
    """Position of a candidate [m]: that of its parameter, or the number behind "@" or "at" in its name; none of a wave.

    Parameters
    ----------
    name : str
    parameter : StateParameter or None

    Returns
    -------
    float or None
    """
    if parameter is not None and parameter.position is not None:
        return parameter.position
    if parameter is not None and parameter.group == "wave":  # it names its stretch
        return None
    number = re.search(r"(?:@| at )(-?\d+(?:\.\d+)?)", name)
    return float(number.group(1)) if number else None


def _name(effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> str:
    return NAMES[group_of(effect, by_name)]


def group_of(effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> str:
    """Group of the parameters that an effect changes, "dip" for the waves of a dip.

    Parameters
    ----------
    effect : ChangeEffect
    by_name : mapping of str to StateParameter

    Returns
    -------
    str
    """
    parameter = by_name.get(effect.name)
    return parameter.group if parameter else effect.group or "dip"


def _is_material(evidence: OnsetEvidence, by_name: Mapping[str, StateParameter]) -> bool:
    """Whether the present size causes any action."""
    return abs(_present_size(evidence)[0]) >= _least_size(evidence.effect, by_name)


def _present_size(evidence: OnsetEvidence) -> tuple[float, float]:
    """Size at the last visit and its standard deviation: of growth, that since its most probable onset."""
    start = evidence.times[int(np.argmax(evidence.gains))]
    elapsed = float(evidence.times[-1] - start) if evidence.effect.grows else 1.0
    return elapsed * evidence.size[0], elapsed * evidence.size[1]


def _least_size(effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> float:
    group = group_of(effect, by_name)
    return CALIBRATION.least_dip if group == "dip" else dict(CALIBRATION.least_sizes)[group]


def _supported_names(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    leader: OnsetEvidence | ChangeEffect,
    size: tuple[float, float],
    margin: float,
    levels: Mapping[str, float] | None = None,
) -> list[str]:
    """Names of softer ballast: a gap is felt by impacts on the unloaded track, and less by trains that close it.

    In one fit trains have a size of their own: that of impacts, or the shares of it that a gap leaves, which are
    equally probable before. The prior of the size is so wide that it favours none: without trains, or without impacts,
    the evidence decides nothing. A gap that no train closes feels alike under both, as a softer bed does. It is known
    only where less of the stiffness is left than ballast has that carries anything.
    An effect without onsets is one of the first visit.
    """
    if size[0] + CALIBRATION.finding_sds * size[1] < np.log(CALIBRATION.least_support):
        return ["hanging_sleeper"]
    effect = leader.effect if isinstance(leader, OnsetEvidence) else leader
    felt = [p for p in parameters if p.name in effect.direction]  # the damper of a support with its spring
    offsets = {p.name: replace(p, name=f"{p.name} as trains feel it", mean=0.0) for p in felt}
    all_parameters = [*parameters, *offsets.values()]
    opened, split = list(events), list(visits)
    for name, offset in offsets.items():
        opened = [
            replace(e, opened={**e.opened, offset.name: e.opened[name]}) if name in e.opened else e for e in opened
        ]
        split = [replace(v, groups=tuple(_with_offset(g, name, offset.name) for g in v.groups)) for v in split]
    sd = CALIBRATION.gap_size_sds * max(effect.sd, abs(size[0]))
    effects = [
        ChangeEffect(
            f"{share:g}",
            {**effect.direction, **{offsets[name].name: (share - 1.0) * d for name, d in effect.direction.items()}},
            sd,
            effect.grows,
        )
        for share in (1.0, *CALIBRATION.gap_shares)
    ]
    history = estimate_history(
        all_parameters,
        split,
        opened,
        repeats_between_visits=False,
        accepted=None,
        levels=levels,
    )
    if isinstance(leader, OnsetEvidence):
        gains = {e.effect.name: e.gain for e in compare_onsets(history, effects)}
    else:
        gains = dict(zip((e.name for e in effects), evidence_from_first(all_parameters, history, effects)[0]))
    equal, *of_gaps = (gains[e.name] for e in effects)
    difference = float(np.logaddexp.reduce(of_gaps)) - float(np.log(len(of_gaps))) - equal
    return ["hanging_sleeper"] if difference > margin else ["local_ballast", "hanging_sleeper"]


def _with_offset(group: GroupInformation, name: str, offset: str) -> GroupInformation:
    """Information of trains on the sum of a parameter and its ``offset``; that of impacts as it is."""
    if kind_of(group.group) == IMPACTS or name not in group.names:
        return group
    k, n = group.names.index(name), len(group.names)
    terms = np.vstack([np.eye(n), np.eye(n)[k]])  # (n + 1, n)
    return replace(
        group, names=(*group.names, offset), matrix=terms @ group.matrix @ terms.T, vector=terms @ group.vector
    )  # fmt: skip


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


def file_answer(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    visit: str,
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
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

    Returns
    -------
    ModelAnswer
        "unknown" where what differs has no name, or no name explains it.
    """
    by_name = {p.name: p for p in parameters}
    steps = [c for c in candidates if not c.grows]
    history = estimate_history(parameters, visits, events, accepted=None)
    price = float(np.log(max(len(steps), 1)))
    least = threshold + price
    gains, sizes, sds = evidence_from_first(parameters, history, steps)
    order = [
        k for k in np.argsort(-gains) if gains[k] > least - margin and abs(sizes[k]) >= _least_size(steps[k], by_name)
    ]
    jump = history.steps[0].innovation if history.steps else None
    if not order or gains[order[0]] < least:
        return _deviation_answer(parameters, history, visit, steps, jump)
    first = order[0]
    stated = _LeadingEffect.of(
        steps[first], by_name, (float(sizes[first]), float(sds[first])), float(gains[first]) - price
    )
    assert jump is not None  # without a visit nothing has evidence
    if not _explains_first_visit(parameters, visits, events, steps[first], jump):
        return stated.unknown(visit, FILE, by_name[jump.parameter])
    names = [stated.name]
    if stated.name == "local_ballast" and sizes[first] < 0.0:
        names = _supported_names(parameters, visits, events, steps[first], stated.size, margin)
    rivals = [_name(steps[k], by_name) for k in order if gains[k] > gains[first] - margin]
    return stated.answer(visit, FILE, _with_rivals(names, stated, rivals))


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
    return _is_explained(jump, estimate_history(wide, visits, events, accepted=None).steps[0].innovation)


def _deviation_answer(
    parameters: Sequence[StateParameter],
    history: History,
    visit: str,
    candidates: Sequence[ChangeEffect],
    jump: Innovation | None,
) -> ModelAnswer:
    """The clearest deviation from the file; without one "unknown" if the first visit is not what the file expects."""
    by_name = {p.name: p for p in parameters}
    groups = {by_name[c.name].group for c in candidates if c.name in by_name}
    least = {g: size for g, size in CALIBRATION.least_sizes if g in groups}
    deviations = deviations_from_file(history.belief, parameters, least, intolerable=INTOLERABLE)
    if not deviations:
        if jump is None or jump.is_expected:
            return ModelAnswer(visit, FILE, "none")
        at = by_name[jump.parameter]
        return ModelAnswer(visit, FILE, "unknown", (), at.name, at.group, position_of(at.name, at))
    first: Deviation = deviations[0]
    middle = None if first.positions is None else 0.5 * sum(first.positions)
    position = middle if middle is not None else position_of(first.names[0], by_name[first.names[0]])
    names: tuple[str, ...] = (NAMES[first.group],)
    if names == ("local_ballast",) and first.size < 0.0:  # as in ``_supported_names``
        names = ("local_ballast", "hanging_sleeper")
    return ModelAnswer(
        visit, FILE, "named" if len(names) == 1 else "a_or_b", names, ", ".join(first.names), first.group,
        position, first.size, first.sd, first.unit,
    )  # fmt: skip


def evidence_from_first(
    parameters: Sequence[StateParameter], history: History, candidates: Sequence[ChangeEffect]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Evidence of effects that were there from the first visit, over the values of the file with their scatter.

    With the information of all visits, :math:`\Lambda = P^{-1} - P_0^{-1}`, it is that of ``compare_onsets`` for one
    visit.

    Parameters
    ----------
    parameters : sequence of StateParameter
    history : History
    candidates : sequence of ChangeEffect
        Whether they grow makes no difference.

    Returns
    -------
    gains, sizes, sds : (n_candidate,) array of float
    """
    names = [p.name for p in parameters]
    prior, belief = history.prior, history.belief
    factor = np.linalg.cholesky(prior.covariance)
    precision = np.linalg.inv(belief.covariance)
    score = precision @ (belief.mean - prior.mean)  # information vector about the mean of the file
    scaled = factor.T @ precision @ factor - np.eye(len(names))
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    informed = eigenvalues > CALIBRATION.min_prior_share  # not what an event made less certain than the file
    w, vectors = eigenvalues[informed], vectors[:, informed]
    changes = np.array([[c.direction.get(name, 0.0) for name in names] for c in candidates])
    directions = np.linalg.solve(factor, changes.T).T @ vectors
    information = directions**2 @ (w / (1.0 + w))
    b = directions @ (vectors.T @ (factor.T @ score) / (1.0 + w))
    variance = np.array([c.sd**2 for c in candidates])
    sizes, sds = b / (information + 1.0 / variance), 1.0 / np.sqrt(information + 1.0 / variance)
    return 0.5 * b * sizes - 0.5 * np.log1p(variance * information), sizes, sds
