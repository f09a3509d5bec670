"""Merge many small files into one sorted file per table and year; the rows stay the same."""

from dataclasses import replace
from os import PathLike
from pathlib import Path

from turnout.errors import RegistryError
from turnout.registry.database import build_database
from turnout.registry.generation import (
    DataFile,
    Generation,
    commit,
    delete_files,
    due_for_deletion,
    load,
    schema_of,
)
from turnout.registry.lock import locked
from turnout.registry.parquet import folder_of, read_list, read_live, write_sorted
from turnout.registry.schema import WHOLE_TABLES, file_literal, tables
from turnout.registry.staging import connect
from turnout.registry.supersede import LARGE, halves, last_word, with_dead


def compact(registry_dir: PathLike, at_least: int = 2, patience: float = 600.0) -> dict[str, tuple[int, int]]:
    """Merge the files of every table and year that has ``at_least`` files; (files, rows) merged by folder.

    Readers may continue meanwhile: the old files stay for two more generations. RegistryError when the disk is full;
    then nothing is changed.
    """
    root = Path(registry_dir)
    with locked(root, patience):
        before = load(root)
        groups = {g: files for g, files in _groups(before).items() if _pays(files, max(2, at_least))}
        return _rewrite(root, before, groups, lambda table, files: read_list(root, table, [f.path for f in files]))


def rebuild(registry_dir: PathLike, patience: float = 600.0) -> dict[str, tuple[int, int]]:
    """Rewrite all files with the present ``columns.csv``: values are cast, new columns NULL, old columns removed.

    RegistryError when a value cannot be cast; then nothing is changed.
    """
    root = Path(registry_dir)
    with locked(root, patience):
        before = load(root)
        groups = {g: files for g, files in _groups(before).items() if g[0] in tables()}
        done = _rewrite(root, before, groups, lambda table, files: _cast(root, before, table, files))
        return done


def _groups(generation: Generation) -> dict[tuple[str, int | None], list[DataFile]]:
    groups: dict[tuple[str, int | None], list[DataFile]] = {}
    for file in generation.files:
        groups.setdefault((file.table, file.year), []).append(file)
    return groups


def _pays(files: list[DataFile], at_least: int) -> bool:
    """Whether merging is useful: enough files with valid rows, or one with valid and superseded rows."""
    return sum(f.dead < f.rows for f in files) >= at_least or any(0 < f.dead < f.rows for f in files)


def _rewrite(root, before, groups, select) -> dict[str, tuple[int, int]]:
    """Write each group as one file, check that no row was lost, and publish."""
    if not groups:
        build_database(root, before)
        return {}
    number, con = before.number + 1, connect(temp_directory=str(root / ".spill"))
    con.execute(f"create view said as {read_live(con, root, 'supersedes', before.of('supersedes'))}")
    con.execute(f"create table superseded as {last_word('said')}")
    files, retired, done = list(before.files), list(before.retired), {}
    for (table, year), merged in groups.items():
        written = _write(con, root, table, year, merged, select(table, merged))
        kept = {w.path for w in written}
        gone = {f.path for f in merged} - kept
        retired += [(path, number) for path in sorted(gone)]
        files = [f for f in files if f.path not in gone | kept] + written
        done[folder_of(table, year)] = (len(merged), sum(w.rows for w in written))
    files = sorted(with_dead(con, root, files), key=lambda f: f.path)
    schemas = {f.schema: before.schemas.get(f.schema) or schema_of(f.table) for f in files}
    now = replace(before, number=number, files=files, retired=retired, schemas=schemas)
    due = due_for_deletion(now)
    commit(root, now)
    build_database(root, now)
    delete_files(root, due)
    return done


def _write(con, root, table, year, merged: list[DataFile], sql: str) -> list[DataFile]:
    """Write the rows of ``sql`` as one file, or as two if some are superseded; RegistryError if a row was lost."""
    prefix = "all" if table in WHOLE_TABLES else "compact"
    parts = [(prefix, sql)]
    if table in LARGE and any(f.dead for f in merged):
        parts = list(zip((prefix, "superseded"), halves(table, sql)))
    written = [w for name, part in parts if (w := write_sorted(con, root, table, year, part, name))]
    expected, got = sum(f.rows for f in merged), sum(w.rows for w in written)
    if got != expected:
        raise RegistryError(f"{table} {year}: {expected} rows expected, {got} written. Nothing was changed.")
    return written


def _cast(root: Path, before: Generation, table: str, files: list[DataFile]) -> str:
    """SQL over files of several schemas, every value cast to the present type of its column."""
    parts = []
    for schema in sorted({f.schema for f in files}):
        held = before.schemas[schema]
        columns = ", ".join(
            f'"{c.name}"::{c.type} as "{c.name}"' if c.name in held else f'null::{c.type} as "{c.name}"'
            for c in tables()[table]
        )
        paths = ", ".join(file_literal(root / f.path) for f in files if f.schema == schema)
        parts.append(f"select {columns} from read_parquet([{paths}])")
    return " union all ".join(parts)
