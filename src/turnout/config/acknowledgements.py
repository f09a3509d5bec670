"""Reader of config/acknowledgements.csv: who has seen an alarm, or suppresses it until a date, and why."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.csv_table import TableError, read_csv, row_problem
from turnout.config.events import now, parse_utc, time_problem, turnout_problems
from turnout.config.schema import suggestion
from turnout.errors import ConfigError

if TYPE_CHECKING:
    from turnout.config.merge import Variant

COLUMNS = ("turnout", "section", "band", "action", "by", "at", "until", "reason")
ACTIONS = ("acknowledge", "suppress")
BANDS = ("ballast", "railpad", "ballast_damping", "railpad_damping", "amplitude")


def read_acknowledgements(
    path: Path,
    name: str = "acknowledgements.csv",
    turnout_ids: Collection[str] | None = None,
    variants: Mapping[str, Variant] | None = None,
) -> tuple[list[dict], list[ConfigError]]:
    """Read config/acknowledgements.csv; without the file there are no rows.

    Empty ``section`` or ``band`` mean all of the turnout; section "*" is its median.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What errors call the file.
    turnout_ids : collection of str or None
        Ids of the turnouts; None: neither turnout nor section is checked.
    variants : mapping of str to Variant or None
        Merged configuration by turnout; turnouts without one are not checked for sections.

    Returns
    -------
    tuple of (list of dict, list of ConfigError)
        Valid rows as rows of the table ``acknowledgements``, and every error of the other rows.
    """
    if not os.path.lexists(path):
        return [], []
    try:
        table = read_csv(Path(path), name, COLUMNS, n_required=6)
    except TableError as fault:
        return [], [fault.error]
    if table.faults:  # an unknown title may be a misspelt "until": no row counts
        return [], [fault.error for fault in table.faults]
    rows: list[dict] = []
    errors: list[ConfigError] = []
    for line, cells in table.rows:
        problems = list(row_problems(cells, turnout_ids, variants or {}))
        errors += [cells.place(name, line, column).error(*problem) for column, *problem in problems]
        if not problems:
            rows.append(acknowledgement_row(cells))
    return rows, errors


def row_problems(
    cells: Mapping, turnout_ids: Collection[str] | None, variants: Mapping[str, Variant]
) -> Iterator[tuple[str, str, str]]:
    """Every error in a row of acknowledgements.csv.

    Parameters
    ----------
    cells : mapping
        Text of a row by column.
    turnout_ids : collection of str or None
        Ids of the turnouts; None: neither turnout nor section is checked.
    variants : mapping of str to Variant
        Merged configuration by turnout; turnouts without one are not checked for sections.

    Yields
    ------
    tuple of (str, str, str)
        Column, problem and remedy.
    """
    values = {column: cells.get(column, "") for column in COLUMNS}
    if line_problem := row_problem(cells):
        yield line_problem
        return
    if not values["turnout"]:
        yield "turnout", "turnout is empty", "Write the id of the turnout"
    else:
        yield from turnout_problems(values | {"section": values["section"].removesuffix("*")}, turnout_ids, variants)
    if values["action"] not in ACTIONS:
        yield "action", f"action is {values['action']!r}", suggestion(values["action"], ACTIONS)
    if values["band"] and values["band"] not in BANDS:
        yield "band", f"band is {values['band']!r}", suggestion(values["band"], BANDS)
    if values["action"] == "suppress" and not values["until"]:
        yield "until", "until is empty", "Write the day from which the alarm is shown again"
    for column in ("by", "reason"):
        if not values[column]:
            yield column, f"{column} is empty", "Write who and why: it stays in the record"
    times = ["at"] + ["until"] * bool(values["until"])
    time_problems = {column: fault for column in times if (fault := time_problem(values[column]))}
    for column, (addition, remedy) in time_problems.items():
        yield column, f"{column} is {values[column]!r}{addition}", remedy
    if values["action"] == "acknowledge" and not time_problems and parse_utc(values["at"]) > now() + timedelta(days=1):
        yield "at", f"at {values['at']} has not come yet", "Write the day on which the alarm was seen"
    if values["until"] and not time_problems and parse_utc(values["until"]) <= parse_utc(values["at"]):
        yield (
            "until",
            f"until {values['until']} is not after at {values['at']}",
            "Write the day from which the alarm is shown again",
        )


def acknowledgement_row(cells: Mapping) -> dict:
    """The row of the table ``acknowledgements`` for a valid row of the file.

    Parameters
    ----------
    cells : mapping
        Text of a valid row by column.

    Returns
    -------
    dict
        Row of the table ``acknowledgements``, with its id.
    """
    values = {column: cells.get(column, "") for column in COLUMNS}
    section = values["section"]
    if section and section != "*" and "/" not in section:
        section = f"{values['turnout']}/{section}"
    row = {
        "turnout_id": values["turnout"],
        "section_id": section or None,
        "band": values["band"] or None,
        "action": values["action"],
        "by_whom": values["by"],
        "at_utc": parse_utc(values["at"]),
        "until_utc": parse_utc(values["until"]) if values["until"] else None,
        "reason": values["reason"],
    }
    return {"acknowledgement_id": _id(row)} | row


def _id(row: dict) -> str:
    text = json.dumps([row[k] for k in sorted(row)], default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]
