"""Reader of config/acknowledgements.csv: who has seen an alarm, or suppresses it until a date, and why."""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta
from pathlib import Path

from turnout.config.csv_table import TableFault, read_csv, unreadable
from turnout.config.events import now, wrong_place, wrong_time
from turnout.config.schema import suggestion
from turnout.errors import ConfigError

COLUMNS = ("turnout", "section", "band", "action", "by", "at", "until", "reason")
ACTIONS = ("acknowledge", "suppress")
BANDS = ("ballast", "railpad", "amplitude")


def read_acknowledgements(
    path: Path, name: str = "acknowledgements.csv", known=None, variants: Mapping | None = None
) -> tuple[list[dict], list[ConfigError]]:
    """Valid rows as rows of the table ``acknowledgements``, and every error of the other rows.

    Without the file there are no rows. Empty ``section`` or ``band`` mean all of the turnout; section "*"
    is its median. ``turnout_ids`` and ``variants`` are the turnouts and their configuration; None: neither turnout nor
    section is checked.
    """
    if not os.path.lexists(path):
        return [], []
    try:
        table = read_csv(Path(path), name, COLUMNS, needed=6)
    except TableFault as fault:
        return [], [fault.error]
    if table.faults:  # an unknown title may be a misspelt "until": no row counts
        return [], [fault.error for fault in table.faults]
    rows: list[dict] = []
    errors: list[ConfigError] = []
    for line, cells in table.rows:
        found = list(faults(cells, known, variants or {}))
        errors += [cells.place(name, line, column).error(*said) for column, *said in found]
        if not found:
            rows.append(acknowledgement(cells))
    return rows, errors


def faults(cells: Mapping, known, variants) -> Iterator[tuple[str, str, str]]:
    """(column, problem, remedy) of every error in a row."""
    said = {column: cells.get(column, "") for column in COLUMNS}
    if no_row := unreadable(cells):
        yield no_row
        return
    if not said["turnout"]:
        yield "turnout", "turnout is empty", "Write the id of the turnout"
    else:
        yield from wrong_place(said | {"section": said["section"].removesuffix("*")}, known, variants)
    if said["action"] not in ACTIONS:
        yield "action", f"action is {said['action']!r}", suggestion(said["action"], ACTIONS)
    if said["band"] and said["band"] not in BANDS:
        yield "band", f"band is {said['band']!r}", suggestion(said["band"], BANDS)
    if said["action"] == "suppress" and not said["until"]:
        yield "until", "until is empty", "Write the day on which it is to speak again"
    for column in ("by", "reason"):
        if not said[column]:
            yield column, f"{column} is empty", "Write who and why: it stays in the record"
    times = ["at"] + ["until"] * bool(said["until"])
    wrong = {column: fault for column in times if (fault := wrong_time(said[column]))}
    for column, (more, remedy) in wrong.items():
        yield column, f"{column} is {said[column]!r}{more}", remedy
    if said["action"] == "acknowledge" and not wrong and _time(said["at"]) > now() + timedelta(days=1):
        yield "at", f"at {said['at']} has not come yet", "Write the day on which the alarm was seen"
    if said["until"] and not wrong and _time(said["until"]) <= _time(said["at"]):
        yield (
            "until",
            f"until {said['until']} is not after at {said['at']}",
            "Write the day on which it is to speak again",
        )


def acknowledgement(cells: Mapping) -> dict:
    """The row of the table ``acknowledgements`` for a valid row of the file."""
    said = {column: cells.get(column, "") for column in COLUMNS}
    section = said["section"]
    if section and section != "*" and "/" not in section:
        section = f"{said['turnout']}/{section}"
    row = {
        "turnout_id": said["turnout"],
        "section_id": section or None,
        "band": said["band"] or None,
        "action": said["action"],
        "by_whom": said["by"],
        "at_utc": _time(said["at"]),
        "until_utc": _time(said["until"]) if said["until"] else None,
        "reason": said["reason"],
    }
    return {"acknowledgement_id": _id(row)} | row


def _time(text: str) -> datetime:
    return datetime.fromisoformat(text.removesuffix("Z"))


def _id(row: dict) -> str:
    text = json.dumps([row[k] for k in sorted(row)], default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]
