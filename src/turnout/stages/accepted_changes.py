"""Accepted changes: entries of ``terms`` with a date in a turnout's track file, which open its calibrated model.

An accepted change is process noise: between its onset and the visit at which it was found, the effect may take any size
at its position. What the turnout does afterwards is compared with the changed state.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config.events import day_problem
from turnout.errors import SimulationError
from turnout.mismatch.calibrated import ChangeEffect, Event, StateParameter, VisitInformation
from turnout.mismatch.calibrated.belief import ACCEPTED_EFFECT
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import BEFORE_ALL
from turnout.mismatch.calibrated.model_answer import NAMES, free_shape, group_of, position_of
from turnout.mismatch.calibrated.stiffness_under_load import LAWS
from turnout.stages.accepted_effects import SINCE, AcceptedEffect
from turnout.stages.visit_time import years_of

if TYPE_CHECKING:
    from turnout.config.parameters import ParameterSet

ENTRY_KEYS = ("term", "first", "last", SINCE, "until", "accepted", "note")
MAX_DISTANCE = 0.35  # m from an end of the change to a candidate: the same support
NOT_ACCEPTED = {NAMES[law.group] for law in LAWS if not law.is_local}  # effects of the whole track under load
GROUPS = {name: tuple(g for g, n in NAMES.items() if n == name) for name in NAMES.values() if name not in NOT_ACCEPTED}
GROUPS["hanging_sleeper"] = GROUPS["local_ballast"]
SURFACE = "surface_dip"


@dataclass(frozen=True)
class AcceptedChange:
    """A change of the effect ``term`` from ``first`` to ``last`` [m], after the time ``since`` up to ``until`` [years].

    ``since`` is the last visit without it. ``until`` is the first visit with it, or that of the finding if it grows.
    """

    term: str
    first: float
    last: float
    since: float
    until: float

    @property
    def words(self) -> str:
        """Effect and position."""
        stretch = f"at {self.first:.1f} m" if self.first == self.last else f"from {self.first:.1f} to {self.last:.1f} m"
        return f"{self.term.replace('_', ' ')} {stretch}"

    def has(self, effect: ChangeEffect, by_name: Mapping[str, StateParameter]) -> bool:
        """Whether a candidate is this effect at this position.

        Parameters
        ----------
        effect : ChangeEffect
        by_name : mapping of str to StateParameter

        Returns
        -------
        bool
        """
        position = effect.position
        if position is None:
            position = position_of(effect.name, by_name.get(effect.name))
        reach = CALIBRATION.nose_reach if self.term == SURFACE else MAX_DISTANCE
        is_near = position is not None and self.first - reach <= position <= self.last + reach
        return is_near and group_of(effect, by_name) in GROUPS[self.term]


def changes_of(entries: Iterable[ParameterSet]) -> tuple[AcceptedChange, ...]:
    """Accepted changes among the entries of ``TurnoutTrack.terms``.

    Parameters
    ----------
    entries : iterable of ParameterSet

    Returns
    -------
    tuple of AcceptedChange

    Raises
    ------
    SimulationError
        An entry names an effect that the calibrated model does not follow, or its dates cannot be read.
    ConfigError
        A key is missing or unknown.
    """
    changes = []
    for entry in entries:
        if SINCE not in entry:
            continue
        entry.allow_only(*ENTRY_KEYS)
        where = f"{entry.place.path}, {entry.place.entry}"
        term = str(entry["term"])
        if term not in GROUPS:
            raise SimulationError(f"{where}: no change of {term!r} can be accepted; {', '.join(sorted(GROUPS))} can.")
        for key in (SINCE, "until"):
            text = str(entry[key])
            if problem := day_problem(text if len(text) > len("2026-04") else f"{text}-15"):
                raise SimulationError(f"{where}: {key} is {text!r}{problem[0]}. {problem[1]}.")
        since, until = (years_of(str(entry[key])) for key in (SINCE, "until"))
        first, last = entry.number("first", "m"), entry.number("last", "m")
        if until <= since or last < first:
            raise SimulationError(f"{where}: the end lies before the beginning.")
        changes.append(AcceptedChange(term, first, last, since, until))
    return tuple(changes)


def change_events(
    changes: Iterable[AcceptedChange],
    parameters: Sequence[StateParameter],
    candidates: Sequence[ChangeEffect],
    visits: Iterable[VisitInformation],
) -> list[Event]:
    """Process noise of accepted changes: each candidate at their positions, at each visit from onset to finding.

    Parameters
    ----------
    changes : iterable of AcceptedChange
    parameters : sequence of StateParameter
    candidates : sequence of ChangeEffect
        As ``change_candidates``.
    visits : iterable of VisitInformation

    Returns
    -------
    list of Event
    """
    by_name, events = {p.name: p for p in parameters}, []
    times = [v.time for v in visits]
    for change in changes:
        shapes = [
            shape
            for c in candidates
            if not c.grows and change.has(c, by_name)
            for shape in free_shape(c, parameters, candidates)
        ]
        distinct = {tuple(sorted(direction.items())): sd for direction, sd in shapes}
        within = {t for t in times if change.since < t <= change.until} | {change.until}
        events += [Event(t, {}, dict(d), sd) for t in sorted(within) for d, sd in distinct.items()]
    return events


def effect_events(
    effects: Iterable[AcceptedEffect], parameters: Sequence[StateParameter], visits: Iterable[VisitInformation]
) -> list[Event]:
    """Process noise of accepted effects: until their acceptance, their values may differ from visit to visit.

    A diagnosis of one visit does not tell since when the turnout has the effect. Earlier visits may lack it.

    Parameters
    ----------
    effects : iterable of AcceptedEffect
    parameters : sequence of StateParameter
    visits : iterable of VisitInformation

    Returns
    -------
    list of Event
    """
    times, events = [v.time for v in visits], []
    for effect in effects:
        if effect.until is None:
            continue
        opened = {
            p.name: CALIBRATION.change_sds * p.sd
            for p in parameters
            if p.group == ACCEPTED_EFFECT
            and effect.is_on(p.route)
            and p.name.removeprefix(f"{p.route} ").startswith((f"{effect.key}.", f"{effect.key} ("))
        }
        if opened:
            events += [Event(t, opened) for t in (BEFORE_ALL, *(t for t in times if t <= effect.until))]
    return events


def further_candidates(
    changes: Sequence[AcceptedChange], parameters: Sequence[StateParameter], candidates: Sequence[ChangeEffect]
) -> list[ChangeEffect]:
    """Candidates of further changes: those of an accepted change begin after it.

    Parameters
    ----------
    changes : sequence of AcceptedChange
    parameters : sequence of StateParameter
    candidates : sequence of ChangeEffect

    Returns
    -------
    list of ChangeEffect
        In the same order.
    """
    by_name = {p.name: p for p in parameters}
    ends = [max((change.until for change in changes if change.has(c, by_name)), default=-np.inf) for c in candidates]
    return [replace(c, not_before=float(end)) for c, end in zip(candidates, ends)]


def without_accepted(
    changes: Sequence[AcceptedChange],
    parameters: Sequence[StateParameter],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
) -> tuple[list[StateParameter], list[Event], list[ChangeEffect]]:
    """Parameters, events and candidates for the comparison with the file, in which an accepted change does not deviate.

    Parameters
    ----------
    changes : sequence of AcceptedChange
    parameters : sequence of StateParameter
    events : sequence of Event
    candidates : sequence of ChangeEffect

    Returns
    -------
    parameters : list of StateParameter
        Those of accepted changes have ``may_change`` false.
    events : list of Event
        The file itself is uncertain where a change was accepted. Else its neighbours would take a share of it.
    candidates : list of ChangeEffect
        Those at other positions, or of another effect.
    """
    by_name = {p.name: p for p in parameters}
    accepted = {c.name for c in candidates if any(change.has(c, by_name) for change in changes)}
    compared = [replace(p, may_change=p.may_change and p.name not in accepted) for p in parameters]
    of_file = [replace(e, time=BEFORE_ALL) for e in change_events(changes, parameters, candidates, [])]
    return compared, [*events, *of_file], [c for c in candidates if c.name not in accepted]


def check_change(row: Mapping[str, Any], anyway: bool) -> None:
    """Raise an error for a change that cannot be accepted.

    Parameters
    ----------
    row : mapping
        Row of ``change_findings``.
    anyway : bool
        Whether one that is not named may be accepted.

    Raises
    ------
    SimulationError
        It has no effect, no position or no onset, or it is not named and ``anyway`` is not set.
    """
    prefix = f"{row['turnout_id']}, {row['sections']}: the verdict is {row['verdict'].replace('_', ' ')}"
    if row["term"] not in GROUPS or row["position_m"] is None or row["onset_by_utc"] is None:
        raise SimulationError(f"{prefix}; it has no effect with a position and a beginning that could be accepted.")
    if row["verdict"] != "named" and not anyway:
        raise SimulationError(f"{prefix}; --anyway accepts it all the same.")


def change_text(row: Mapping[str, Any]) -> str:
    """YAML text of the entry of ``terms`` for a change.

    Parameters
    ----------
    row : mapping
        Row of ``change_findings``.

    Returns
    -------
    str
        The entry, with a line break at its end.
    """
    source = f"turnout diagnose, visits up to {row['visit']}, change of {row['sections']}"
    ends = (row["position_m"] if row[key] is None else row[key] for key in ("first_m", "last_m"))
    lines = [f"  - term: {row['term']}"]
    lines += [f'    {key}: {{value: {at:g}, unit: m, source: "{source}"}}' for key, at in zip(("first", "last"), ends)]
    until = row["visit"] if row["grows"] else f"{row['onset_by_utc']:%Y-%m-%d}"
    lines += [f"    {SINCE}: {row['onset_after_utc']:%Y-%m-%d}", f"    until: {until}"]
    lines += [f"    accepted: {datetime.now(UTC):%Y-%m-%d}", f"    note: {json.dumps(row['sentence'])}"]
    return "\n".join(lines) + "\n"
