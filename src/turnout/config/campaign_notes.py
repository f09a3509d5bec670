"""Readers of campaigns.csv and trains.csv in the raw folder of a turnout."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import date as day
from datetime import datetime
from pathlib import Path
from typing import Any

from turnout.config.csv_table import Cells, TableError, read_csv, row_problem
from turnout.config.document import Place
from turnout.config.events import day_problem, parse_utc, time_problem
from turnout.config.frozen_mapping import Frozen
from turnout.config.turnout import Campaign, TurnoutConfig
from turnout.config.value_hints import DECIMAL_COMMA, decimal_point_hint
from turnout.errors import ReadError
from turnout.number_text import decimal_number

NOTE_FILES = ("campaigns.csv", "trains.csv")
COLUMNS = ("campaign", "started_at_utc", "rail_temperature_c", "hammer_id", "tip", "operator")
TRAIN_COLUMNS = ("passed_at_utc", "train_type", "speed_kmh", "axle_load_t", "track", "n_axles")
TRAIN_RANGES = {"speed_kmh": (1, 400), "axle_load_t": (0.1, 60), "n_axles": (1, 2000)}
WHOLE_NUMBERS = ("n_axles",)
NUMBER_COLUMNS = ("rail_temperature_c", *TRAIN_RANGES)
UNITS = {"c": " °C", "kmh": " km/h", "t": " t"}  # by the end of the name of a column


def read_campaigns(path: Path, name: str) -> tuple[dict[str, Campaign], list[ReadError]]:
    """Read campaigns.csv; without the file there are no campaigns.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What errors call the file.

    Returns
    -------
    tuple of (dict of str to Campaign, list of ReadError)
        Campaigns by date, their temperature None if its cell is empty; and an error for each row and cell that cannot
        be used. Of a row with a valid day, the other cells count.
    """
    campaigns: dict[str, Campaign] = {}

    def add_campaign(cells: Cells, faults: _Faults) -> None:
        campaign = _campaign(cells, faults)
        if campaign.date in campaigns:
            raise _CellError("campaign", f"campaign {campaign.date} for the second time", "Keep one of them")
        campaigns[campaign.date] = campaign

    errors = _read_rows(path, name, COLUMNS, 2, add_campaign)
    return campaigns, errors


class Campaigns(Frozen):
    """Campaigns by date; for a date that is not in campaigns.csv an unlisted campaign.

    >>> Campaigns()["2024-05-13"].started_at.isoformat(), Campaigns()["2024-05-13"].listed
    ('2024-05-13T12:00:00', False)
    """

    def __getitem__(self, date: str) -> Campaign:
        return self._values[date] if date in self._values else unlisted_campaign(date)


def unlisted_campaign(date: str) -> Campaign:
    """A campaign that is not in campaigns.csv: it starts at noon of its day and has no other data.

    Parameters
    ----------
    date : str
        Day of the campaign, YYYY-MM-DD.

    Returns
    -------
    Campaign
        The campaign, with ``listed`` False.
    """
    return Campaign(date, datetime.fromisoformat(date + "T12:00"), listed=False)


def read_trains(path: Path, name: str) -> tuple[tuple[dict[str, str], ...], list[ReadError]]:
    """Read trains.csv, additional columns included; without the file there are no rows.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What errors call the file.

    Returns
    -------
    tuple of (tuple of dict of str to str, list of ReadError)
        Rows as text in the order of the file, and an error for each row and cell that cannot be used. Of a row with a
        valid time, the other cells count.
    """
    trains: list[Cells] = []
    passed: set[tuple[datetime, str]] = set()

    def add_train(cells: Cells, faults: _Faults) -> None:
        text = cells["passed_at_utc"]
        if problem := time_problem(text):
            raise _CellError("passed_at_utc", f"passed_at_utc is {text!r}{problem[0]}", problem[1])
        for column in (c for c in TRAIN_RANGES if c in cells):
            if faults.optional(_in_range, cells[column], column, *TRAIN_RANGES[column]) is None:
                cells[column] = ""
        if cells.get("track", "") not in ("", "main", "diverging"):
            faults.append(_CellError("track", f"track is {cells['track']!r}", "Write main or diverging, or nothing"))
            cells["track"] = ""
        key = (parse_utc(text), cells.get("track", ""))
        if key in passed:  # of two rows nothing says which one is right
            raise _CellError("passed_at_utc", f"a train at {text} for the second time", "Keep one of them")
        passed.add(key)
        trains.append(cells)

    errors = _read_rows(path, name, TRAIN_COLUMNS, 1, add_train, allow_others=True)
    return tuple(trains), errors


def with_raw(turnout: TurnoutConfig, raw_root: Path) -> TurnoutConfig:
    """The turnout with the campaigns and trains that are listed in its raw folder; invalid rows are left out.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : Path
        The raw root.

    Returns
    -------
    TurnoutConfig
        A copy with the notes.
    """
    return read_notes(turnout, raw_root)[0]


def read_notes(turnout: TurnoutConfig, raw_root: Path) -> tuple[TurnoutConfig, list[ReadError]]:
    """The turnout with the campaigns and trains of its raw folder, and an error for each invalid row.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : Path
        The raw root.

    Returns
    -------
    tuple of (TurnoutConfig, list of ReadError)
        A copy with the notes, and the errors.
    """
    folder = Path(raw_root) / turnout.raw
    campaigns, campaign_errors = read_campaigns(folder / "campaigns.csv", f"{turnout.raw}/campaigns.csv")
    trains, train_errors = read_trains(folder / "trains.csv", f"{turnout.raw}/trains.csv")
    return replace(turnout, campaigns=Campaigns(campaigns), trains=trains), campaign_errors + train_errors


class _CellError(Exception):
    """A cell that cannot be used: (column, problem, remedy)."""


class _Faults(list[_CellError]):
    """Cells of one row that count as empty."""

    def optional(self, read: Callable, *args: Any) -> Any:
        """What ``read`` returns; None if its cell cannot be used."""
        try:
            return read(*args)
        except _CellError as fault:
            self.append(fault)
            return None


def _read_rows(
    path: Path,
    name: str,
    titles: tuple[str, ...],
    n_required: int,
    add_row: Callable[[Cells, _Faults], None],
    allow_others: bool = False,
) -> list[ReadError]:
    """Call ``add_row`` with every row; return the errors of the header, of rows and of cells that cannot be used."""
    try:
        table = read_csv(path, name, titles, n_required, allow_others)
    except (FileNotFoundError, NotADirectoryError):
        return []
    except TableError as fault:
        return [_error(fault.place, fault.problem, fault.remedy, fault.reason)]
    errors = [_error(fault.place, fault.problem, fault.remedy) for fault in table.faults]
    for line, cells in table.rows:
        faults = _Faults()
        try:
            if line_problem := row_problem(cells):
                raise _CellError(*line_problem)
            for column in NUMBER_COLUMNS:  # where a comma separates no cells, it is a decimal mark
                if cells.separator != "," and DECIMAL_COMMA.fullmatch(cells.get(column, "")):
                    cells[column] = cells[column].replace(",", ".")
            add_row(cells, faults)
        except _CellError as cell_error:
            faults.append(cell_error)
        for column, problem, remedy in (fault.args for fault in faults):
            errors.append(_error(cells.place(name, line, column), problem, remedy))
    return errors


def _error(place: Place, problem: str, remedy: str, reason: str = "unreadable") -> ReadError:
    return ReadError(place.path, str(place), problem, remedy, reason)


def _campaign(cells: Mapping, faults: _Faults) -> Campaign:
    """The campaign of a row; without a valid start it starts at noon, as one that is not listed."""
    if wrong_day := day_problem(cells["campaign"]):
        raise _CellError("campaign", f"campaign is {cells['campaign']!r}{wrong_day[0]}", wrong_day[1])
    date = day.fromisoformat(cells["campaign"]).isoformat()
    start = faults.optional(_start, cells["started_at_utc"], date) or unlisted_campaign(date).started_at
    details = {k: cells.get(k, "") for k in ("hammer_id", "tip", "operator")}
    temperature_text = cells.get("rail_temperature_c", "")
    temperature = faults.optional(_in_range, temperature_text, "rail_temperature_c", -50, 80)
    return Campaign(date, start, temperature, **details)


def _start(text: str, date: str) -> datetime:
    if time_error := time_problem(text):
        raise _CellError("started_at_utc", f"started_at_utc is {text!r}{time_error[0]}", time_error[1])
    start = parse_utc(text)
    if abs((start - datetime.fromisoformat(date)).total_seconds()) > 2 * 86400:
        problem = f"started_at_utc {text!r} is not on the campaign's day {date}"
        raise _CellError("started_at_utc", problem, "Correct the one or the other")
    return start


def _in_range(text: str, column: str, low: float, high: float) -> float | None:
    """The number in a cell, None for an empty one."""
    if not text:
        return None
    try:
        value = decimal_number(text)
    except ValueError:
        value = math.nan
    is_whole = column in WHOLE_NUMBERS
    if not low <= value <= high or (is_whole and value % 1.0):
        unit = UNITS.get(column.rpartition("_")[2], "")
        expected = f"a {'whole ' * is_whole}number from {low} to {high}{unit}{decimal_point_hint(text)}"
        remedy = f"Write {expected}, or nothing where it was not noted"
        raise _CellError(column, f"{column} is {text!r}", remedy)
    return value
