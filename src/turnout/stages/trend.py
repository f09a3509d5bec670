"""Stage trend: charts, alarms and states from the registry."""

import json
import logging
from pathlib import Path
from typing import Any

from turnout.files import read_json, write_text
from turnout.trend.update import update
from turnout.workflow.launch import usable_configuration


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
    loaded = usable_configuration(configuration)
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
