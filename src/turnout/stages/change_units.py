"""Units of the stage change: groups of neighbouring sections with an open alarm, from plan files and registry."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from datetime import date, datetime
from pathlib import Path
from re import search

from turnout.config import Configuration
from turnout.config.events import Event
from turnout.config.merge import digest
from turnout.config.turnout import TurnoutConfig
from turnout.errors import ConfigError
from turnout.records import Unit
from turnout.registry.as_of import whole_list
from turnout.registry.database import open_registry
from turnout.workflow.plan import PlannedUnit, is_cut_plan, read_plan

REGISTRY = Path("results/registry")
KIND = "change"
MAX_TRAINS = 16  # of a visit: more trains would only compute it again
OPEN_SQL = """
    select distinct turnout_id, unnest(string_split(sections, ', ')) as section from {}
    where raised_at_utc is not null or state = 'confirm now' order by all
"""
WHOLE_TURNOUT = "whole turnout"


def open_alarms(registry: str | Path) -> dict[str, list[str]]:
    """Sections with an open alarm, or with a campaign to confirm, as of the newest measurement.

    Parameters
    ----------
    registry : path
        Folder of the registry.

    Returns
    -------
    dict
        Turnout -> labels. The median of a whole turnout is no section.
    """
    by_turnout: dict[str, list[str]] = {}
    if not (Path(registry) / "registry.duckdb").exists():
        return by_turnout
    with open_registry(registry) as connection:
        for turnout, section in connection.execute(OPEN_SQL.format(whole_list("newest_measurement()"))).fetchall():
            if section != WHOLE_TURNOUT:
                by_turnout.setdefault(turnout, []).append(section)
    return by_turnout


def alarmed_groups(plans: Path, configuration: Configuration) -> Iterator[PlannedUnit]:
    """A unit for each group of neighbouring sections with an open alarm.

    Its note changes with the notes on its recordings, the track and vehicle files, and the recorded work.

    Parameters
    ----------
    plans : Path
        Folder of the plan files.
    configuration : Configuration
        Configuration of the fleet.

    Yields
    ------
    PlannedUnit
    """
    alarms = open_alarms(REGISTRY)
    for plan in sorted(Path(plans).glob("*of*.json")) if alarms else ():
        if is_cut_plan(plan):
            continue
        planned: dict[str, list[PlannedUnit]] = {}
        for p in read_plan(plan):
            planned.setdefault(p.unit.turnout, []).append(p)
        hashes = {e["turnout"]: e["hashes"] for e in json.loads(plan.read_text(encoding="utf-8"))["turnouts"]}
        for turnout_id in sorted(planned.keys() & alarms.keys()):
            try:
                turnout = configuration.turnout(turnout_id)
            except ConfigError:
                continue
            config_hash = hashes[turnout_id].get(KIND, "")
            works = [event for event in configuration.events if event.turnout == turnout_id]
            yield from _units(turnout, planned[turnout_id], alarms[turnout_id], works, config_hash)


def _units(
    turnout: TurnoutConfig,
    planned: Sequence[PlannedUnit],
    sections: Iterable[str],
    works: Sequence[Event],
    config_hash: str,
) -> Iterator[PlannedUnit]:
    from turnout.stages.change_diagnosis import group_labels  # late: a night without alarms needs no model
    from turnout.stages.track_files import digest_of_model
    from turnout.stages.work_days import days_of_work

    days = days_of_work(works)
    recorded_work = [[event.at.isoformat(), event.kind, event.section, event.resets] for event in works]
    for labels in group_labels(turnout, sections):
        members = [p for p in planned if p.unit.kind == "hammer" and p.unit.section in labels]
        members += _trains_of_first_and_newest_visits(members, [p for p in planned if p.unit.kind == "passage"], days)
        if not members:
            continue
        files = tuple(sorted(f for p in members for f in p.unit.files))
        note = digest([digest_of_model(turnout), recorded_work, *(p.note for p in members)])[:16]
        yield PlannedUnit(Unit(turnout.id, KIND, "+".join(labels), files, config_hash), note)


def _trains_of_first_and_newest_visits(
    tests: Sequence[PlannedUnit], trains: Sequence[PlannedUnit], work_days: Sequence[date]
) -> list[PlannedUnit]:
    """Trains of the first and the newest visits with hammer tests and trains, those nearest to the day of the tests.

    Without hammer tests, those of the newest visit.
    """
    from turnout.stages.change_diagnosis import ends_of
    from turnout.stages.mismatch_groups import visits

    by_unit = {id(p.unit): p for p in (*tests, *trains)}
    with_trains: dict[str, list[Unit]] = {}
    for visit, units in visits((p.unit for p in (*tests, *trains)), work_days).items():
        passed = [u for u in units if u.kind == "passage"]
        if passed and (len(passed) < len(units) or not tests):
            day = date.fromisoformat(visit if len(visit) > 7 else f"{visit}-15")
            with_trains[visit] = sorted(passed, key=lambda u: (abs((_day_of(u.label) - day).days), u.label))
    history = list(with_trains)
    chosen = ends_of(history) if tests else history[-1:]
    return [by_unit[id(u)] for visit in chosen for u in with_trains[visit][:MAX_TRAINS]]


def _day_of(label: str) -> date:
    """Day in the name of a passage, as ``mismatch_groups.visits`` reads it."""
    stamp = search(r"\d{8}(?=T\d{6}Z)", label)
    assert stamp is not None
    return datetime.strptime(stamp[0], "%Y%m%d").date()
