r"""Stiffness under load: under trains it may differ from that under impacts on the unloaded track.

Pads and ballast stiffen under load (Wu and Thompson 1999, Proc. IMechE F 213). Passages then determine the sum of the
value of a parameter and of an offset that impacts do not have. No further simulation is needed:

.. math:: x_{train} = x + o, \quad \Lambda' = T^T \Lambda T, \quad T = (1, 1)

A constant offset may be an error of the model. That of all pads, or of all ballast, has the prior of an effect. That
of one support has the scatter of supports, also where the tolerance of the file is larger. So only a difference between
visits is evidence of a change.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.calibrated.belief import StateParameter, scatter_sd
from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence, change_sd, compare_onsets
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import Event, estimate_history
from turnout.mismatch.calibrated.information import GroupInformation, VisitInformation
from turnout.mismatch.calibrated.levels import IMPACTS, kind_of
from turnout.mismatch.calibrated.model_answer import NAMES

END = " under trains"  # of the name of an offset
DAMPER_SHARE = 0.5  # change of the logarithm of the damping over that of the stiffness, as of other effects


@dataclass(frozen=True)
class Law:
    """An effect under trains alone: ``group`` of the candidate, name of the ``spring`` and of its ``damper``.

    The names are the first part of those of the parameters. A local one has a position behind "@".
    """

    group: str
    spring: str
    damper: str

    @property
    def is_local(self) -> bool:
        """Whether each support has its own."""
        return self.spring.endswith("@")


LAWS = (
    Law("preload", "pad_stiffness", "pad_damping"),
    Law("hardening", "ballast_stiffness", "ballast_damping"),
    Law("pad", "pad@", "pad_damper@"),
)


def is_under_load(effect: ChangeEffect) -> bool:
    """Whether the effect acts under trains and not under impacts.

    Parameters
    ----------
    effect : ChangeEffect

    Returns
    -------
    bool
    """
    return all(name.endswith(END) for name in effect.direction)


def _springs(parameters: Sequence[StateParameter]) -> Iterator[tuple[Law, StateParameter, StateParameter | None]]:
    """(law, spring, damper) of everything that may differ under load."""
    by_name = {p.name: p for p in parameters}
    for law in LAWS:
        for p in parameters:
            route, _, name = p.name.rpartition(" ")
            if (name.startswith(law.spring) and p.may_change) if law.is_local else name == law.spring:
                damper = f"{route} {name.replace(law.spring, law.damper)}".strip()
                yield law, p, by_name.get(damper)


def with_offsets(
    parameters: Sequence[StateParameter], visits: Sequence[VisitInformation]
) -> tuple[list[StateParameter], list[VisitInformation]]:
    """The parameters and the offsets of those that may differ under load, and what the visits tell of both.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation

    Returns
    -------
    parameters : list of StateParameter
        The offsets are last.
    visits : list of VisitInformation
        Trains inform on the sums. Without trains, or without impacts, nothing is known of an offset.
    """
    offsets = {}
    for law, spring, damper in _springs(parameters):
        for p, share in ((spring, 1.0), (damper, DAMPER_SHARE)):
            if p is not None:
                sd = scatter_sd(p, parameters) if law.is_local else share * CALIBRATION.load_effect_sd
                offsets[p.name] = StateParameter(
                    p.name + END, 0.0, sd, 0.0, "under load", None, p.position, p.unit, 0.0, False
                )
    return [*parameters, *offsets.values()], [
        replace(v, groups=tuple(_with_sums(g, offsets) for g in v.groups)) for v in visits
    ]


def _with_sums(group: GroupInformation, offsets: Mapping[str, StateParameter]) -> GroupInformation:
    felt = [k for k, name in enumerate(group.names) if name in offsets]
    if kind_of(group.group) == IMPACTS or not felt:
        return group
    n = len(group.names)
    terms = np.vstack([np.eye(n), np.eye(n)[felt]])  # (n + n_offset, n)
    names = (*group.names, *(offsets[group.names[k]].name for k in felt))
    return replace(group, names=names, matrix=terms @ group.matrix @ terms.T, vector=terms @ group.vector)


def with_evidence_under_load(
    evidence: Sequence[OnsetEvidence],
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    levels: Mapping[str, float] | None = None,
) -> list[OnsetEvidence]:
    """Evidence of changes, and of those under trains alone, the strongest first.

    Parameters
    ----------
    evidence : sequence of OnsetEvidence
        As ``compare_onsets``.
    parameters : sequence of StateParameter
        Without offsets.
    visits : sequence of VisitInformation
    events : sequence of Event
    candidates : sequence of ChangeEffect
        Those that are not under load are ignored.
    levels : mapping or None
        As in ``estimate_history``.

    Returns
    -------
    list of OnsetEvidence
    """
    under_load = [c for c in candidates if is_under_load(c)]
    if not under_load:
        return list(evidence)
    history = estimate_history(
        *with_offsets(parameters, visits), events,
        repeats_between_visits=False, accepted=None, levels=levels,
        constant_errors=bool(levels),
    )  # fmt: skip
    return sorted([*evidence, *compare_onsets(history, under_load)], key=lambda e: -e.gain)


def is_all_explained(
    parameters: Sequence[StateParameter], visits: Sequence[VisitInformation], events: Sequence[Event], since: float
) -> bool:
    """Whether the visits after a time are as expected with ``events``, in all and at each parameter.

    An effect under trains alone is near to many others: it is named only if nothing else has changed.

    Parameters
    ----------
    parameters : sequence of StateParameter
        With their offsets.
    visits : sequence of VisitInformation
    events : sequence of Event
        With the effect.
    since : float
        Time of the last visit without the effect. [years]

    Returns
    -------
    bool
    """
    history = estimate_history(parameters, visits, events, repeats_between_visits=False, accepted=None)
    return all(s.innovation.is_expected for s in history.steps if s.time > since)


def candidates_under_load(parameters: Sequence[StateParameter], without: Collection[str] = ()) -> list[ChangeEffect]:
    """Steps and growth of what changes under trains and not under impacts.

    Parameters
    ----------
    parameters : sequence of StateParameter
        With or without their offsets.
    without : collection of str
        Names of effects that are left out.

    Returns
    -------
    list of ChangeEffect
    """
    candidates = []
    for law, spring, damper in _springs([p for p in parameters if not p.name.endswith(END)]):
        if NAMES[law.group] in without:
            continue
        direction = {spring.name + END: 1.0} | ({damper.name + END: DAMPER_SHARE} if damper else {})
        sd = change_sd(spring, parameters) if law.is_local else CALIBRATION.load_effect_sd
        name = f"{spring.name} under load"
        candidates += [ChangeEffect(name, direction, sd, g, law.group, spring.position) for g in (False, True)]
    return candidates
