"""Merge many small files into one sorted file per table and year; the rows stay the same."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.errors import RegistryError
from turnout.registry.connection import connect
from turnout.registry.damage import take_off_damage
from turnout.registry.database import build_database
from turnout.registry.generation import (
    DataFile,
    Generation,
    load,
    schema_of,
)
from turnout.registry.lock import registry_lock
from turnout.registry.parquet import folder_of, read_list, read_live, write_sorted
from turnout.registry.publication import publish
from turnout.registry.schema import WHOLE_TABLES, file_literal, tables
from turnout.registry.supersede import LARGE_TABLES, count_superseded, latest_supersession, split_superseded

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import duckdb


def compact(registry_dir: PathLike, at_least: int = 2) -> dict[str, tuple[int, int]]:
    """Merge the files of every table and year that has many.

    Readers may continue meanwhile: the old files stay for another day. A damaged file is not merged: it is
    logged and taken off the list (``turnout.registry.damage``).

    Parameters
    ----------
    registry_dir : PathLike
        Folder of the registry.
    at_least : int
        Number of files from which they are merged, 2 or more.

    Returns
    -------
    dict
        Number of files and rows that were merged, by folder.

    Raises
    ------
    RegistryError
        When the disk is full or the registry is locked; then nothing is changed.
    """
    root = Path(registry_dir)
    with registry_lock(root):
        before = take_off_damage(root, load(root))
        groups = {g: files for g, files in _groups(before).items() if _is_worth_merging(files, max(2, at_least))}
        return _rewrite(root, before, groups, lambda table, files: read_list(root, table, [f.path for f in files]))


def rebuild(registry_dir: PathLike) -> dict[str, tuple[int, int]]:
    """Rewrite all files with the present ``columns.csv``: values are cast, new columns NULL, old columns removed.

    A damaged file is logged and taken off the list.

    Parameters
    ----------
    registry_dir : PathLike
        Folder of the registry.

    Returns
    -------
    dict
        Number of files and rows that were rewritten, by folder.

    Raises
    ------
    RegistryError
        When a value cannot be cast; then nothing is changed.
    """
    root = Path(registry_dir)
    with registry_lock(root):
        before = take_off_damage(root, load(root))
        groups = {g: files for g, files in _groups(before).items() if g[0] in tables()}
        merged = _rewrite(root, before, groups, lambda table, files: _cast(root, before, table, files))
        return merged


def _groups(generation: Generation) -> dict[tuple[str, int | None], list[DataFile]]:
    groups: dict[tuple[str, int | None], list[DataFile]] = {}
    for file in generation.files:
        groups.setdefault((file.table, file.year), []).append(file)
    return groups


def _is_worth_merging(files: list[DataFile], at_least: int) -> bool:
    """Whether merging is useful: enough files with valid rows, or one with valid and superseded rows."""
    return sum(f.dead < f.rows for f in files) >= at_least or any(0 < f.dead < f.rows for f in files)


def _rewrite(
    root: Path,
    before: Generation,
    groups: Mapping[tuple[str, int | None], list[DataFile]],
    select: Callable[[str, list[DataFile]], str],
) -> dict[str, tuple[int, int]]:
    """Write each group as one file, check that no row was lost, and publish."""
    if not groups and not before.incomplete:
        build_database(root, before)
        return {}
    number, con = before.number + 1, connect(temp_directory=str(root / ".spill"))
    con.execute(f"create view said as {read_live(con, root, 'supersedes', before.of('supersedes'))}")
    con.execute(f"create table superseded as {latest_supersession('said')}")
    files, retired, summary = list(before.files), list(before.retired), {}
    for (table, year), merged in groups.items():
        written = _write(con, root, table, year, merged, select(table, merged))
        written_paths = {w.path for w in written}
        removed_paths = {f.path for f in merged} - written_paths
        retired += [(path, number) for path in sorted(removed_paths)]
        files = [f for f in files if f.path not in removed_paths | written_paths] + written
        summary[folder_of(table, year)] = (len(merged), sum(w.rows for w in written))
    files = sorted(count_superseded(con, root, files), key=lambda f: f.path)
    schemas = {f.schema: before.schemas.get(f.schema) or schema_of(f.table) for f in files}
    now = replace(before, number=number, files=files, retired=retired, schemas=schemas)
    publish(root, now)
    return summary


def _write(
    con: duckdb.DuckDBPyConnection, root: Path, table: str, year: int | None, merged: list[DataFile], sql: str
) -> list[DataFile]:
    """Write the rows of ``sql`` as one file, or as two if some are superseded; RegistryError if a row was lost."""
    prefix = "all" if table in WHOLE_TABLES else "compact"
    selects = [(prefix, sql)]
    if table in LARGE_TABLES and any(f.dead for f in merged):
        selects = list(zip((prefix, "superseded"), split_superseded(table, sql)))
    written = [w for name, select in selects if (w := write_sorted(con, root, table, year, select, name))]
    expected, got = sum(f.rows for f in merged), sum(w.rows for w in written)
    if got != expected:
        raise RegistryError(f"{table} {year}: {expected} rows expected, {got} written. Nothing was changed.")
    return written


def _cast(root: Path, before: Generation, table: str, files: list[DataFile]) -> str:
    """SQL over files of several schemas, every value cast to the present type of its column."""
    selects = []
    for schema in sorted({f.schema for f in files}):
        old_columns = before.schemas[schema]
        columns = ", ".join(
            f'"{c.name}"::{c.type} as "{c.name}"' if c.name in old_columns else f'null::{c.type} as "{c.name}"'
            for c in tables()[table]
        )
        paths = ", ".join(file_literal(root / f.path) for f in files if f.schema == schema)
        selects.append(f"select {columns} from read_parquet([{paths}])")
    return " union all ".join(selects)
