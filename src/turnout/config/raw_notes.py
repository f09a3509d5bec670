"""What was noted beside the raw files of a turnout: campaigns.csv and trains.csv."""

import math
from collections.abc import Mapping
from datetime import date as day
from datetime import datetime
from pathlib import Path

from turnout.config.events import wrong_time
from turnout.config.frozen import Frozen
from turnout.config.table import TOO_MANY, read_csv
from turnout.config.turnout import Campaign
from turnout.errors import ReadError

COLUMNS = ("campaign", "started_at_utc", "rail_temperature_c", "hammer_id", "tip", "operator")


def read_campaigns(path: Path, name: str) -> tuple[dict[str, Campaign], list[ReadError]]:
    """Campaigns by date, and an error for each row that cannot be used; without the file there are none.

    A row whose temperature is empty is sound: the temperature is None.
    """
    campaigns, errors = {}, []
    try:
        for line, cells in read_csv(path, COLUMNS[:2]):
            try:
                campaign = _campaign(cells)
                if campaign.date in campaigns:
                    raise _Wrong("campaign", f"campaign {campaign.date} for the second time", "Keep one of them")
                campaigns[campaign.date] = campaign
            except _Wrong as wrong:
                column, found, remedy = wrong.args
                place = cells.place(name, line, column)
                errors.append(ReadError(name, str(place), found, remedy, reason="unreadable"))
    except FileNotFoundError:
        return {}, []
    except (ValueError, UnicodeDecodeError) as error:
        remedy = f"Write the header {','.join(COLUMNS)} in UTF-8"
        return {}, [ReadError(name, "line 1", str(error), remedy, reason="unreadable")]
    return campaigns, errors


class Campaigns(Frozen):
    """Campaigns by date; one that campaigns.csv does not know is ``unnoted``.

    >>> Campaigns()["2024-05-13"].started_at.isoformat(), Campaigns()["2024-05-13"].noted
    ('2024-05-13T12:00:00', False)
    """

    def __getitem__(self, date):
        return self._values[date] if date in self._values else unnoted(date)


def unnoted(date: str) -> Campaign:
    """A campaign that campaigns.csv does not know: noon of its day, nothing else."""
    return Campaign(date, datetime.fromisoformat(date + "T12:00"), noted=False)


def read_trains(path: Path, name: str) -> tuple[tuple[dict[str, str], ...], list[ReadError]]:
    """Rows of trains.csv as text, in the file's order; without the file there are none."""
    try:
        return tuple(cells for _, cells in read_csv(path, ())), []
    except FileNotFoundError:
        return (), []
    except (ValueError, UnicodeDecodeError) as error:
        return (), [ReadError(name, "line 1", str(error), "Write a CSV with a header in UTF-8", reason="unreadable")]


class _Wrong(Exception):
    """Column, what was found, what to write."""


def _campaign(cells: Mapping) -> Campaign:
    if TOO_MANY in cells:
        raise _Wrong(TOO_MANY, "more cells than columns", "Put a text with commas in double quotes")
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
    return Campaign(date, started, _temperature(cells.get("rail_temperature_c", "")), **noted)


def _temperature(text: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not -50 <= value <= 80:
        remedy = "Write a number from -50 to 80 °C, or nothing where it was not noted"
        raise _Wrong("rail_temperature_c", f"rail_temperature_c is {text!r}", remedy)
    return value
