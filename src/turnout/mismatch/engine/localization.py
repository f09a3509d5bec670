"""Localization of a residual that has no name: position, channel, wheel or clock, by evidence for linear subspaces.

A cause that is fixed to a position acts by a force there. Whatever the force is, its effect on all sensors lies in the
subspace of the track's transfer functions from that position. A cause of some length acts at neighbouring positions. A
fault of a channel lies in the channel, a disturbance of one recording in all its channels at once. The evidence for
each is in ``space_evidence``.

A force at a position is nearly one at the position beside it, and errors of the model resemble such forces. A single
component with an unusual value has a sharper position (``component_evidence``), where there is enough evidence for one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.channel_levels import worst_channel_excess
from turnout.mismatch.engine.component_evidence import (
    evidence_by_position,
    evidence_of_a_changed_stretch,
    evidence_of_any_component,
    local_changes,
    local_deviations,
)
from turnout.mismatch.engine.space_evidence import SpaceEvidence, weigh_spaces
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.strained_values import StrainedValue


@dataclass(frozen=True)
class Location:
    """Location of a residual.

    ``frame`` and ``level`` with the largest evidence ``nats``; ``level`` None is the whole track. ``place`` is the
    middle of ``low`` to ``high`` [m], ``sensor``, ``train`` and ``axle`` if it has them. ``next_best`` frame -> nats of
    the other frames. ``measured_range`` first and last position of sensors and impacts [m]: beyond them positions
    cannot be distinguished.
    """

    frame: str
    level: Any
    nats: float
    place: float | None = None
    low: float | None = None
    high: float | None = None
    sensor: str | None = None
    train: str | None = None
    axle: int | None = None
    next_best: dict[str, float] = field(default_factory=dict)
    measured_range: tuple[float, float] = (float("-inf"), float("inf"))

    def __str__(self) -> str:
        if self.place is not None and not self.measured_range[0] <= self.place <= self.measured_range[1]:
            before = self.place < self.measured_range[0]
            end = self.measured_range[0] if before else self.measured_range[1]
            return f"{'before' if before else 'beyond'} {end:.1f} m, at an unknown distance"
        if self.place is not None:
            return f"at {self.place:.1f} m, between {self.low:.1f} and {self.high:.1f} m"
        if self.axle is not None:
            return f"on axle {self.axle} of {self.train}"
        if self.train is not None:
            return f"on {self.train}"
        if self.sensor is not None:
            return f"in channel {self.sensor}"
        text = _FRAME_TEXTS.get(self.frame) if self.level is not None else None
        return text.format(level=self.level) if text else "along the whole track"


# Text of a location without position, train and sensor. A cause in any other frame acts along the whole track.
_FRAME_TEXTS = {
    "clock": "in all channels of the recording {level}",
    "condition": "in the recordings of {level}",
    "wavelength": "along the rail, at the wavelength {level}",
}


def locate(
    case: Case,
    fit: Fit,
    leader: Score | None = None,
    cause: str = "",
    absorbed: StrainedValue | None = None,
    threshold: float = MismatchSettings.threshold,
) -> Location | None:
    """Location of the residual of a fit.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    leader : Score or None
        The best candidate that got no name.
    cause : str
        "clock", "train" or "all trains" if recordings that were not fitted are the cause of the verdict: they give the
        location then. All trains together give none.
    absorbed : StrainedValue or None
        The value of the base model that has absorbed the cause. What it is fixed to is the location, unless the
        residual is above the control level and has more evidence for one location over all others than the value has
        paid. A value that is fixed to nothing may stand for a cause anywhere, and the residual may be that of intact
        recordings: its own level is then the least noise, where it is below theirs.
    threshold : float
        Evidence from which an unusual component of a fit without effects gives the position instead of the residual,
        beyond what the cause may leave in the values of other components. [nats]

    Returns
    -------
    Location or None
        None if the case has no residual spaces, or none of them exceeds the least noise, or the evidence for a
        position is what intact turnouts leave as well.
    """
    if cause == "clock":
        names = ", ".join(d.name for d in case.disturbed_recordings)
        return Location("clock", names, max(d.excess for d in case.disturbed_recordings))
    if cause == "all trains":
        return None
    if cause == "train":
        return Location("train", case.mismatched_trains[0], 0.0, train=case.mismatched_trains[0])
    floor = {name: case.control_level.get(name, 1.0) for name in fit.level}
    if absorbed is not None and absorbed.nuisance.at is None:
        # what intact recordings leave elsewhere is no noise here: the whole fit leaves less
        floor = {name: min(level, fit.level[name]) for name, level in floor.items()}
    ranked = sorted(_credible_evidence(case, fit, weigh_spaces(case, fit, floor)), key=lambda w: -w.nats)
    if absorbed is not None and absorbed.nuisance.at is not None:
        is_intact = all(fit.level[name] <= level for name, level in floor.items())
        if (is_intact and worst_channel_excess(case, fit) <= 1.0) or _lead(ranked) < absorbed.nats:
            ranked = [SpaceEvidence(*absorbed.nuisance.at, absorbed.nats)]
    if (
        leader is not None
        and leader.explained >= THRESHOLDS.min_explained_share
        and (not ranked or leader.gain > ranked[0].nats)
    ):
        return replace(_location_of_candidate(leader), measured_range=case.measured_range)
    if not ranked:
        return None
    strongest = ranked[0]
    if strongest.frame == "place" and not fit.candidates:
        component = locate_component(case, fit, threshold + THRESHOLDS.shape_error_share * strongest.nats)
        if component is not None:
            return component
    if strongest.frame == "place" and absorbed is None and strongest.nats < case.place_level:
        return None
    return replace(_location_of_evidence(ranked), measured_range=case.measured_range)


def evidence_left_at(case: Case, fit: Fit, position: float) -> SpaceEvidence | None:
    """Evidence that a force acts at a position in the residual of a fit, if it is larger there than anywhere else.

    The noise is at least that of intact recordings. An effect whose law is only similar to the true one leaves such a
    force where it acts.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    position : float
        [m]

    Returns
    -------
    SpaceEvidence or None
        Of the position or of a stretch around it. None without derivatives, or if another one has more evidence.
    """
    if not fit.jacobian:
        return None
    floor = {name: case.control_level.get(name, 1.0) for name in fit.level}
    strongest = next(iter(weigh_spaces(case, fit, floor, "place")), None)
    if strongest is None or not _ends(strongest.level)[0] <= position <= _ends(strongest.level)[1]:
        return None
    return strongest


def location_of_left_force(case: Case, score: Score) -> Location | None:
    """Location of the force that a rejected name leaves at its own position.

    Parameters
    ----------
    case : Case
    score : Score
        Of the rejected name, which has a position.

    Returns
    -------
    Location or None
        None where ``evidence_left_at`` is None.
    """
    assert score.candidate.position is not None
    left = evidence_left_at(case, score.fit, score.candidate.position)
    return replace(_location_of_evidence([left]), measured_range=case.measured_range) if left else None


def location_of_ambiguity(case: Case) -> Location | None:
    """Location of what the recordings show and cannot tell what it is.

    Parameters
    ----------
    case : Case

    Returns
    -------
    Location or None
        None if there is nothing of the kind.
    """
    u = case.ambiguity()
    if u is None:
        return None
    if u.low is None or u.high is None:
        train, sensor = (u.level if u.frame == frame else None for frame in ("train", "sensor"))
        return Location(u.frame, u.level, u.nats, train=train, sensor=sensor)
    return Location(u.frame, u.level, u.nats, 0.5 * (u.low + u.high), u.low, u.high)


def locate_component(case: Case, fit: Fit, threshold: float) -> Location | None:
    """Location of a component whose value is unusual: between trains and impacts, or among those of its kind.

    A channel that differs between trains and impacts is the location if one filter in the passages has more evidence
    than changes of all components at neighbouring positions.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian, without effects.
    threshold : float
        Least evidence that any component is unusual. [nats]

    Returns
    -------
    Location or None
        By the one of both questions with more evidence. None if neither has enough, or no position is known.
    """
    changes, deviations = local_changes(case, fit), local_deviations(case, fit)
    gains = max((changes, deviations), key=evidence_of_any_component)
    if evidence_of_any_component(gains) <= threshold:
        return None
    ranked = evidence_by_position(gains)
    if gains is changes:
        floor = {name: case.control_level.get(name, 1.0) for name in fit.level}
        ranked = _faults_in_passages(case, fit, weigh_spaces(case, fit, floor, "sensor")) or ranked
    return replace(_location_of_evidence(ranked), measured_range=case.measured_range) if ranked else None


def _faults_in_passages(case: Case, fit: Fit, ranked: Sequence[SpaceEvidence]) -> list[SpaceEvidence]:
    """Channels that all passages show through one filter, the largest evidence first.

    What filters of the other channels explain belongs to the track and is subtracted. The rest must exceed the evidence
    that components at neighbouring positions differ under trains.
    """
    hammer_names = {o.name for o in case.observations if case.is_hammer_test(o)}
    channels = [w for w in ranked if w.frame == "sensor"]
    filters = [sum(x for name, x in w.by_common_law.items() if name not in hammer_names) for w in channels]
    faults = [replace(w, nats=2.0 * nats - sum(filters)) for w, nats in zip(channels, filters)]
    least = max(0.0, evidence_of_a_changed_stretch(case, fit))
    return sorted((w for w in faults if w.nats > least), key=lambda w: -w.nats)


def _lead(ranked: Sequence[SpaceEvidence]) -> float:
    """Evidence for the first location over the best of the others, which do not overlap it. [nats]"""
    if not ranked:
        return 0.0
    first, others = ranked[0], ranked[1:]
    if first.frame == "place":
        low, high = _ends(first.level)
        others = [w for w in others if w.frame != "place" or _ends(w.level)[0] > high or _ends(w.level)[1] < low]
    return first.nats - max((w.nats for w in others), default=0.0)


def _credible_evidence(case: Case, fit: Fit, ranked: Sequence[SpaceEvidence]) -> Iterator[SpaceEvidence]:
    """Evidence that counts: of a wheel or a train, less that of other trains, which belongs to the rail; of a channel,
    if impacts, if any, support it; of a channel at fault in the passages alone.
    """
    hammer_names = {o.name for o in case.observations if case.is_hammer_test(o)}
    unsupported = []
    for w in ranked:
        nats = w.nats
        if w.frame in ("wheel", "train"):
            others = (v.nats for v in ranked if v.frame == w.frame and _train_of(v) != _train_of(w))
            nats -= max(others, default=0.0)
        if w.frame == "sensor" and hammer_names:
            if sum(w.by_space.get(name, 0.0) for name in hammer_names) < THRESHOLDS.min_hammer_evidence:
                unsupported.append(w.level)
                continue
        if nats > 0.0:
            yield replace(w, nats=nats)
    if unsupported:
        yield from (w for w in _faults_in_passages(case, fit, ranked) if w.level in unsupported)


def _train_of(evidence: SpaceEvidence) -> Any:
    return evidence.level[0] if evidence.frame == "wheel" else evidence.level


def _location_of_candidate(score: Score) -> Location:
    where, position = score.candidate.where, score.candidate.position
    level = f"{where['wavelength']:.3f} m" if "wavelength" in where else score.candidate.key if where else None
    sensor, train, axle = (where.get(name) for name in ("sensor", "train", "axle"))
    low, high = score.possible_positions or (position, position)
    frame = score.candidate.frame if sensor is None else "sensor"  # which part of the sensor is at fault was rejected
    return Location(frame, level, score.gain, position, low, high, sensor, train, axle)


def _location_of_evidence(ranked: Sequence[SpaceEvidence]) -> Location:
    strongest, by_frame = ranked[0], dict[str, float]()
    for w in ranked:
        by_frame.setdefault(w.frame, w.nats)
    fields: dict[str, Any] = {"next_best": {k: round(v, 1) for k, v in by_frame.items() if k != strongest.frame}}
    if strongest.frame == "place":
        stretches = [
            _ends(w.level)
            for w in ranked
            if w.frame == "place" and strongest.nats - w.nats < THRESHOLDS.position_margin
        ]
        low, high = min(first for first, _ in stretches), max(last for _, last in stretches)
        fields |= {"place": round(0.5 * (low + high), 3), "low": low, "high": high}
    elif strongest.frame == "wheel":
        fields |= {"train": strongest.level[0], "axle": strongest.level[1]}
    elif strongest.frame in ("sensor", "train"):
        fields[strongest.frame] = strongest.level
    return Location(strongest.frame, strongest.level, strongest.nats, **fields)


def _ends(level: float | tuple[float, float]) -> tuple[float, float]:
    """First and last position of a level of "place". [m]"""
    return level if isinstance(level, tuple) else (level, level)
