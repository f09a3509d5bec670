"""Write the pages of findings, from the registry for a fleet or from the rows of one diagnosis."""

from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader

from turnout import __version__
from turnout.config import load_configuration
from turnout.report.pages.finding import finding_page
from turnout.report.write import replace_page

NEWEST = """
    select f.* from findings_current f
    where visit = (select max(visit) from findings_current n where n.turnout_id = f.turnout_id) order by turnout_id
"""
CURVES = "select c.* from mismatch_curves c where finding_id in (select finding_id from findings_current)"
PARAMETERS = "select p.* from mismatch_parameters p where finding_id in (select finding_id from findings_current)"
SILENT = "select * from quarantine_open where stage = 'mismatch' order by place"


def write_finding_pages(connection, folder, generation="", turnouts=None) -> int:
    """Write ``folder``/findings/<id>.html for every turnout that was diagnosed; returns their number."""
    kinds = {"mismatch_findings": NEWEST, "quarantine": SILENT}
    rows = {kind: _by_turnout(_fetch(connection, sql)) for kind, sql in kinds.items()}
    diagnosed = sorted(set(rows["mismatch_findings"]) | set(rows["quarantine"]))
    chosen = [t for t in diagnosed if turnouts is None or t in turnouts]
    for name in chosen:
        own = {kind: rows[kind].get(name, []) for kind in kinds}
        own["mismatch_curves"] = _fetch(connection, f"{CURVES} and turnout_id = ? order by curve_no", [name])
        own["mismatch_parameters"] = _fetch(connection, f"{PARAMETERS} and turnout_id = ?", [name])
        own["sections"] = _fetch(connection, "select * from sections where turnout_id = ? order by position_m", [name])
        about = _fetch(connection, "select * from turnouts where turnout_id = ?", [name])
        _write(folder, (about or [{"turnout_id": name}])[0], own, generation)
    return len(chosen)


def write_own_page(tables, config, turnout_id, folder) -> Path:
    """Write the page of one turnout from the rows of its diagnosis, without a registry."""
    turnout = load_configuration(config).turnout(turnout_id)
    about = {"turnout_id": turnout.id, "name": turnout.name, "layout": turnout.layout}
    sections = [
        {"label": s.label, "panel": s.panel, "track": s.track, "position_m": s.position} for s in turnout.sections
    ]
    return _write(folder, about, {**tables, "sections": sections}, "")


def _write(folder, about, rows, generation) -> Path:
    environment = Environment(loader=PackageLoader("turnout.report"), trim_blocks=True, autoescape=True)
    templates = files("turnout.report") / "templates"
    css, own = ((templates / name).read_text() for name in ("page.css", "finding.css"))
    shared = {"css": css, "finding_css": own, "version": __version__, "generation": generation}
    path = Path(folder) / "findings" / f"{about['turnout_id']}.html"
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_page(path, finding_page(about, rows, environment.get_template("finding.html"), shared))
    return path


def _fetch(connection, sql, parameters=()):
    cursor = connection.execute(sql, list(parameters))
    names = [d[0] for d in cursor.description]
    return [dict(zip(names, row)) for row in cursor.fetchall()]


def _by_turnout(rows):
    found: dict[str, list] = {}
    for row in rows:
        found.setdefault(row["turnout_id"], []).append(row)
    return found
