"""Run the report step of the workflow and of ``turnout report``."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from turnout.errors import RegistryError
from turnout.registry.database import open_registry
from turnout.report.finding_pages import write_finding_pages
from turnout.report.site import AT_ONCE, write_pages, write_turnouts


def report_job(registry, pages, turnouts=None, log=None, threads=1, day=None) -> int:
    """Write the changed pages of the registry in folder ``registry`` into ``pages``; returns their number.

    They show the state on ``day`` (YYYY-MM-DD), by default today.
    """
    with open_registry(registry) as connection:
        _check_turnouts(connection, turnouts)
        generation, n_turnouts = connection.execute(
            "select (select generation from registry_info), (select count(*) from turnouts)"
        ).fetchall()[0]

        def write_parallel(content):
            _in_processes(registry, pages, content, generation, threads, day)

        writer = write_parallel if threads > 1 and n_turnouts > AT_ONCE else None
        n = write_pages(connection, pages, generation, turnouts or None, log is None, writer, day)
        write_finding_pages(connection, pages, generation, turnouts or None)
    if log is not None:
        with open(log, "w") as file:
            file.write(f"{n} pages of generation {generation} written, {n_turnouts + 1 - n} had not changed\n")
    return n


def _in_processes(registry, pages, content, generation, threads, day):
    """Write the pages in new processes, AT_ONCE turnouts each.

    Every process opens its own connection, because DuckDB connections cannot be forked.
    """
    names = list(content)
    with ProcessPoolExecutor(threads, multiprocessing.get_context("spawn")) as pool:
        shares = [{t: content[t] for t in names[k : k + AT_ONCE]} for k in range(0, len(names), AT_ONCE)]
        for future in [pool.submit(_write_share, registry, pages, share, generation, day) for share in shares]:
            future.result()


def _write_share(registry, pages, content, generation, day):
    with open_registry(registry) as connection:
        connection.execute("set threads = 1")
        write_turnouts(connection, pages, content, generation, day=day)


def _check_turnouts(connection, turnouts):
    turnout_ids = {row[0] for row in connection.execute("select turnout_id from turnouts").fetchall()}
    if unknown := sorted(set(turnouts or ()) - turnout_ids):
        raise RegistryError(
            f"no turnout {', '.join(unknown)} in the registry; it has {', '.join(sorted(turnout_ids)[:20])}."
        )
