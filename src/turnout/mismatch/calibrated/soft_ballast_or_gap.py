"""Softer ballast, or a hanging sleeper? Trains that close a gap, and the damper of the support, tell them apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from turnout.mismatch.calibrated.belief import StateParameter, scatter_sd
from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence, compare_onsets
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import evidence_from_first
from turnout.mismatch.calibrated.history import Event, estimate_history
from turnout.mismatch.calibrated.information import GroupInformation, VisitInformation
from turnout.mismatch.calibrated.levels import IMPACTS, kind_of

SOFT, GAP = NAMES = ("local_ballast", "hanging_sleeper")
SPRING, DAMPER = "ballast", "ballast_damper"  # groups of parameters of one support


def names_of_softer_ballast(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    leader: OnsetEvidence | ChangeEffect,
    size: tuple[float, float],
    margin: float,
    levels: Mapping[str, float] | None = None,
) -> list[str]:
    """Which names softer ballast may have: both where the evidence of one over the other is within the margin.

    A sleeper certainly hangs where less of the stiffness is left than ballast has that carries anything.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
    events : sequence of Event
    leader : OnsetEvidence or ChangeEffect
        An effect without onsets is one of the first visit.
    size : (float, float)
        Present size and its standard deviation. [ln]
    margin : float
        [nats]
    levels : mapping of str to float or None
        As in ``estimate_history``.

    Returns
    -------
    list of str
        One or both of ``NAMES``.
    """
    if size[0] + CALIBRATION.finding_sds * size[1] < np.log(CALIBRATION.least_support):
        return [GAP]
    evidence = evidence_of_gap(parameters, visits, events, leader, size[0], levels)
    if abs(evidence) <= margin:
        return list(NAMES)
    return [GAP if evidence > 0.0 else SOFT]


def evidence_of_gap(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    leader: OnsetEvidence | ChangeEffect,
    size: float,
    levels: Mapping[str, float] | None = None,
) -> float:
    r"""Evidence of a hanging sleeper over softer ballast, in one fit of impacts and trains.

    - *A softer bed* is alike under impacts and trains. Its damper loses any share of what the logarithm of the
      stiffness loses: ``CALIBRATION.soft_damper_shares`` are equally probable before.
    - *Beside a gap* only a share s of the bed bears the unloaded sleeper. Stiffness and damping are both
      proportional to the area in contact, so both become s times what they were: their logarithms change alike.
      Trains close the gap, so it acts less under them, or as much where none closes it: ``CALIBRATION.gap_shares`` are
      equally probable before.

    An error of the model that is the same at all visits cancels in a change, and not in an effect of the first visit.
    The prior of the size is so wide that it favours none. Where neither the damper nor trains decide, the evidence is
    small: a gap that no train closes acts as a bed that has lost as much damping as stiffness.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
    events : sequence of Event
    leader : OnsetEvidence or ChangeEffect
        An effect without onsets is one of the first visit.
    size : float
        Present size. [ln]
    levels : mapping of str to float or None
        As in ``estimate_history``.

    Returns
    -------
    float
        [nats]
    """
    effect = leader.effect if isinstance(leader, OnsetEvidence) else leader
    springs, dampers = _supports_of(effect, parameters)
    offsets = {
        p.name: replace(p, name=f"{p.name} under trains", mean=0.0, sd=scatter_sd(p, parameters))
        for p in (*springs, *dampers)
    }
    sd = CALIBRATION.gap_size_sds * max(effect.sd, abs(size))

    def change(damper_share: float, train_share: float) -> ChangeEffect:
        felt = {p.name: 1.0 for p in springs} | {p.name: damper_share for p in dampers}
        under_trains = {offsets[name].name: (train_share - 1.0) * d for name, d in felt.items()}
        return ChangeEffect(f"{damper_share:g}, {train_share:g}", felt | under_trains, sd, effect.grows)

    forms = {
        SOFT: [change(share, 1.0) for share in CALIBRATION.soft_damper_shares],
        GAP: [change(1.0, share) for share in CALIBRATION.gap_shares],
    }
    all_parameters = [*parameters, *offsets.values()]
    opened, split = _with_offsets(offsets, events, visits)
    is_change = isinstance(leader, OnsetEvidence)
    history = estimate_history(
        all_parameters, split, opened,
        repeats_between_visits=not is_change, accepted=None, levels=levels,
        constant_errors=is_change and bool(levels),
    )  # fmt: skip
    evidence = {}
    for name, effects in forms.items():
        if is_change:
            gains = np.array([e.gain for e in compare_onsets(history, effects)])
        else:
            gains = evidence_from_first(history, effects)[0]
        evidence[name] = float(np.logaddexp.reduce(gains) - np.log(len(effects)))
    return evidence[GAP] - evidence[SOFT]


def _supports_of(
    effect: ChangeEffect, parameters: Sequence[StateParameter]
) -> tuple[list[StateParameter], list[StateParameter]]:
    """Springs that an effect changes, and all dampers of their supports."""
    springs = [p for p in parameters if p.group == SPRING and p.name in effect.direction]
    names = {p.name.replace(f"{SPRING}@", f"{DAMPER}@") for p in springs}
    return springs, [p for p in parameters if p.group == DAMPER and p.name in names]


def _with_offsets(
    offsets: Mapping[str, StateParameter], events: Sequence[Event], visits: Sequence[VisitInformation]
) -> tuple[list[Event], list[VisitInformation]]:
    """Events that open offsets under trains as they open parameters, and the visits with trains of their own."""
    opened, split = list(events), list(visits)
    for name, offset in offsets.items():
        opened = [
            replace(e, opened={**e.opened, offset.name: e.opened[name]}) if name in e.opened else e for e in opened
        ]
        split = [replace(v, groups=tuple(_with_offset(g, name, offset.name) for g in v.groups)) for v in split]
    return opened, split


def _with_offset(group: GroupInformation, name: str, offset: str) -> GroupInformation:
    """Information of trains on the sum of a parameter and its ``offset``; that of impacts as it is."""
    if kind_of(group.group) == IMPACTS or name not in group.names:
        return group
    k, n = group.names.index(name), len(group.names)
    terms = np.vstack([np.eye(n), np.eye(n)[k]])  # (n + 1, n)
    return replace(
        group, names=(*group.names, offset), matrix=terms @ group.matrix @ terms.T, vector=terms @ group.vector
    )  # fmt: skip
