"""Write the pages of a registry: one for the fleet, one for each turnout."""

import os
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader
from tqdm import tqdm

from turnout import __version__
from turnout.report.pages.fleet import fleet_page
from turnout.report.pages.turnout import turnout_page
from turnout.report.source import ROWS, FleetSource

AT_ONCE = 100


def write_pages(connection, folder, generation="", turnouts=None, progress=True):
    """Write ``folder``/index.html and ``folder``/turnouts/<id>.html.

    Parameters
    ----------
    connection : duckdb connection
        An open registry, see ``turnout.registry.open_registry``.
    folder : path
        Made where it does not exist.
    generation : str
        Shown at the foot of every page.
    turnouts : iterable of str, optional
        Only these turnouts' pages; the fleet's page is always written.

    Returns
    -------
    int
        Number of pages written.
    """
    folder = Path(folder)
    (folder / "turnouts").mkdir(parents=True, exist_ok=True)
    environment = Environment(loader=PackageLoader("turnout.report"), trim_blocks=True, autoescape=True)
    css = (files("turnout.report") / "templates" / "page.css").read_text()
    shared = {"css": css, "version": __version__, "generation": generation}
    source = FleetSource(connection)
    _replace(folder / "index.html", fleet_page(source, environment.get_template("fleet.html"), shared))
    wanted = None if turnouts is None else set(turnouts)
    chosen = [t for t in source.turnouts() if wanted is None or t["turnout_id"] in wanted]
    template = environment.get_template("turnout.html")
    with tqdm(total=len(chosen), desc="pages", disable=not progress, leave=False) as bar:
        for start in range(0, len(chosen), AT_ONCE):
            some = chosen[start : start + AT_ONCE]
            rows = source.of_some([t["turnout_id"] for t in some])
            for turnout in some:
                name = turnout["turnout_id"]
                own = {kind: rows[kind].get(name, []) if kind in rows else [] for kind in ROWS}
                _replace(folder / "turnouts" / f"{name}.html", turnout_page(own, turnout, template, shared))
                bar.update()
    return 1 + len(chosen)


def _replace(path, text):
    """Put the page in place in one step, so that nobody ever opens half of it."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)
