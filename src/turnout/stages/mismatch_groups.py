"""Group the recordings of a turnout into visits, and the sections of a visit into cases.

A visit is a campaign with the passages around it. Neighbouring sections are one case: sections further apart do not
respond to the same effect.
"""

from __future__ import annotations

import json
from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path
from re import search
from typing import TYPE_CHECKING

from turnout.config import Configuration
from turnout.config.merge import digest
from turnout.config.turnout import TurnoutConfig
from turnout.mismatch.turnout import CampaignInput
from turnout.records import Unit
from turnout.simulate import Sensor, TurnoutTrack
from turnout.stages.mismatch_inputs import Note, VisitInputs
from turnout.stages.recording_choice import (
    MAX_AXLES,
    MAX_PASSAGES,
    MAX_SWITCH_AXLES,
    reserved_names,
    select_passages,
    split_by_length,
)
from turnout.stages.track_files import digest_of_model
from turnout.stages.visit_time import MIDDLE_OF_MONTH, years_of
from turnout.stages.work_days import days_of_work
from turnout.workflow.future_dates import up_to_now
from turnout.workflow.plan import PlannedUnit, read_plan

if TYPE_CHECKING:
    from turnout.config.turnout import Section
    from turnout.mismatch.turnout import PassageInput

MAX_SECTION_GAP = 6.0  # m: sections further apart do not respond to the same sleeper


@dataclass(frozen=True)
class Group:
    """Sections ``labels`` on ``route`` with their ``campaign``.

    ``neighbours`` are these sections and those beside them without a recording.
    """

    labels: tuple[str, ...]
    route: str
    campaign: CampaignInput
    neighbours: tuple[str, ...] = ()


def groups(
    turnout: TurnoutConfig,
    track: TurnoutTrack,
    inputs: VisitInputs,
    only: Sequence[str] = (),
    limits: tuple[int, int] | None = None,
) -> Iterator[Group]:
    """Groups of a visit in order of position; sections without a recording are left out.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    track : TurnoutTrack
        Its track file.
    inputs : VisitInputs
        Recordings of the visit; notes are added.
    only : sequence of str
        Labels of the sections, () for all.
    limits : (int, int) or None
        Largest number of passages of a group, and of all their axles; None: ``MAX_PASSAGES`` and ``MAX_AXLES``, in a
        switch ``MAX_SWITCH_AXLES``.

    Yields
    ------
    Group
    """
    for route, labels in neighbours_of(turnout, only):
        max_axles = MAX_AXLES if track.track_of(route).blade is None else MAX_SWITCH_AXLES
        campaign = _campaign(turnout, track, inputs, route, labels, limits or (MAX_PASSAGES, max_axles))
        if campaign is not None and route not in ("main", *track.routes):
            inputs.notes.append(Note(f"sections {', '.join(labels)}: the track's file has no route {route}; not used"))
        elif campaign is not None:
            yield Group(_measured_labels(turnout, inputs, campaign, labels), route, campaign, tuple(labels))


def neighbours_of(turnout: TurnoutConfig, only: Sequence[str] = ()) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Groups of neighbouring sections on each route, in order of position.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    only : sequence of str
        Labels of the sections of one group, whatever their distance; () for all sections, with gaps up to
        ``MAX_SECTION_GAP``.

    Yields
    ------
    route : str
    labels : tuple of str
    """
    for route in ("main", "diverging"):
        sections = [s for s in turnout.sections if _route(s) == route and (not only or s.label in only)]
        sections.sort(key=lambda s: s.position)
        members: list = []
        for section in sections:
            if members and not only and section.position - members[-1].position > MAX_SECTION_GAP:
                yield route, tuple(s.label for s in members)
                members = []
            members.append(section)
        if members:
            yield route, tuple(s.label for s in members)


def _measured_labels(
    turnout: TurnoutConfig, inputs: VisitInputs, campaign: CampaignInput, labels: Sequence[str]
) -> tuple[str, ...]:
    """Labels of sections with a recording in the campaign."""
    tested = {inputs.sections[t.name] for t in campaign.hammer}
    monitored = {turnout.passages.sections[s.name] for s in campaign.sensors} if turnout.passages else set()
    return tuple(label for label in labels if label in tested | monitored)


def _route(section: Section) -> str:
    return "diverging" if section.track == "diverging" else "main"


def _campaign(
    turnout: TurnoutConfig,
    track: TurnoutTrack,
    inputs: VisitInputs,
    route: str,
    labels: Sequence[str],
    limits: tuple[int, int],
) -> CampaignInput | None:
    tests = tuple(t for t in inputs.tests if inputs.sections[t.name] in labels)
    sensors = _sensors(turnout, labels)
    names = {s.name for s in sensors}
    shared = all(turnout.section(label).track == "both" for label in labels)
    passages = [
        p for p in inputs.passages if (shared or p.route == route) and names & {c.name for c in p.recording.channels}
    ]
    passages = select_passages(split_by_length(passages), *limits)
    recorded = {c.name for p in passages for c in p.recording.channels} & names
    sensors = tuple(s for s in sensors if s.name in recorded)
    if not tests and not passages:
        return None
    if route != "main" and route in track.routes:
        track, passages = _with_main_route(track, route, passages)
    contradicted = tuple(note.contradicted_train for note in inputs.notes if note.contradicted_train)
    return CampaignInput(track, sensors, tests, tuple(passages), reserved_names(passages, tests), contradicted)


def _sensors(turnout: TurnoutConfig, labels: Sequence[str]) -> tuple[Sensor, ...]:
    if turnout.passages is None:
        return ()
    sensors = []
    for channel in turnout.passages.description.channels:
        label = turnout.passages.sections.get(channel.name)
        if label is not None and label in labels and channel.quantity == "acceleration":
            position = channel.position if channel.position is not None else turnout.section(label).position
            sensors.append(Sensor(channel.name, float(position), channel.mounting or "rail head"))
    return tuple(sensors)


def _with_main_route(
    track: TurnoutTrack, route: str, passages: Sequence[PassageInput]
) -> tuple[TurnoutTrack, list[PassageInput]]:
    """(track, passages) with the track of ``route`` as the main one."""
    route_track = track.track_of(route)
    turnout_track = replace(
        track, track=route_track, tracks={"main": route_track}, routes={"main": track.routes[route]}
    )
    return turnout_track, [replace(p, route="main") for p in passages]


MAX_DAYS_TO_CAMPAIGN = 31  # a passage further from every campaign belongs to the visit of its month
N_NEWEST_VISITS = 1  # visits per turnout in the workflow: older ones were diagnosed before


def visits(units: Iterable[Unit], work_days: Sequence[date]) -> dict[str, list[Unit]]:
    """Units by visit, oldest first: a campaign's day with the passages nearest to it, else a month.

    No recorded work lies between the day of a visit, or the middle of its month, and its passages: these show another
    track before the work than after it. Passages between two works with no such day between these are in no visit.
    Nor are recordings that are dated in the future: else one of them would be the newest visit until its day.

    Parameters
    ----------
    units : iterable of Unit
        Units of the scan.
    work_days : sequence of date
        As ``work_days_of``, those of the turnout.

    Returns
    -------
    dict
        Visit -> units.

    Examples
    --------
    >>> def at(kind, label, campaign=None):
    ...     return Unit("t", kind, label, (), "", None, campaign)
    >>> found = visits([at("hammer", "A7/2026-07-25", "2026-07-25"), at("passage", "20260722T084238Z.h5"),
    ...                 at("passage", "20260301T084238Z.h5")], [])
    >>> {name: len(members) for name, members in found.items()}
    {'2026-03': 1, '2026-07-25': 2}

    The same with tamping on July 23: the train of July 22 passed before it.

    >>> found = visits([at("hammer", "A7/2026-07-25", "2026-07-25"), at("passage", "20260722T084238Z.h5")],
    ...                [date(2026, 7, 23)])
    >>> {name: len(members) for name, members in found.items()}
    {'2026-07': 1, '2026-07-25': 1}
    """
    units = up_to_now(units)
    days = sorted({date.fromisoformat(u.campaign) for u in units if u.campaign})
    by_visit: dict[str, list[Unit]] = {}
    for unit in units:
        label = unit.campaign or _visit_of(unit.label, days, work_days)
        if label:
            by_visit.setdefault(label, []).append(unit)
    return dict(sorted(by_visit.items(), key=lambda item: (years_of(item[0]), item[0])))


def _visit_of(label: str, days: Sequence[date], work_days: Sequence[date]) -> str:
    stamp = search(r"(\d{4})(\d\d)(\d\d)T\d{6}Z", label)
    if not stamp:
        return ""
    day = date(*map(int, stamp.groups()))
    epoch = bisect(work_days, day)
    nearest = min((d for d in days if bisect(work_days, d) == epoch), key=lambda d: abs((d - day).days), default=None)
    if nearest is not None and abs((nearest - day).days) <= MAX_DAYS_TO_CAMPAIGN:
        return nearest.isoformat()
    middle = day.replace(day=MIDDLE_OF_MONTH)
    middles = [middle, *((middle + timedelta(days=n)).replace(day=MIDDLE_OF_MONTH) for n in (-31, 31))]
    return next((f"{m:%Y-%m}" for m in middles if bisect(work_days, m) == epoch), "")


def enabled_visit(plan: Path, configuration: Configuration) -> Iterator[PlannedUnit]:
    """Newest visits, as units, of the turnouts with the setting ``mismatch: enabled: true``.

    rules/mismatch.smk composes the name of this function.

    Parameters
    ----------
    plan : Path
        Plan file of a shard.
    configuration : Configuration
        Configuration of the fleet.

    Yields
    ------
    PlannedUnit
    """
    for planned in every_visit(plan, configuration):
        if configuration.turnout(planned.unit.turnout).settings["mismatch"].enabled:
            yield planned


def every_visit(plan: Path, configuration: Configuration) -> Iterator[PlannedUnit]:
    """Newest visits of all turnouts of a plan; their note changes with notes, track and vehicle files.

    rules/mismatch.smk composes the name of this function.

    Parameters
    ----------
    plan : Path
        Plan file of a shard.
    configuration : Configuration
        Configuration of the fleet.

    Yields
    ------
    PlannedUnit
    """
    by_turnout: dict[str, list[PlannedUnit]] = {}
    for planned in read_plan(plan):
        by_turnout.setdefault(planned.unit.turnout, []).append(planned)
    hashes = {e["turnout"]: e["hashes"] for e in json.loads(Path(plan).read_text(encoding="utf-8"))["turnouts"]}
    for turnout, members in by_turnout.items():
        if configuration.is_left_out(turnout):
            continue
        notes = {id(p.unit): p.note for p in members}
        model = digest_of_model(configuration.turnout(turnout))
        events = [e for e in configuration.events if e.turnout == turnout]
        work = [[e.at.isoformat(), e.kind, e.section, e.resets] for e in events]
        by_visit = visits((p.unit for p in members), days_of_work(events))
        labels = list(by_visit)
        for label, units in list(by_visit.items())[-N_NEWEST_VISITS:]:
            before = labels[: labels.index(label)]
            earlier = sorted(f for visit in before for u in by_visit[visit] for f in u.files)
            note = digest([model, work, earlier, *(notes[id(u)] for u in units)])[:16]
            yield PlannedUnit(unit_of(turnout, label, units, hashes[turnout].get("mismatch", "")), note)


def unit_of(turnout: str, label: str, units: Sequence[Unit], config_hash: str) -> Unit:
    """Unit of all files of a visit.

    Parameters
    ----------
    turnout : str
        Id of the turnout.
    label : str
        The visit.
    units : sequence of Unit
        Its hammer tests and passages.
    config_hash : str
        Hash of the configuration of this stage.

    Returns
    -------
    Unit
    """
    files = tuple(sorted(f for u in units for f in u.files))
    return Unit(turnout, "mismatch", label, files, config_hash)


def members_of(unit: Unit, scanned: Iterable[Unit]) -> list[Unit]:
    """Scanned hammer tests and passages whose files belong to the unit of a visit.

    Parameters
    ----------
    unit : Unit
        The files of a visit.
    scanned : iterable of Unit
        Units of the scan.

    Returns
    -------
    list of Unit
    """
    wanted = {f[0] for f in unit.files}
    members = []
    for u in scanned:
        files = tuple(f for f in u.files if f[0] in wanted)
        if files:
            members.append(replace(u, files=files))
    return members
