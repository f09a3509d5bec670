"""Write the pages of a registry: one for the fleet, one for each turnout that has something new to say."""

import os
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader
from tqdm import tqdm

from turnout import __version__
from turnout.files import beside
from turnout.report.pages.fleet import fleet_page
from turnout.report.pages.turnout import turnout_page
from turnout.report.source import ROWS, FleetSource
from turnout.report.stale_pages import MARK, content_of, contents

AT_ONCE = 100


def write_pages(connection, folder, generation="", turnouts=None, progress=True, elsewhere=None, day=None):
    """Write ``folder``/index.html, and ``folder``/turnouts/<id>.html where it does not say what the registry says.

    Pages of turnouts that the registry does not know any more are removed.

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
    elsewhere : callable, optional
        Called with (turnout ids, their contents) instead of writing the turnouts' pages here.
    day : str, optional
        YYYY-MM-DD: what was known on this day is shown, by default today.

    Returns
    -------
    int
        Number of pages written.
    """
    folder = Path(folder)
    (folder / "turnouts").mkdir(parents=True, exist_ok=True)
    environment, shared = page_environment(), shared_by_pages(generation)
    source = FleetSource(connection, day)
    replace_page(folder / "index.html", fleet_page(source, environment.get_template("fleet.html"), shared))
    content = contents(source)
    if turnouts is None:
        _remove_others(folder / "turnouts", content)
    wanted = sorted(content if turnouts is None else set(turnouts) & set(content))
    stale = {t: content[t] for t in wanted if content_of(folder / "turnouts" / f"{t}.html") != content[t]}
    write = elsewhere or (lambda some: write_turnouts(connection, folder, some, generation, progress, day))
    if stale:
        write(stale)
    return 1 + len(stale)


def write_turnouts(connection, folder, content, generation="", progress=False, day=None):
    """Write the pages of the turnouts in ``content``, a mapping to the hash that each page carries."""
    source, shared = FleetSource(connection, day), shared_by_pages(generation)
    template = page_environment().get_template("turnout.html")
    names = list(content)
    with tqdm(total=len(names), desc="pages", disable=not progress, leave=False) as bar:
        for start in range(0, len(names), AT_ONCE):
            some = names[start : start + AT_ONCE]
            rows = source.of_some(some)
            for name in some:
                own = {kind: rows[kind].get(name, []) if kind in rows else [] for kind in {*ROWS, *rows}}
                mark = {"mark": MARK.format(content[name])}
                text = turnout_page(own, own["turnouts"][0], template, shared | mark)
                replace_page(Path(folder) / "turnouts" / f"{name}.html", text)
                bar.update()


def page_environment():
    """Where the templates are."""
    return Environment(loader=PackageLoader("turnout.report", "templates"), trim_blocks=True, autoescape=True)


def shared_by_pages(generation=""):
    """What every page shows: its style, and what made it."""
    css = (files("turnout.report") / "templates" / "page.css").read_text()
    return {"css": css, "version": __version__, "generation": generation}


def _remove_others(folder, known):
    """Remove our own pages of turnouts that are not ``known``; other files stay."""
    for path in folder.glob("*.html"):
        if path.stem not in known and content_of(path):
            path.unlink()


def replace_page(path, text):
    """Put a page in place in one step, so that nobody ever opens half of it."""
    temporary = beside(path)
    try:
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
