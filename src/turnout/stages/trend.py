"""Stage trend: charts, alarms and states from the registry; then the worklist with the diagnoses of open alarms."""

import json
import logging
from pathlib import Path
from typing import Any

import pandas as pd

from turnout.config import load_configuration
from turnout.files import read_json, write_text
from turnout.registry.as_of import list_day
from turnout.registry.database import open_registry
from turnout.registry.derived_tables import publish
from turnout.registry.spreadsheet import without_formula
from turnout.trend.tables import arrow_rows
from turnout.trend.update import update
from turnout.workflow.current_results import current_results


def trend_job(
    generation: str | Path, state: str | Path, configuration: str | Path, day: str | None = None
) -> dict[str, Any]:
    """Bring the charts and alarms of a registry up to date.

    Parameters
    ----------
    generation : path
        ``_generation.json`` of the registry.
    state : path
        JSON file of the last update, which is replaced. It may be missing or truncated.
    configuration : path
        Folder of the configuration: settings of the trend, acknowledgements.csv. An invalid row of that file is a
        warning in the log and in ``state``; the others count.
    day : str, optional
        The present day, YYYY-MM-DD; by default today.

    Returns
    -------
    dict
        The new state.
    """
    registry, state = Path(generation).parent, Path(state)
    old_state = read_json(state, {})
    loaded = load_configuration(configuration)
    warnings = [str(warning) for warning in loaded.warnings]
    for warning in warnings:
        logging.getLogger("turnout.trend").warning("%s", warning)
    acknowledgements = [dict(row) for row in loaded.acknowledgements]
    result = update(
        registry, loaded.settings["trend"], old_state.get("digests"), acknowledgements=acknowledgements, day=day
    )
    newest = result.newest.isoformat() if result.newest else None
    new_state = {"rows": result.rows, "generation": result.generation, "newest": newest, "digests": result.digests}
    new_state |= {"warnings": warnings} if warnings else {}
    write_text(state, json.dumps(new_state, indent=1, sort_keys=True) + "\n")
    return new_state


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
    found = [
        row
        for turnout in turnouts
        for result in current_results(work, "change", turnout)
        for row in result.tables.get("change_findings", ())
    ]
    publish(registry, {"change_findings": arrow_rows("change_findings", pd.DataFrame(found))})
    with open_registry(registry) as con:
        asof = list_day(con, day)
        rows = con.execute(f"select *, {asof} as asof_utc from worklist({asof}) order by rank").df()
    write_text(worklist, rows.map(without_formula).to_csv(index=False, lineterminator="\n"))
    return len(found)
