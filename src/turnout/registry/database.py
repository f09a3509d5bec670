"""Build and open ``registry.duckdb``: views over the live files, macros and comments, but no data.

Views and macros are in one SQL file per question and are created in the order of their dependencies.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import duckdb

from turnout.errors import REASONS, RegistryError
from turnout.files import publish_file, temporary_path
from turnout.registry.comments import add_comments
from turnout.registry.generation import Generation, load
from turnout.registry.ids import content_id
from turnout.registry.parquet import MEASUREMENT_IDS, read_live
from turnout.registry.schema import file_literal, literal, tables, time_column
from turnout.registry.staging import connect
from turnout.registry.supersede import LARGE_TABLES, create_split_views, latest_supersession

if TYPE_CHECKING:
    from os import PathLike

_NEEDS = re.compile(r"^--\s*needs:\s*(.+)$", re.MULTILINE)
_COLUMNS = re.compile(r"^-- columns of (\w+)(.*)\n((?:--.*(?:\n|$))+)", re.MULTILINE)
_COLUMN_FIELDS = ("view", "parameters", "column", "type", "unit", "meaning")


@cache
def view_files() -> dict[str, str]:
    """SQL text of every file in ``views``, each after those it depends on; ties by name.

    >>> order = list(view_files())
    >>> order.index("superseded") < order.index("modes_current")
    True
    """
    folder = files("turnout.registry") / "views"
    texts = {p.name[:-4]: p.read_text(encoding="utf-8") for p in folder.iterdir() if p.name.endswith(".sql")}
    return sort_by_needs(texts)


def sort_by_needs(texts: dict[str, str]) -> dict[str, str]:
    """Files sorted by dependency: each follows those in its line ``-- needs: a, b``.

    Parameters
    ----------
    texts : dict
        SQL text by name.

    Returns
    -------
    dict
        The same texts, sorted.

    Raises
    ------
    RegistryError
        If a file needs one that does not exist, or files need each other in a circle.

    Examples
    --------
    >>> list(sort_by_needs({"a": "-- needs: c", "b": "", "c": ""}))
    ['b', 'c', 'a']
    """
    sorter: TopologicalSorter = TopologicalSorter()
    for name in sorted(texts):
        needs = [n.strip() for line in _NEEDS.findall(texts[name]) for n in line.split(",") if n.strip()]
        if missing := [n for n in needs if n not in texts]:
            raise RegistryError(f"views/{name}.sql needs {', '.join(missing)}, and there is no such file.")
        sorter.add(name, *needs)
    try:
        sorter.prepare()
    except CycleError as error:
        raise RegistryError(f"views need each other in a circle: {' -> '.join(error.args[1])}") from None
    order: list[str] = []
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        order += ready
        sorter.done(*ready)
    return {name: texts[name] for name in order}


def reasons_sql() -> str:
    """SQL of the view ``reasons``: every reason code with its meaning."""
    values = ", ".join(f"({literal(code)}, {literal(meaning)})" for code, meaning in REASONS.items())
    return f"create or replace view reasons as select * from (values {values}) as r(reason_code, meaning)"


def newest_valid(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation) -> str | None:
    """ISO time of the newest measurement that is not superseded.

    Files are read in the order of their newest time, until no other can hold a later time.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the views of the registry.
    root : Path
        Folder of the registry.
    generation : Generation
        List of the live files.

    Returns
    -------
    str or None
        Time, None without a measurement.
    """
    con.execute(f"create or replace temp table no_longer as {latest_supersession('supersedes')}")
    newest = None
    for file in sorted((f for f in generation.files if f.newest), key=lambda f: str(f.newest), reverse=True):
        if newest is not None and str(file.newest) <= newest:
            break
        source = f"read_parquet({file_literal(root / file.path)})"
        counts = f"{MEASUREMENT_IDS[file.table]} not in (select old_id from no_longer)"
        rows = con.execute(f"select max({time_column(file.table)})::varchar from {source} where {counts}").fetchall()
        newest = max(filter(None, (newest, rows[0][0])), default=None)
    con.execute("drop table no_longer")
    return newest


DATABASE = "registry.duckdb"
# Every DuckDB since 1.2 opens it; tools with an older DuckDB could not read the newest format.
STORAGE_VERSION = "v1.2.0"
OFFLINE_CONFIG: dict[str, str | bool | int | float | list[str]] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
}

# No measurement can be later than the last run and the last campaign, so a logger clock that is ahead is ignored. The
# date of a campaign is entered by people. One after the last run counts only if most turnouts have one: then the clock
# of this machine is late.
LAST_POSSIBLE_SQL = """
    with clock as (select max(ended_at_utc) as at_utc from runs),
    last as (select turnout_id, max(started_at_utc) as at_utc from campaigns group by turnout_id),
    judged as (
        select l.at_utc, coalesce(l.at_utc > c.at_utc + interval 1 day, false) as is_ahead
        from last l cross join clock c
    )
    select greatest(
        (select at_utc from clock),
        (select case when 2 * count(*) filter (is_ahead) > count(*) then max(at_utc)
            else max(at_utc) filter (not is_ahead) end from judged)
    )::varchar"""


def open_registry(
    path: str | PathLike, read_only: bool = True, as_of: int | str | datetime | None = None
) -> duckdb.DuckDBPyConnection:
    """Open a registry.

    It is read-only by default: the next registration replaces the file with all that was written into it. An earlier
    generation has its views in memory.

    Parameters
    ----------
    path : str or PathLike
        Folder of the registry, or its ``registry.duckdb``.
    read_only : bool
        Whether nothing can be written.
    as_of : int, str, datetime or None
        Number of a kept generation, or a time (ISO text or datetime, UTC where it states no zone): what readers saw
        then. Generations are kept for a day. None: the present one.

    Returns
    -------
    DuckDB connection
        Connection that loads no extension.

    Raises
    ------
    RegistryError
        When there is none, when it cannot be opened, when it was moved and not relocated, or when the generation
        ``as_of`` is not kept.
    """
    path = Path(path)
    file = path / DATABASE if path.is_dir() else path
    if as_of is not None and file.exists():
        return _open_generation(file.parent, as_of)
    if not file.exists():
        raise RegistryError(
            f"{file}: there is no registry here. Run the pipeline, or give the folder that holds {DATABASE}."
        )
    try:
        connection = duckdb.connect(str(file), read_only=read_only, config=OFFLINE_CONFIG)
        connection.execute("set enable_progress_bar = false")
        ((folder,),) = connection.execute("select folder from registry_info").fetchall()
    except duckdb.Error as error:
        raise RegistryError(f"{file}: cannot be opened: {str(error).splitlines()[0]}") from error
    if not Path(folder).is_dir():
        connection.close()
        remedy = f"Where it was moved, run once: turnout registry relocate --registry '{file.parent}'"
        raise RegistryError(f"{file}: was made in {folder}, which is not there. {remedy}.")
    return connection


def _open_generation(folder: Path, as_of: int | str | datetime) -> duckdb.DuckDBPyConnection:
    """Views of an earlier generation in a database in memory."""
    from turnout.registry.publication import find_generation  # it publishes what this module builds

    generation, time = find_generation(folder, as_of)
    connection = duckdb.connect(":memory:", config=OFFLINE_CONFIG)
    connection.execute("set enable_progress_bar = false")
    try:
        _create_views(connection, folder.resolve(), generation, time or datetime.now(UTC))
    except duckdb.Error as error:
        connection.close()
        raise RegistryError(f"{folder}, generation {generation.number}: {str(error).splitlines()[0]}") from error
    return connection


def build_database(registry_dir: Path, generation: Generation) -> None:
    """Make ``registry.duckdb`` for a generation as a temporary file, then replace the old one in one step.

    The views hold absolute paths, so that it can be opened from any folder.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    generation : Generation
        List of the live files.

    Raises
    ------
    RegistryError
        When the file cannot be written, or a view is not valid.
    """
    root = Path(registry_dir).resolve()
    unfinished = temporary_path(root / "registry")
    con = connect()
    try:
        con.execute(f"attach {literal(str(unfinished))} as registry (storage_version '{STORAGE_VERSION}')")
        con.execute("use registry")
        _create_views(con, root, generation, datetime.now(UTC))
        con.execute("use memory")
        con.execute("detach registry")
        publish_file(unfinished, root / DATABASE)
    except (duckdb.IOException, duckdb.TransactionException, duckdb.OutOfMemoryException, OSError) as error:
        # DuckDB reports a full disk also as a transaction that cannot be committed
        raise RegistryError(
            f"cannot write {DATABASE}: {str(error).splitlines()[0]}. The new rows are in; make room, then "
            "'turnout registry relocate' makes the file again."
        ) from error
    finally:
        con.close()
        for leftover in (unfinished, Path(f"{unfinished}.wal")):
            leftover.unlink(missing_ok=True)


def is_behind(registry_dir: Path, generation: Generation) -> bool:
    """Whether ``registry.duckdb`` is missing, of another generation, for another folder, or has other views.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    generation : Generation
        List of the live files.

    Returns
    -------
    bool
        Whether it must be built again.
    """
    file = Path(registry_dir) / DATABASE
    if not file.exists():
        return True
    try:
        with duckdb.connect(str(file), read_only=True, config=OFFLINE_CONFIG) as con:
            row = con.execute("select generation, folder, views_version from registry_info").fetchall()[0]
    except duckdb.Error:
        return True
    return row != (generation.number, str(Path(registry_dir).resolve()), views_version())


@cache
def views_version() -> str:
    """Hash of all views, reasons and column descriptions; a program with another one rebuilds the database."""
    described = [(c.table, c.name, c.unit, c.meaning) for t in tables().values() for c in t]
    return content_id("views", view_files(), reasons_sql(), described, list(view_columns()))


def rebuild_database(registry_dir: Path) -> Generation:
    """Make ``registry.duckdb`` again from the generation file, for instance after the folder was moved.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.

    Returns
    -------
    Generation
        The list of live files.

    Raises
    ------
    RegistryError
        When the generation file or the folder cannot be used.
    """
    generation = load(Path(registry_dir))
    build_database(Path(registry_dir), generation)
    return generation


def _create_views(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation, published: datetime) -> None:
    for table in tables():
        con.execute(f'create view "{table}" as {read_live(con, root, table, generation.of(table))}')
    for table in LARGE_TABLES:
        create_split_views(con, root, table, generation.of(table))
    until = con.execute(LAST_POSSIBLE_SQL).fetchall()[0][0]
    counted = newest_valid(con, root, generation)
    last = counted and min(counted, until or counted)
    newest = f"timestamp {literal(last)}" if last else "null::timestamp"
    con.execute(f"create macro newest_measurement() as {newest}")
    con.execute(f"create macro published_at() as timestamp '{published:%Y-%m-%d}'")
    con.execute(
        f"create view registry_info as select {generation.number}::bigint as generation, "
        f"{literal(str(root))} as folder, {newest} as newest_measurement_at_utc, "
        f"{len(generation.files)}::bigint as n_files, {sum(f.bytes for f in generation.files)}::bigint as n_bytes, "
        f"{literal(views_version())} as views_version"
    )
    con.execute(reasons_sql())
    for name, sql in view_files().items():
        try:
            con.execute(sql)
        except duckdb.Error as error:
            raise RegistryError(f"views/{name}.sql: {error}") from error
    add_comments(con, view_files().values(), view_columns(), LARGE_TABLES)


@cache
def view_columns() -> tuple[dict[str, str], ...]:
    """Columns of all views and macros, from the comments ``-- columns of <name>`` at the end of their files.

    Returns
    -------
    tuple of dict
        Per column: view, parameters (of a macro), column, type, unit and meaning.

    Raises
    ------
    RegistryError
        When a line below such a comment is not ``-- column | type | unit | meaning``.
    """
    return tuple(row for name, sql in view_files().items() for row in described_columns(name, sql))


def described_columns(name: str, sql: str) -> Iterator[dict[str, str]]:
    """Columns that one file of views describes.

    Parameters
    ----------
    name : str
        Name of the file, without ``.sql``.
    sql : str
        Its text.

    Yields
    ------
    dict
        As in `view_columns`.

    Raises
    ------
    RegistryError
        When a line is not ``-- column | type | unit | meaning``.

    >>> list(described_columns("file", "-- columns of a(b)\\n-- c | double | Hz | frequency"))[0]["parameters"]
    '(b)'
    """
    for view, parameters, block in _COLUMNS.findall(sql):
        for line in block.splitlines():
            values = [value.strip() for value in line.removeprefix("--").split("|")]
            if len(values) != 4:
                raise RegistryError(f"views/{name}.sql: expected '-- column | type | unit | meaning', found {line!r}")
            yield dict(zip(_COLUMN_FIELDS, (view, parameters, *values), strict=True))
