"""What was noted beside the files of a unit and changes its result: its campaign, the trains of its hour."""

import re
from collections import defaultdict
from collections.abc import Sequence
from datetime import datetime, timedelta

from turnout.config import TurnoutConfig
from turnout.config.build import digest
from turnout.records import Unit

# A train is looked for among those noted within so many hours of its recording.
HOURS = 1


def notes_of(turnout: TurnoutConfig, units: Sequence[Unit]) -> list[str]:
    """A digest per unit; it changes when the unit's campaign, or a train noted near its time, is corrected."""
    campaigns: dict[str, str] = {}
    trains = _by_hour(turnout.trains)
    notes = []
    for unit in units:
        if unit.campaign:
            if unit.campaign not in campaigns:
                campaigns[unit.campaign] = digest(repr(turnout.campaigns[unit.campaign]))[:16]
            notes.append(campaigns[unit.campaign])
        else:
            notes.append(_near(unit.label, trains))
    return notes


def _by_hour(rows) -> dict[str, list]:
    """Rows of trains.csv by the hour of their first time column."""
    hours = defaultdict(list)
    for row in rows:
        time = next((value for name, value in row.items() if name.endswith("_at_utc")), "")
        hours[time[:13].replace(" ", "T")].append(sorted((k, str(v)) for k, v in row.items()))
    return hours


def _near(label: str, trains: dict[str, list]) -> str:
    stamp = re.search(r"\d{8}T\d{6}Z", label)
    if not trains or not stamp:
        return ""
    time = datetime.strptime(stamp[0], "%Y%m%dT%H%M%SZ")
    hours = [(time + timedelta(hours=h)).strftime("%Y-%m-%dT%H") for h in range(-HOURS, HOURS + 1)]
    rows = [row for hour in hours for row in trains.get(hour, ())]
    return digest(rows)[:16] if rows else ""
