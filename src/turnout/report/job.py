"""Run the report step of the workflow and of ``turnout report``."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from turnout.child_processes import ProcessPool
from turnout.errors import RegistryError
from turnout.registry.connection import limit_memory
from turnout.registry.database import open_registry
from turnout.report.finding_pages import write_finding_pages
from turnout.report.site import AT_ONCE, write_pages, write_turnouts

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path

    import duckdb


def report_job(
    registry: str | Path,
    pages: str | Path,
    turnouts: Collection[str] | None = None,
    threads: int = 1,
    day: str | None = None,
    progress: bool = True,
) -> int:
    """Write the changed pages of a registry.

    Parameters
    ----------
    registry : str or Path
        Folder of the registry.
    pages : str or Path
        Folder of the pages.
    turnouts : collection of str or None
        Ids of turnouts; None: all.
    threads : int
        Number of processes.
    day : str or None
        Day whose state is shown, YYYY-MM-DD; None: today.
    progress : bool
        Show the progress.

    Returns
    -------
    int
        Number of pages that were written.

    Raises
    ------
    RegistryError
        For a turnout that the registry does not have.
    """
    with open_registry(registry) as connection:
        limit_memory(connection)
        _check_turnouts(connection, turnouts)
        generation, n_turnouts = connection.execute(
            "select (select generation from registry_info), (select count(*) from turnouts)"
        ).fetchall()[0]

        def write_parallel(content: Mapping[str, str]) -> None:
            _in_processes(registry, pages, content, generation, threads, day)

        writer = write_parallel if threads > 1 and n_turnouts > AT_ONCE else None
        n = write_pages(connection, pages, generation, turnouts or None, progress, writer, day)
        write_finding_pages(connection, pages, generation, turnouts or None)
    unchanged = n_turnouts + 1 - n
    logging.getLogger(__name__).info("%d pages of generation %d written, %d had not changed", n, generation, unchanged)
    return n


def _in_processes(
    registry: str | Path, pages: str | Path, content: Mapping[str, str], generation: int, threads: int, day: str | None
) -> None:
    """Write the pages in new processes, AT_ONCE turnouts each.

    Every process opens its own connection, because DuckDB connections cannot be forked.
    """
    names = list(content)
    with ProcessPool(threads, "spawn") as pool:
        shares = [{t: content[t] for t in names[k : k + AT_ONCE]} for k in range(0, len(names), AT_ONCE)]
        for future in [pool.submit(_write_share, registry, pages, share, generation, day) for share in shares]:
            future.result()


def _write_share(
    registry: str | Path, pages: str | Path, content: Mapping[str, str], generation: int, day: str | None
) -> None:
    with open_registry(registry) as connection:
        limit_memory(connection)
        write_turnouts(connection, pages, content, generation, day=day)


def _check_turnouts(connection: duckdb.DuckDBPyConnection, turnouts: Collection[str] | None) -> None:
    turnout_ids = {row[0] for row in connection.execute("select turnout_id from turnouts").fetchall()}
    if unknown := sorted(set(turnouts or ()) - turnout_ids):
        raise RegistryError(
            f"no turnout {', '.join(unknown)} in the registry; it has {', '.join(sorted(turnout_ids)[:20])}."
        )
