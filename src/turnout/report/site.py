"""Write the pages of a registry: one for the fleet, and one for each turnout with a change."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader
from tqdm import tqdm

from turnout import __version__
from turnout.counts import count_of
from turnout.files import make_folder, write_text
from turnout.report.pages.fleet import fleet_page
from turnout.report.pages.glossary import glossary_page
from turnout.report.pages.turnout import turnout_page
from turnout.report.panels.train_bars import train_bars
from turnout.report.source import ROWS, FleetSource
from turnout.report.stale_pages import HASH_MARK, page_hash, page_hashes
from turnout.report.trains import FACTORS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence
    from typing import Any

    import duckdb

AT_ONCE = 100  # turnouts whose rows are read by one set of queries


def write_pages(
    connection: duckdb.DuckDBPyConnection,
    folder: str | Path,
    generation: str | int = "",
    turnouts: Collection[str] | None = None,
    progress: bool = True,
    writer: Callable[[dict[str, str]], None] | None = None,
    day: str | None = None,
) -> int:
    """Write ``folder``/index.html and glossary.html, and ``folder``/turnouts/<id>.html where its content has changed.

    Pages of turnouts that are no longer in the registry are removed.

    Parameters
    ----------
    connection : duckdb connection
        An open registry, see ``turnout.registry.open_registry``.
    folder : path
        Created where it does not exist.
    generation : str
        Shown at the foot of every page.
    turnouts : iterable of str, optional
        Only these turnouts' pages; the fleet's page is always written.
    progress : bool
        Whether a progress bar is shown.
    writer : callable, optional
        Called with {turnout id: content hash} of the pages to write, instead of writing them in this process.
    day : str, optional
        YYYY-MM-DD: day whose states and worklist are shown, by default today.

    Returns
    -------
    int
        Number of pages written, without the glossary.
    """
    folder = Path(folder)
    make_folder(folder / "turnouts")
    environment, shared = page_environment(), shared_by_pages(generation)
    source = FleetSource(connection, day)
    replace_page(folder / "index.html", fleet_page(source, environment.get_template("fleet.html"), shared))
    replace_page(folder / "glossary.html", glossary_page(environment.get_template("glossary.html"), shared))
    content = page_hashes(source)
    if turnouts is None:
        _remove_stale(folder / "turnouts", content)
    wanted = sorted(content if turnouts is None else set(turnouts) & set(content))
    stale = {t: content[t] for t in wanted if page_hash(folder / "turnouts" / f"{t}.html") != content[t]}
    write = writer or (lambda some: write_turnouts(connection, folder, some, generation, progress, day))
    if stale:
        write(stale)
    return 1 + len(stale)


def write_turnouts(
    connection: duckdb.DuckDBPyConnection,
    folder: str | Path,
    content: Mapping[str, str],
    generation: str | int = "",
    progress: bool = False,
    day: str | None = None,
) -> None:
    """Write the pages of turnouts.

    Parameters
    ----------
    connection : DuckDB connection
        An open registry.
    folder : str or Path
        Folder of the pages.
    content : mapping
        Hash that is stored in the page, by turnout id.
    generation : str or int
        Generation of the registry, shown at the foot of the page.
    progress : bool
        Whether a progress bar is shown.
    day : str or None
        Day whose state is shown, YYYY-MM-DD; None: today.
    """
    source, shared = FleetSource(connection, day), shared_by_pages(generation)
    template = page_environment().get_template("turnout.html")
    names = list(content)
    with tqdm(total=len(names), desc="pages", disable=not progress, leave=False) as bar:
        for start in range(0, len(names), AT_ONCE):
            some = names[start : start + AT_ONCE]
            rows = source.rows_of(some)
            for name in some:
                turnout_rows = {table: rows[table].get(name, []) if table in rows else [] for table in {*ROWS, *rows}}
                mark = {"mark": HASH_MARK.format(content[name])}
                text = turnout_page(turnout_rows, turnout_rows["turnouts"][0], template, shared | mark)
                replace_page(Path(folder) / "turnouts" / f"{name}.html", text)
                bar.update()


def page_environment() -> Environment:
    """Jinja environment with the templates of the package."""
    environment = Environment(loader=PackageLoader("turnout.report", "templates"), trim_blocks=True, autoescape=True)
    environment.filters["of"] = count_of
    return environment


def shared_by_pages(generation: str | int = "") -> dict[str, Any]:
    """Template variables of every page: style, scripts, version of the program and generation.

    Parameters
    ----------
    generation : str or int
        Generation of the registry.

    Returns
    -------
    dict
        ``css``, ``script``, ``chart_script``, ``version`` and ``generation``.
    """
    templates = files("turnout.report") / "templates"
    names = ("page.css", "fleet.js", "chart.js")
    css, script, chart_script = ((templates / name).read_text(encoding="utf-8") for name in names)
    chart_script = "\n".join(line.strip() for line in chart_script.partition("*/")[2].splitlines())
    return {
        "css": css,
        "script": script,
        "chart_script": chart_script,
        "version": __version__,
        "generation": generation,
    }


def _remove_stale(folder: Path, turnout_ids: Collection[str]) -> None:
    """Remove pages of this program for turnouts that are not in ``turnout_ids``; other files stay."""
    for path in folder.glob("*.html"):
        if path.stem not in turnout_ids and page_hash(path):
            path.unlink()


def replace_page(path: Path, text: str) -> None:
    """Write a page in one step, so that no reader sees an incomplete one.

    Parameters
    ----------
    path : Path
        File of the page.
    text : str
        Its whole text.
    """
    write_text(path, text)


def bars_page(turnout: str, rows: Sequence[Mapping[str, Any]], sections: Sequence[Mapping[str, Any]]) -> str:
    """A page with the bars of the fit by train type, speed and axle load.

    Parameters
    ----------
    turnout : str
        Turnout.
    rows : sequence of mapping
        From ``paper_tables.class_rows``.
    sections : sequence of mapping
        Rows of ``sections``, in the order along the track.

    Returns
    -------
    str
        HTML in one file.
    """
    charts = "".join(train_bars(factor, rows, sections) for factor in FACTORS)
    template = page_environment().get_template("bars.html")
    return template.render(turnout=turnout, charts=charts, **shared_by_pages())
