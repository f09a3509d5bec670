"""Stage worklist: the sections that need attention, with the diagnoses of open alarms."""

import csv
import io
from datetime import datetime
from pathlib import Path
from typing import Any

from turnout.files import write_text
from turnout.registry.as_of import list_day
from turnout.registry.connection import limit_memory
from turnout.registry.database import open_registry
from turnout.registry.derived_tables import publish
from turnout.registry.spreadsheet import MARK, without_formula
from turnout.workflow.current_results import current_results


def worklist_job(
    generation: str | Path, worklist: str | Path, work: str | Path = "work", day: str | None = None
) -> int:
    """Publish the diagnoses of open alarms and write the worklist.

    Parameters
    ----------
    generation : path
        ``_generation.json`` of the registry.
    worklist : path
        The list as CSV; ``asof_utc`` shows whether it is of today.
    work : path
        Folder of intermediate results, with those of the stage change.
    day : str, optional
        Day of the list, YYYY-MM-DD; by default today.

    Returns
    -------
    int
        Number of diagnoses.
    """
    registry = Path(generation).parent
    with open_registry(registry) as con:
        turnouts = [turnout for (turnout,) in con.execute("select turnout_id from turnouts order by all").fetchall()]
    diagnoses = [
        row
        for turnout in turnouts
        for result in current_results(work, "change", turnout)
        for row in result.tables.get("change_findings", ())
    ]
    publish(registry, {"change_findings": diagnoses})
    with open_registry(registry) as con:
        limit_memory(con)
        asof = list_day(con, day)
        cursor = con.execute(f"select *, {asof} as asof_utc from worklist({asof}) order by rank")
        names = [column[0] for column in cursor.description]
        rows = [[_cell(value) for value in row] for row in cursor.fetchall()]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([names, *rows])
    write_text(worklist, MARK + text.getvalue())
    return len(diagnoses)


def _cell(value: Any) -> Any:
    """Value of a cell: a day without a time of day where it is midnight."""
    if isinstance(value, datetime):
        return value.isoformat(sep=" ").removesuffix(" 00:00:00")
    return without_formula(value)
