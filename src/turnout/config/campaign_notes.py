"""Readers of campaigns.csv and trains.csv in the raw folder of a turnout."""

import math
from collections.abc import Callable, Mapping
from datetime import date as day
from datetime import datetime
from pathlib import Path

from turnout.config.csv_table import Cells, TableFault, read_csv, unreadable
from turnout.config.document import Frozen, Place
from turnout.config.events import wrong_time
from turnout.config.turnout import Campaign
from turnout.errors import ReadError

COLUMNS = ("campaign", "started_at_utc", "rail_temperature_c", "hammer_id", "tip", "operator")
TRAINS = ("passed_at_utc", "train_type", "speed_kmh", "axle_load_t", "track", "n_axles")
TRAIN_RANGES = {"speed_kmh": (1, 400), "axle_load_t": (0.1, 60), "n_axles": (1, 2000)}


def read_campaigns(path: Path, name: str) -> tuple[dict[str, Campaign], list[ReadError]]:
    """Campaigns by date, and an error for each row that cannot be used. Without the file there are none.

    The temperature of a campaign is None if its cell is empty.
    """
    campaigns: dict[str, Campaign] = {}

    def keep(cells: Cells) -> None:
        campaign = _campaign(cells)
        if campaign.date in campaigns:
            raise _Wrong("campaign", f"campaign {campaign.date} for the second time", "Keep one of them")
        campaigns[campaign.date] = campaign

    errors = _each_row(path, name, COLUMNS, 2, keep)
    return campaigns, errors


class Campaigns(Frozen):
    """Campaigns by date; for a date that is not in campaigns.csv an unlisted campaign.

    >>> Campaigns()["2024-05-13"].started_at.isoformat(), Campaigns()["2024-05-13"].noted
    ('2024-05-13T12:00:00', False)
    """

    def __getitem__(self, date):
        return self._values[date] if date in self._values else unnoted(date)


def unnoted(date: str) -> Campaign:
    """A campaign that is not in campaigns.csv: it starts at noon of its day and has no other data."""
    return Campaign(date, datetime.fromisoformat(date + "T12:00"), noted=False)


def read_trains(path: Path, name: str) -> tuple[tuple[dict[str, str], ...], list[ReadError]]:
    """Rows of trains.csv as text, in the order of the file, and an error for each row that cannot be used.

    Additional columns are read too. Without the file there are no rows.
    """
    trains: list[Cells] = []

    def keep(cells: Cells) -> None:
        said = cells["passed_at_utc"]
        if wrong := wrong_time(said):
            raise _Wrong("passed_at_utc", f"passed_at_utc is {said!r}{wrong[0]}", wrong[1])
        for column, (low, high) in TRAIN_RANGES.items():
            _in_range(cells.get(column, ""), column, low, high)
        if (track := cells.get("track", "")) not in ("", "main", "diverging"):
            raise _Wrong("track", f"track is {track!r}", "Write main or diverging, or nothing")
        trains.append(cells)

    errors = _each_row(path, name, TRAINS, 1, keep, free=True)
    return tuple(trains), errors


class _Wrong(Exception):
    """A cell that cannot be used: (column, problem, remedy)."""


def _each_row(path, name, known, needed, keep: Callable[[Cells], None], free=False) -> list[ReadError]:
    """Call ``add_row`` with every row; return the errors of the header and of the rows that cannot be used."""
    try:
        table = read_csv(path, name, known, needed, free)
    except (FileNotFoundError, NotADirectoryError):
        return []
    except TableFault as fault:
        return [_error(fault.place, fault.found, fault.remedy)]
    errors = [_error(fault.place, fault.found, fault.remedy) for fault in table.faults]
    for line, cells in table.rows:
        try:
            if no_row := unreadable(cells):
                raise _Wrong(*no_row)
            keep(cells)
        except _Wrong as wrong:
            column, found, remedy = wrong.args
            errors.append(_error(cells.place(name, line, column), found, remedy))
    return errors


def _error(place: Place, found: str, remedy: str) -> ReadError:
    return ReadError(place.path, str(place), found, remedy, reason="unreadable")


def _campaign(cells: Mapping) -> Campaign:
    try:
        date = day.fromisoformat(cells["campaign"]).isoformat()
    except ValueError:
        raise _Wrong("campaign", f"campaign is {cells['campaign']!r}", "Write its day as YYYY-MM-DD") from None
    said = cells["started_at_utc"]
    if wrong := wrong_time(said):
        raise _Wrong("started_at_utc", f"started_at_utc is {said!r}{wrong[0]}", wrong[1])
    started = datetime.fromisoformat(said.removesuffix("Z"))
    if abs((started - datetime.fromisoformat(date)).total_seconds()) > 2 * 86400:
        found = f"started_at_utc {said!r} is not on the campaign's day {date}"
        raise _Wrong("started_at_utc", found, "Correct the one or the other")
    noted = {k: cells.get(k, "") for k in ("hammer_id", "tip", "operator")}
    temperature = _in_range(cells.get("rail_temperature_c", ""), "rail_temperature_c", -50, 80)
    return Campaign(date, started, temperature, **noted)


def _in_range(text: str, column: str, low: float, high: float) -> float | None:
    """The number in a cell, None for an empty one."""
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        unit = " °C" if column.endswith("_c") else ""
        remedy = f"Write a number from {low} to {high}{unit}, or nothing where it was not noted"
        raise _Wrong(column, f"{column} is {text!r}", remedy)
    return value
