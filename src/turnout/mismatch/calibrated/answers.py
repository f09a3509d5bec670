"""Answers of the calibrated model: which effect has appeared since when, and which was there from the first visit.

An answer after a visit rests on that visit and those before it, as one has it on that day.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.calibrated.belief import Belief, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence, compare_onsets
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import Deviation, deviations_from_file
from turnout.mismatch.calibrated.history import Event, History, estimate_history
from turnout.mismatch.calibrated.information import GroupInformation, VisitInformation

CHANGE, FILE = QUESTIONS = ("change", "file")
# Group of a parameter -> the effect of the library that changes it
NAMES = {
    "ballast": "local_ballast",
    "pad": "local_pad",
    "gain": "sensor_gain",
    "seat": "sensor_position",
    "surface": "surface_dip",
    "dip": "surface_dip",
}
IMPACTS = "impacts at"  # part of the name of a group of hammer tests


@dataclass(frozen=True)
class ModelAnswer:
    """Answer of the calibrated model after one ``visit``.

    ``question`` of ``QUESTIONS``; ``verdict`` "none", "named", "a_or_b" or "unknown" with its ``names``.
    ``parameter`` has changed by ``size`` (standard error ``sd``, ``unit``), or by as much per year if it ``grows``.
    ``onset``: last time without and first time with the change [years], None against the file. ``gain`` is the evidence
    less the logarithm of the number of candidates [nats], None where the answer does not rest on one.
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


def change_candidates(
    parameters: Sequence[StateParameter], shapes: Mapping[str, Mapping[str, float]] | None = None
) -> list[ChangeEffect]:
    """Steps of each support, sensor and surface parameter at an unknown visit, and their growth.

    Parameters
    ----------
    parameters : sequence of StateParameter
    shapes : mapping or None
        Further candidates: name -> direction (parameter -> change per unit of size), with a prior standard deviation
        of the size of ``CALIBRATION.dip_sd``.

    Returns
    -------
    list of ChangeEffect
    """
    changing = {group for group, _ in CALIBRATION.least_sizes}
    candidates = [(p.name, {p.name: 1.0}, CALIBRATION.change_sds * p.sd) for p in parameters if p.group in changing]
    candidates += [(name, dict(direction), CALIBRATION.dip_sd) for name, direction in (shapes or {}).items()]
    return [ChangeEffect(name, d, sd, grows) for name, d, sd in candidates for grows in (False, True)]


def answers_after_visits(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
    first: int = 1,
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

    Returns
    -------
    list of ModelAnswer
        Two for each visit, in the order of time.
    """
    ordered = sorted(visits, key=lambda v: (v.time, v.visit))
    answers = []
    for n in range(first, len(ordered) + 1):
        change = change_answer(parameters, ordered[:n], events, candidates, threshold, margin)
        before = _visits_before(ordered[:n], change)
        answers += [change, file_answer(parameters, before, events, ordered[n - 1].visit, candidates, threshold)]
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

    Returns
    -------
    ModelAnswer
        "unknown" if the last visit differs from all before, and no candidate has the evidence of a name.
    """
    visit = visits[-1].visit
    history = estimate_history(parameters, visits, events, repeats_between_visits=False, accepted=None)
    evidence = compare_onsets(history, candidates)
    price = float(np.log(max(len(candidates), 1)))
    by_name = {p.name: p for p in parameters}
    least = threshold + price
    material = [e for e in evidence if e.gain > least - margin and _is_material(e, by_name)]
    if material:  # the belief takes some visits to follow what was there from the first
        from_first, *_ = evidence_from_first(parameters, history, [e.effect for e in material])
        material = [e for e, gain in zip(material, from_first) if e.gain >= gain]
    if not material or material[0].gain < least:
        return _answer_without_name(history, visit, by_name)
    best = material[0]
    names = [_name(best, by_name)]
    if names == ["local_ballast"] and best.size[0] < 0.0:
        names = _supported_names(parameters, visits, events, best, margin)
    rivals = [_name(e, by_name) for e in material if e.gain > best.gain - margin]
    names += [name for name in dict.fromkeys(rivals) if name not in names and name != _name(best, by_name)]
    parameter = by_name.get(best.effect.name)
    size, sd = best.size
    return ModelAnswer(
        visit, CHANGE, "named" if len(names) == 1 else "a_or_b", tuple(names[:2]), best.effect.name,
        parameter.group if parameter else "dip", position_of(best.effect.name, parameter), size, sd,
        parameter.unit if parameter else "m", best.interval(), best.gain - price, best.effect.grows,
    )  # fmt: skip


def position_of(name: str, parameter: StateParameter | None) -> float | None:
    """Position of a candidate [m]: that of its parameter, or the number behind "@" or "at" in its name.

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
    number = re.search(r"(?:@| at )(-?\d+(?:\.\d+)?)", name)
    return float(number.group(1)) if number else None


def _name(evidence: OnsetEvidence, by_name: Mapping[str, StateParameter]) -> str:
    parameter = by_name.get(evidence.effect.name)
    return NAMES[parameter.group if parameter else "dip"]


def _is_material(evidence: OnsetEvidence, by_name: Mapping[str, StateParameter]) -> bool:
    """Whether the present size causes any action: of growth, that since its most probable onset."""
    parameter = by_name.get(evidence.effect.name)
    least = dict(CALIBRATION.least_sizes)[parameter.group] if parameter else CALIBRATION.least_dip
    start = evidence.times[int(np.argmax(evidence.gains))]
    elapsed = float(evidence.times[-1] - start) if evidence.effect.grows else 1.0
    return abs(evidence.size[0]) * elapsed >= least


def _supported_names(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    best: OnsetEvidence,
    margin: float,
) -> list[str]:
    """Names of softer ballast: a gap is felt by impacts on the unloaded track, and less by trains that close it.

    In one fit trains have a size of their own: that of impacts, or the shares of it that a gap leaves, which are
    equally probable before. The prior of the size is so wide that it favours none: without trains, or without impacts,
    the evidence decides nothing.
    """
    (name,) = best.effect.direction
    felt = next(p for p in parameters if p.name == name)
    offset = replace(felt, name=f"{name} as trains feel it", mean=0.0)
    opened = [replace(e, opened={**e.opened, offset.name: e.opened[name]}) if name in e.opened else e for e in events]
    split = [replace(v, groups=tuple(_with_offset(g, name, offset.name) for g in v.groups)) for v in visits]
    history = estimate_history([*parameters, offset], split, opened, repeats_between_visits=False, accepted=None)
    sd = CALIBRATION.gap_size_sds * max(best.effect.sd, abs(best.size[0]))
    effects = [
        ChangeEffect(f"{share:g}", {name: 1.0, offset.name: share - 1.0}, sd, best.effect.grows)
        for share in (1.0, *CALIBRATION.gap_shares)
    ]
    gains = {e.effect.name: e.gain for e in compare_onsets(history, effects)}
    equal, *of_gaps = (gains[e.name] for e in effects)
    difference = float(np.logaddexp.reduce(of_gaps)) - float(np.log(len(of_gaps))) - equal
    if abs(difference) < margin:
        return ["local_ballast", "hanging_sleeper"]
    return ["hanging_sleeper"] if difference > 0.0 else ["local_ballast"]


def _with_offset(group: GroupInformation, name: str, offset: str) -> GroupInformation:
    """Information of trains on the sum of a parameter and its ``offset``; that of impacts as it is."""
    if IMPACTS in group.group or name not in group.names:
        return group
    k, n = group.names.index(name), len(group.names)
    terms = np.vstack([np.eye(n), np.eye(n)[k]])  # (n + 1, n)
    return replace(
        group, names=(*group.names, offset), matrix=terms @ group.matrix @ terms.T, vector=terms @ group.vector
    )  # fmt: skip


def _answer_without_name(history: History, visit: str, by_name: Mapping[str, StateParameter]) -> ModelAnswer:
    """ "none", or "unknown" if the last visit differs from all before."""
    innovation = history.steps[-1].innovation
    if len(history.steps) < 2 or innovation.is_expected:
        return ModelAnswer(visit, CHANGE, "none")
    parameter = by_name.get(innovation.parameter)
    return ModelAnswer(
        visit, CHANGE, "unknown", (), innovation.parameter, parameter.group if parameter else "",
        position_of(innovation.parameter, parameter),
    )  # fmt: skip


def file_answer(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    visit: str,
    candidates: Sequence[ChangeEffect] = (),
    threshold: float = np.inf,
) -> ModelAnswer:
    """What differs from the file, the clearest deviation first; without one, a dip that was there from the first visit.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
        Those that lie before any change.
    events : sequence of Event
    visit : str
        Visit after which the answer is given.
    candidates : sequence of ChangeEffect
        As ``change_candidates``. Those of more than one parameter are asked.
    threshold : float
        Evidence that such a candidate needs. [nats]

    Returns
    -------
    ModelAnswer
    """
    history = estimate_history(parameters, visits, events, accepted=None)
    deviations = deviations_from_file(history.belief, parameters, dict(CALIBRATION.least_sizes))
    if not deviations:
        return _dip_answer(parameters, history, visit, candidates, threshold)
    first: Deviation = deviations[0]
    by_name = {p.name: p for p in parameters}
    middle = None if first.positions is None else 0.5 * sum(first.positions)
    position = middle if middle is not None else position_of(first.names[0], by_name[first.names[0]])
    return ModelAnswer(
        visit, FILE, "named", (NAMES[first.group],), ", ".join(first.names), first.group,
        position, first.size, first.sd, first.unit,
    )  # fmt: skip


def _dip_answer(
    parameters: Sequence[StateParameter],
    history: History,
    visit: str,
    candidates: Sequence[ChangeEffect],
    threshold: float,
) -> ModelAnswer:
    """A dip in the running surface of which the file says nothing: it raises many waves together."""
    shapes = [c for c in candidates if len(c.direction) > 1 and not c.grows]
    nothing = ModelAnswer(visit, FILE, "none")
    if not shapes:
        return nothing
    gain, size, sd = evidence_from_first(parameters, history, shapes)
    gain = gain - np.log(len(shapes))
    k = int(np.argmax(gain))
    if gain[k] < threshold or abs(size[k]) < CALIBRATION.least_dip:
        return nothing
    name = shapes[k].name
    return ModelAnswer(
        visit, FILE, "named", (NAMES["dip"],), name, "dip", position_of(name, None), float(size[k]), float(sd[k]), "m",
        None, float(gain[k]),
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
    prior, belief = Belief.of_file(parameters), history.belief
    precision = np.linalg.inv(belief.covariance)
    score = precision @ (belief.mean - prior.mean)  # information vector about the mean of the file
    scaled = prior.sd[:, None] * precision * prior.sd - np.eye(len(names))
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    informed = eigenvalues > CALIBRATION.min_prior_share  # not what an event made less certain than the file
    w, vectors = eigenvalues[informed], vectors[:, informed]
    directions = np.array([[c.direction.get(name, 0.0) for name in names] for c in candidates]) / prior.sd @ vectors
    information = directions**2 @ (w / (1.0 + w))
    b = directions @ (vectors.T @ (prior.sd * score) / (1.0 + w))
    variance = np.array([c.sd**2 for c in candidates])
    sizes, sds = b / (information + 1.0 / variance), 1.0 / np.sqrt(information + 1.0 / variance)
    return 0.5 * b * sizes - 0.5 * np.log1p(variance * information), sizes, sds
