"""The catalogue of a registry: views, macros and comments.

Only constants depend on the live files: macros such as ``files_of_modes()`` list the files that a view reads, others
give times. So the catalogue of another generation is the same one with other constants.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import duckdb

from turnout.errors import RegistryError
from turnout.registry import view_texts
from turnout.registry.comments import OWN_MEANINGS, SPLIT_PARTS, add_comments, column_comment
from turnout.registry.parquet import MEASUREMENT_IDS, live_paths
from turnout.registry.schema import file_literal, literal, names, tables, time_column
from turnout.registry.supersede import LARGE_TABLES, latest_supersession, split_files

if TYPE_CHECKING:
    from collections.abc import Iterator
    from datetime import datetime
    from pathlib import Path

    from turnout.registry.generation import DataFile, Generation

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


def create_catalogue(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation, published: datetime) -> None:
    """Create all views and macros for a generation.

    Parameters
    ----------
    con : DuckDB connection
        Connection whose present database is empty.
    root : Path
        Folder of the registry, absolute.
    generation : Generation
        List of the live files.
    published : datetime
        Time of its publication. [UTC]

    Raises
    ------
    RegistryError
        When a view is not valid.
    """
    _set_files(con, root, generation)
    for source, table in _sources().items():
        columns = ", ".join(f'"{n}"' for n in names(table))
        options = f'union_by_name = "{BY_NAME}{source}"(), hive_partitioning = false'
        con.execute(f'create view "{source}" as select {columns} from read_parquet("{FILES}{source}"(), {options})')
    _set_times(con, root, generation, published)
    con.execute(view_texts.reasons_sql())
    for name, sql in view_texts.view_files().items():
        try:
            con.execute(sql)
        except duckdb.Error as error:
            raise RegistryError(f"views/{name}.sql: {error}") from error


def comment_catalogue(con: duckdb.DuckDBPyConnection) -> None:
    """Add a comment to every view, macro and column.

    Parameters
    ----------
    con : DuckDB connection
        Connection whose present database is a catalogue called "registry", writable.
    """
    add_comments(con, view_texts.view_files().values(), view_texts.view_columns(), LARGE_TABLES)


def use_generation(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation, published: datetime) -> None:
    """Give the catalogue of no files the constants of a generation.

    Parameters
    ----------
    con : DuckDB connection
        Connection whose present database is a copy of the template, writable.
    root : Path
        Folder of the registry, absolute.
    generation : Generation
        List of the live files.
    published : datetime
        Time of its publication. [UTC]
    """
    _set_files(con, root, generation, is_template=True)
    _set_times(con, root, generation, published)


FILES, BY_NAME = "files_of_", "by_name_"  # macros of a view: the files that it reads, whether their columns differ


def _sources() -> dict[str, str]:
    """Views that read files, with their tables."""
    return {t: t for t in tables()} | {f"{t}_{part}": t for t in LARGE_TABLES for part in SPLIT_PARTS}


def _files_by_source(generation: Generation) -> Iterator[tuple[str, str, list[DataFile]]]:
    for table in tables():
        yield table, table, generation.of(table)
    for table in LARGE_TABLES:
        for part, files in zip(SPLIT_PARTS, split_files(generation.of(table)), strict=True):
            yield f"{table}_{part}", table, files


def _set_files(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation, is_template: bool = False) -> None:
    statements: list[str] = []
    for source, table, files in _files_by_source(generation):
        paths, same_schema = live_paths(con, root, table, files)
        listed = ", ".join(file_literal(root / path) for path in paths)
        statements += _macro(f"{FILES}{source}", f"[{listed}]", f"Files that {source} reads.")
        if is_template and same_schema:
            continue  # as without files
        meaning = f"Whether files that {source} reads have other columns than now."
        statements += _macro(f"{BY_NAME}{source}", str(not same_schema).lower(), meaning)
    con.execute("; ".join(statements))


def _set_times(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation, published: datetime) -> None:
    until = con.execute(LAST_POSSIBLE_SQL).fetchall()[0][0]
    counted = newest_valid(con, root, generation)
    last = counted and min(counted, until or counted)
    newest = f"timestamp {literal(last)}" if last else "null::timestamp"
    info = (
        f"create or replace view registry_info as select {generation.number}::bigint as generation, "
        f"{literal(str(root))} as folder, {newest} as newest_measurement_at_utc, "
        f"{len(generation.files)}::bigint as n_files, {sum(f.bytes for f in generation.files)}::bigint as n_bytes, "
        f"{literal(view_texts.views_version())} as views_version"
    )
    own = "registry_info"
    comments = [
        f'comment on column {own}."{c["column"]}" is {literal(column_comment(c["meaning"], c["unit"]))}'
        for c in view_texts.view_columns()
        if c["view"] == own
    ]
    statements = [
        *_macro("newest_measurement", newest, OWN_MEANINGS["newest_measurement"]),
        *_macro("published_at", f"timestamp '{published:%Y-%m-%d}'", OWN_MEANINGS["published_at"]),
        info,
        f"comment on view {own} is {literal(OWN_MEANINGS[own])}",
        *comments,
    ]
    con.execute("; ".join(statements))


def _macro(name: str, value: str, meaning: str) -> tuple[str, str]:
    """Statements that make a macro without parameters, and its comment."""
    return f'create or replace macro "{name}"() as {value}', f'comment on macro "{name}" is {literal(meaning)}'


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
