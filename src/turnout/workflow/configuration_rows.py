"""Make registry rows of the configuration: turnouts, sections, events, campaigns, and excluded files."""

import json
from collections.abc import Iterable
from pathlib import Path

from turnout.config import Configuration, Event, Section, TurnoutConfig, with_raw
from turnout.registry.ids import content_id
from turnout.workflow.plan import read_plan, read_problems


def configuration_rows(configuration: Configuration, raw_root: Path, plans: Iterable[Path]) -> dict[str, list[dict]]:
    """Registry rows of the configuration, sorted.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.
    raw_root : Path
        The raw root, for the campaigns that are listed there.
    plans : iterable of Path
        Plan files; those that do not exist are left out.

    Returns
    -------
    dict of str to list of dict
        Table -> rows; a campaign with files that is missing in campaigns.csv has a row, too.
    """
    plans = [p for p in plans if Path(p).exists()]
    measured: dict[str, set[str]] = {}
    for plan in plans:
        for planned in read_plan(plan):
            if planned.unit.campaign:
                measured.setdefault(planned.unit.turnout, set()).add(planned.unit.campaign)
    turnouts = [configuration.turnout(t) for t in sorted(configuration.ids)]
    return {
        "turnouts": [_turnout(t) for t in turnouts],
        "sections": [_section(t, s) for t in turnouts for s in t.sections],
        "events": list({row["event_id"]: row for row in map(_event, configuration.events)}.values()),
        "campaigns": [r for t in turnouts for r in _campaigns(with_raw(t, raw_root), measured.get(t.id, set()))],
        "quarantine": [
            *(row for plan in plans for row in _excluded_files(plan)),
            *_uncounted_rows(configuration),
        ],
    }


def _turnout(turnout: TurnoutConfig) -> dict:
    return {
        "turnout_id": turnout.id,
        "name": turnout.name or None,
        "line": turnout.line or None,
        "km": turnout.km,
        "layout": turnout.layout,
        "lat_deg": turnout.latitude,
        "lon_deg": turnout.longitude,
        "external_id": turnout.external_id or None,
        "id_scheme": turnout.id_scheme or None,
        "config_hash": turnout.config_hash,
    }


def _section(turnout: TurnoutConfig, section: Section) -> dict:
    return {
        "section_id": turnout.section_id(section.label),
        "turnout_id": turnout.id,
        "label": section.label,
        "panel": section.panel,
        "track": section.track,
        "position_m": section.position,
        "pad_type": section.pad or None,
        "sleeper_type": section.sleeper or None,
    }


def _event(event: Event) -> dict:
    return {
        "event_id": content_id(
            "event", event.turnout, event.section, event.at, event.kind, event.note, sorted(event.resets)
        ),
        "turnout_id": event.turnout,
        "section_id": f"{event.turnout}/{event.section}" if event.section else None,
        "event_at_utc": event.at.isoformat(),
        "kind": event.kind,
        "resets_ballast": "ballast" in event.resets,
        "resets_railpad": "railpad" in event.resets,
        "note": event.note or None,
    }


def _campaigns(turnout: TurnoutConfig, measured: set[str]) -> list[dict]:
    rows = []
    for date in sorted({*turnout.campaigns, *measured}):
        campaign = turnout.campaigns[date]
        rows.append(
            {
                "campaign_id": f"{turnout.id}/{date}",
                "turnout_id": turnout.id,
                "started_at_utc": campaign.started_at.isoformat(),
                "hammer_id": campaign.hammer_id or None,
                "tip": campaign.tip or None,
                "operator": campaign.operator or None,
                "rail_temperature_c": campaign.rail_temperature,
            }
        )
    return rows


def _excluded_files(plan: Path) -> list[dict]:
    rows = []
    for turnout, problem in read_problems(plan):
        rows.append(
            {
                "quarantine_id": content_id("quarantine", problem["path"], "plan", problem["reason"], problem["where"]),
                "turnout_id": turnout,
                "kind": "configuration",
                "path": problem["path"],
                "stage": "plan",
                "reason_code": problem["reason"],
                "place": problem["where"],
                "found": problem["found"],
                "remedy": problem["remedy"],
            }
        )
    return rows


def _uncounted_rows(configuration: Configuration) -> list[dict]:
    """Quarantine rows of lines of the configuration that do not count, such as an event of an unknown turnout.

    ``turnout_id`` is that unknown turnout: if it has results, it was taken out of the table, and there is no message.
    """
    unknown = {event.turnout for event in configuration.events} - set(configuration.ids)
    return [
        {
            "quarantine_id": content_id("quarantine", str(warning), "configuration"),
            "turnout_id": next((t for t in sorted(unknown) if f"turnout {t!r} has" in warning.problem), None),
            "kind": "configuration",
            "path": warning.path,
            "stage": "plan",
            "reason_code": "not_counted",
            "place": warning.place,
            "found": warning.problem,
            "remedy": warning.remedy,
        }
        for warning in configuration.warnings
    ]


def fleet_hash(configuration: Configuration) -> str:
    """Hash of all turnouts, their configurations and events, and of the rows that do not count.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.

    Returns
    -------
    str
        Changes with everything that rows of the configuration are made of.
    """
    hashes = [
        [t, configuration.hash_of(t), json.dumps(configuration.rows[t].values)] for t in sorted(configuration.ids)
    ]
    warnings = map(str, configuration.warnings)
    return content_id(hashes, [_event(e)["event_id"] for e in configuration.events], *warnings)
