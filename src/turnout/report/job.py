"""The report step of the workflow and of ``turnout report``."""

from turnout.errors import RegistryError
from turnout.registry.database import open_registry
from turnout.report.write import write_pages


def report_job(registry, pages, turnouts=None, log=None) -> int:
    """Write the pages of the registry in folder ``registry`` into ``pages``; returns their number."""
    with open_registry(registry) as connection:
        _check_known(connection, turnouts)
        generation = connection.execute("select generation from registry_info").fetchall()[0][0]
        n = write_pages(connection, pages, generation, turnouts or None, progress=log is None)
    if log is not None:
        with open(log, "w") as file:
            file.write(f"{n} pages of generation {generation}\n")
    return n


def _check_known(connection, turnouts):
    known = {row[0] for row in connection.execute("select turnout_id from turnouts").fetchall()}
    if unknown := sorted(set(turnouts or ()) - known):
        raise RegistryError(f"no turnout {', '.join(unknown)} in the registry; it has {', '.join(sorted(known)[:20])}.")
