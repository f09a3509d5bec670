"""Make registry rows of the configuration: turnouts, sections, events, campaigns, and excluded files."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from turnout.config import Configuration, Event, Section, TurnoutConfig, with_raw
from turnout.errors import ConfigError
from turnout.registry.database import open_registry
from turnout.registry.generation import GENERATION_FILE
from turnout.registry.ids import content_id
from turnout.workflow.plan import read_plan, read_problems

FAULTY = "configuration_error"  # reason of the turnouts that are left out
# Tables that are replaced as a whole, with the columns that the configuration fills; the first is the key.
KEPT_COLUMNS = {
    "turnouts": (
        "turnout_id", "name", "line", "km", "layout", "lat_deg", "lon_deg", "external_id", "id_scheme", "config_hash",
    ),
    "sections": (
        "section_id", "turnout_id", "label", "panel", "track", "position_m", "pad_type", "sleeper_type",
    ),
    "events": (
        "event_id", "turnout_id", "section_id", "event_at_utc", "kind", "resets_ballast", "resets_railpad", "note",
    ),
    "campaigns": (
        "campaign_id", "turnout_id", "started_at_utc", "hammer_id", "tip", "operator", "rail_temperature_c",
    ),
}  # fmt: skip


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
        _error_row(warning, next((t for t in sorted(unknown) if f"turnout {t!r} has" in warning.problem), None))
        for warning in configuration.warnings
    ]


def _error_row(error: ConfigError, turnout: str | None, reason: str = "not_counted") -> dict:
    """Quarantine row of an error in the configuration."""
    return {
        "quarantine_id": content_id(
            "quarantine", str(error), "configuration", *([turnout] if reason == FAULTY else [])
        ),
        "turnout_id": turnout,
        "kind": "configuration",
        "path": error.path,
        "stage": "plan",
        "reason_code": reason,
        "place": error.place,
        "found": error.problem,
        "remedy": error.remedy,
    }


def keep_rows(tables: dict[str, list[dict]], configuration: Configuration, registry: Path) -> None:
    """Add the rows of turnouts that are left out for an error: those of the registry stay as they are.

    Their errors become rows of the quarantine, of the turnout where the registry knows it. If a row of
    events.csv has no valid id, all earlier events stay, too, because it may be one of them.

    Parameters
    ----------
    tables : dict of str to list of dict
        Rows of the configuration; they are changed.
    configuration : Configuration
        Configuration of the fleet.
    registry : Path
        Folder of the registry.
    """
    if not configuration.faulty:
        return
    for name in KEPT_COLUMNS:  # its new or changed events wait, too: they would stand beside the earlier ones
        tables[name] = [row for row in tables[name] if not configuration.is_left_out(row["turnout_id"])]
    turnout_ids = {row["turnout_id"] for row in tables["turnouts"]}
    if (registry / GENERATION_FILE).exists():
        with open_registry(registry) as connection:
            for name, columns in KEPT_COLUMNS.items():
                in_use = "where panel is not null and not coalesce(left_layout, false)" if name == "sections" else ""
                cursor = connection.execute(f"select {', '.join(columns)} from {name} {in_use}")
                rows = [dict(zip(columns, row)) for row in cursor.fetchall()]
                rows_before = [row for row in rows if _is_kept(row, name, configuration)]
                new = {row[columns[0]] for row in tables[name]}
                tables[name] += [row for row in rows_before if row[columns[0]] not in new]
        turnout_ids = {row["turnout_id"] for row in tables["turnouts"]}
    tables["quarantine"] += [
        _error_row(error, turnout if turnout in turnout_ids else None, FAULTY)
        for turnout, errors in configuration.faulty.items()
        for error in {str(e): e for e in errors}.values()
    ]


def _is_kept(row: Mapping[str, Any], table: str, configuration: Configuration) -> bool:
    """Whether a row of the registry stays although the configuration has none for it now."""
    without_id = table == "events" and any(Path(e.path).name == "events.csv" for e in configuration.faulty.get("", ()))
    return without_id or configuration.is_left_out(row["turnout_id"])


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
    warnings = map(str, (*configuration.warnings, *configuration.errors))
    return content_id(hashes, [_event(e)["event_id"] for e in configuration.events], *warnings)
