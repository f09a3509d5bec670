"""Check and publish tables that are computed from the registry itself and replaced as a whole."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import duckdb

from turnout.errors import RegistryError
from turnout.registry.connection import connect
from turnout.registry.database import build_database, is_behind
from turnout.registry.generation import (
    DataFile,
    Generation,
    load,
    schema_of,
)
from turnout.registry.lock import registry_lock
from turnout.registry.parquet import write_sorted
from turnout.registry.publication import publish as publish_generation
from turnout.registry.schema import WHOLE_TABLES, key, tables, time_column

if TYPE_CHECKING:
    from typing import Any

    import pandas as pd
    import pyarrow as pa

TABLES_BY_YEAR = ("charts",)


def publish(
    registry_dir: PathLike,
    frames: Mapping[str, pd.DataFrame | pa.Table | Sequence[Mapping[str, Any]]],
    keep: Mapping[str, Collection[int]] | None = None,
) -> Generation:
    """Replace derived tables (charts, baselines, chart_status, alarms) by the rows of ``frames``, in one step.

    NaN becomes NULL, values are rounded to the resolution of ``columns.csv``, a missing column is NULL. The same rows
    give the same files; a table, or a year of it, that did not change is not published again.

    Parameters
    ----------
    registry_dir : path
        An existing registry, or a folder to make one in.
    frames : mapping of table to DataFrame, Arrow table or sequence of mappings
        All rows of each table, except the years in ``keep``. Few rows may be mappings, which take no further package.
    keep : mapping of table to years, optional
        Years of a table stored by year whose live files stay as they are.

    Raises
    ------
    RegistryError
        A row breaks a rule of ``columns.csv`` (the message names table, row, column and value), a column is unknown,
        the registry is locked or the disk is full. Then nothing was changed.
    """
    root = Path(registry_dir)
    with registry_lock(root):
        before, con = load(root), connect(temp_directory=str(root / ".spill"))
        number = before.number + 1
        files = list(before.files)
        for table in sorted(frames):
            _create_view(con, table, frames[table])
            unchanged_years = (keep or {}).get(table, ())
            files = [f for f in files if f.table != table or f.year in unchanged_years] + _write_table(con, root, table)
        live = {f.path for f in files}
        removed = [(f.path, number) for f in before.files if f.path not in live]
        files.sort(key=lambda f: f.path)
        if files == before.files:
            if is_behind(root, before):
                build_database(root, before)
            return before
        schemas = before.schemas | {f.schema: schema_of(f.table) for f in files if f.table in frames}
        now = Generation(number, files, [*before.retired, *removed], schemas, before.consumed, before.incomplete)
        publish_generation(root, now)
        return now


def _create_view(
    con: duckdb.DuckDBPyConnection, table: str, frame: pd.DataFrame | pa.Table | Sequence[Mapping[str, Any]]
) -> None:
    """Create view ``new_<table>`` of the rows, typed and rounded; RegistryError at the first bad row."""
    if table not in WHOLE_TABLES:
        raise RegistryError(f"{table} is not a table that is replaced whole; those are {', '.join(WHOLE_TABLES)}.")
    if isinstance(frame, Sequence):
        present = sorted({name for row in frame for name in row})
    else:
        present = list(getattr(frame, "column_names", None) or frame.columns)
    if unknown := sorted(set(present) - {c.name for c in tables()[table]}):
        raise RegistryError(f"{table}, column {unknown[0]}: columns.csv does not know it.")
    if isinstance(frame, Sequence):
        _insert_rows(con, table, frame, present)
    else:
        con.register(f"came_{table}", frame)
    expressions = []
    for c in tables()[table]:
        value = f'"{c.name}"::{c.type}' if c.name in present else f"null::{c.type}"
        if c.type in ("double", "float"):
            value = f"nullif({value}, 'nan'::{c.type})"
            value = value if c.decimals is None else f"round({value}, {c.decimals})"
        expressions.append(f'{value} as "{c.name}"')
    con.execute(f"create view new_{table} as select {', '.join(expressions)} from came_{table}")
    _reject_bad_rows(con, table)


def _insert_rows(
    con: duckdb.DuckDBPyConnection, table: str, rows: Sequence[Mapping[str, Any]], present: Sequence[str]
) -> None:
    """Table ``came_<table>`` of a few rows; a number that is not finite is NULL."""
    columns = [f'"{c.name}" {c.type}' for c in tables()[table]]
    con.execute(f"create temp table came_{table} ({', '.join(columns)})")
    names = ", ".join(f'"{name}"' for name in present)
    insert = f"insert into came_{table} ({names}) values ({', '.join('?' * len(present))})"
    for row in rows:
        values = [row.get(name) for name in present]
        con.execute(insert, [None if isinstance(v, float) and not math.isfinite(v) else v for v in values])


def _reject_bad_rows(con: duckdb.DuckDBPyConnection, table: str) -> None:
    rules = [(c, f'"{c.name}" is not null') for c in tables()[table] if c.required or c.key]
    rules += [(c, f"coalesce({c.check}, true)") for c in tables()[table] if c.check]
    counted = ", ".join(f"count(*) filter (not ({rule}))" for _, rule in rules)
    try:
        counts = con.execute(f"select {counted} from new_{table}").fetchall()[0]
    except duckdb.ConversionException as error:
        raise RegistryError(f"{table}: {str(error).splitlines()[0]}") from None
    for (column, rule), count in zip(rules, counts):
        if count:
            keys = ", ".join(f'"{k}"' for k in key(table))
            row = con.execute(f'select {keys}, "{column.name}" from new_{table} where not ({rule}) limit 1').fetchall()
            *where, value = row[0]
            requirement = "given" if value is None else column.rule
            raise RegistryError(
                f"{table}, row {' '.join(map(str, where))}, column {column.name}: {value}, must be {requirement} "
                f"({count} rows). Nothing was changed."
            )


def _write_table(con: duckdb.DuckDBPyConnection, root: Path, table: str) -> list[DataFile]:
    if table not in TABLES_BY_YEAR:
        written = write_sorted(con, root, table, None, f"select * from new_{table}", "all", True)
        return [written] if written else []
    year = f"year({time_column(table)})"
    years = con.execute(f"select distinct {year} from new_{table} order by 1").fetchall()
    each = (
        write_sorted(con, root, table, y, f"select * from new_{table} where {year} = {y}", "all", True)
        for (y,) in years
    )
    return [w for w in each if w]
