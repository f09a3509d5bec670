"""Write the pages of findings, from the registry for a fleet or from the rows of one diagnosis."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader

from turnout.config import load_configuration
from turnout.report.pages.finding import finding_page
from turnout.report.site import replace_page, shared_by_pages

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence
    from typing import Any

    import duckdb

NEWEST_SQL = """
    select f.* from findings_current f
    where visit = (select max(visit) from findings_current n where n.turnout_id = f.turnout_id) order by turnout_id
"""
CURVES_SQL = "select c.* from mismatch_curves c where finding_id in (select finding_id from findings_current)"
PARAMETERS_SQL = "select p.* from mismatch_parameters p where finding_id in (select finding_id from findings_current)"
QUARANTINE_SQL = "select * from quarantine_open where stage = 'mismatch' order by place"


def write_finding_pages(
    connection: duckdb.DuckDBPyConnection,
    folder: str | Path,
    generation: str | int = "",
    turnouts: Collection[str] | None = None,
) -> int:
    """Write ``folder``/findings/<id>.html for every turnout that was diagnosed.

    Parameters
    ----------
    connection : DuckDB connection
        An open registry.
    folder : str or Path
        Folder of the pages.
    generation : str or int
        Generation of the registry, shown at the foot of the page.
    turnouts : collection of str or None
        Ids of turnouts; None: all.

    Returns
    -------
    int
        Number of pages.
    """
    queries = {"mismatch_findings": NEWEST_SQL, "quarantine": QUARANTINE_SQL}
    rows = {table: _by_turnout(_fetch(connection, sql)) for table, sql in queries.items()}
    diagnosed = sorted(set(rows["mismatch_findings"]) | set(rows["quarantine"]))
    chosen = [t for t in diagnosed if turnouts is None or t in turnouts]
    for name in chosen:
        turnout_rows = {table: rows[table].get(name, []) for table in queries}
        turnout_rows["mismatch_curves"] = _fetch(
            connection, f"{CURVES_SQL} and turnout_id = ? order by curve_no", [name]
        )
        turnout_rows["mismatch_parameters"] = _fetch(connection, f"{PARAMETERS_SQL} and turnout_id = ?", [name])
        turnout_rows["sections"] = _fetch(
            connection, "select * from sections where turnout_id = ? order by position_m", [name]
        )
        about = _fetch(connection, "select * from turnouts where turnout_id = ?", [name])
        _write(folder, (about or [{"turnout_id": name}])[0], turnout_rows, generation)
    return len(chosen)


def write_diagnosis_page(
    tables: Mapping[str, Sequence[Mapping[str, Any]]], config: str | Path, turnout_id: str, folder: str | Path
) -> Path:
    """Write the page of one turnout from the rows of its diagnosis, without a registry.

    Parameters
    ----------
    tables : mapping
        Rows of the diagnosis by table.
    config : str or Path
        Folder of the configuration.
    turnout_id : str
        Id of the turnout.
    folder : str or Path
        Folder of the pages.

    Returns
    -------
    Path
        The page.
    """
    turnout = load_configuration(config).turnout(turnout_id)
    about = {"turnout_id": turnout.id, "name": turnout.name, "layout": turnout.layout}
    sections = [
        {"label": s.label, "panel": s.panel, "track": s.track, "position_m": s.position} for s in turnout.sections
    ]
    return _write(folder, about, {**tables, "sections": sections}, "")


def _write(
    folder: str | Path, about: Mapping[str, Any], rows: Mapping[str, Sequence[Mapping[str, Any]]], generation: str | int
) -> Path:
    environment = Environment(loader=PackageLoader("turnout.report"), trim_blocks=True, autoescape=True)
    templates = files("turnout.report") / "templates"
    shared = shared_by_pages(generation) | {"finding_css": (templates / "finding.css").read_text()}
    path = Path(folder) / "findings" / f"{about['turnout_id']}.html"
    replace_page(path, finding_page(about, rows, environment.get_template("finding.html"), shared))
    return path


def _fetch(connection: duckdb.DuckDBPyConnection, sql: str, parameters: Sequence[Any] = ()) -> list[dict[str, Any]]:
    cursor = connection.execute(sql, list(parameters))
    names = [d[0] for d in cursor.description]
    return [dict(zip(names, row)) for row in cursor.fetchall()]


def _by_turnout(rows: Iterable[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    grouped: dict[str, list] = {}
    for row in rows:
        grouped.setdefault(row["turnout_id"], []).append(row)
    return grouped
