"""Sorted Parquet files, written whole or not at all; the same rows give the same bytes."""

import os
from pathlib import Path

import duckdb

from turnout.content import sha256_of
from turnout.errors import RegistryError
from turnout.files import beside
from turnout.registry.generation import DataFile, schema_hash, sync_folder
from turnout.registry.schema import file_literal, literal, names, sort_order, tables, time_column

# Rows that are read or skipped together. Among a year of unmerged batches one section is found three times faster
# with small groups; large files are larger by a tenth with them, and hardly faster.
SMALL_GROUP, LARGE_GROUP, SMALL_FILE = 16_384, 122_880, 250_000

# Tables of measurements, and the id by which a row of them is taken back.
MEASURED = {"models": "model_id", "modes": "model_id", "passages": "passage_id", "passage_fits": "passage_id"}


def folder_of(table: str, year: int | None) -> str:
    """Where the files of a table lie: by year, small tables and undated rows beside them.

    >>> folder_of("modes", 2026), folder_of("quarantine", 0), folder_of("turnouts", None)
    ('modes/year=2026', 'quarantine/undated', 'turnouts')
    """
    if year is None:
        return table
    return f"{table}/year={year}" if year else f"{table}/undated"


def write_sorted(
    con: duckdb.DuckDBPyConnection,
    registry_dir: Path,
    table: str,
    year: int | None,
    select: str,
    prefix: str,
    always_alike: bool = False,
) -> DataFile | None:
    """Write the rows of ``select`` (all columns of ``table``) as one sorted file; None where there are none.

    The file's name ends with the hash of its content. The rows pass through a table of their own, for the writer's
    bytes depend on what is known of its source, such as that a column has no NULL; ``always_alike`` says that they
    come from the same kind of source every time, and saves that. RegistryError when the disk is full: nothing is
    changed.
    """
    folder = Path(registry_dir) / folder_of(table, year)
    unfinished = beside(folder / prefix)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        rows = _copy(con, table, select, unfinished, prefix.startswith("batch"), always_alike)
        if rows == 0:
            return None
        digest = _sync_and_hash(unfinished)
        final = folder / f"{prefix}-{digest[:12]}.parquet"
        size = unfinished.stat().st_size
        os.replace(unfinished, final)
        sync_folder(folder)
    except (duckdb.IOException, OSError) as error:
        raise RegistryError(
            f"cannot write {folder_of(table, year)}/{prefix}: {str(error).splitlines()[0]}. Nothing was changed: "
            "make room or give write permission, then run again."
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)
        con.execute("drop table if exists to_write")
    path = f"{folder_of(table, year)}/{final.name}"
    return DataFile(path, table, year, rows, size, digest, f"{table}:{schema_hash(table)}", _newest(con, table, final))


def _copy(con, table: str, select: str, path: Path, small: bool, always_alike: bool) -> int:
    """Copy the rows, sorted; how many. ``small`` groups of rows only in a file that is small, too."""
    columns = ", ".join(f'"{n}"' for n in names(table))
    source = f"({select})"
    if not always_alike:
        con.execute(f"create or replace temp table to_write as select {columns} from {source}")
        source = "to_write"
        small = small and con.execute("select count(*) from to_write").fetchall()[0][0] <= SMALL_FILE
    ordered = f"select {columns} from {source} order by {', '.join(sort_order(table))}"
    group = f"row_group_size {SMALL_GROUP if small else LARGE_GROUP}"
    options = f"format parquet, compression zstd, {group}, kv_metadata {{turnout_schema: '{schema_hash(table)}'}}"
    return con.execute(f"copy ({ordered}) to {literal(str(path))} ({options})").fetchall()[0][0]


def write_empty(con: duckdb.DuckDBPyConnection, registry_dir: Path, table: str) -> str:
    """Zero rows with the types of ``columns.csv``: an empty registry still answers. Returns its path."""
    path = Path(registry_dir) / table / f"_schema-{schema_hash(table)}.parquet"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = beside(path)
        typed = ", ".join(f'null::{c.type} as "{c.name}"' for c in tables()[table])
        try:
            con.execute(f"copy (select {typed} limit 0) to {literal(str(unfinished))} (format parquet)")
            os.replace(unfinished, path)
        except (duckdb.IOException, OSError) as error:
            raise RegistryError(f"cannot write {path}: {str(error).splitlines()[0]}") from error
        finally:
            unfinished.unlink(missing_ok=True)
    return f"{table}/{path.name}"


def read_list(registry_dir: Path, table: str, paths: list[str], alike: bool = False) -> str:
    """SQL that reads the files of one table, its columns by name; a column that a file lacks is NULL.

    ``alike`` files all have the present columns: then only the first needs to be opened to know them.
    """
    listed = ", ".join(file_literal(Path(registry_dir) / p) for p in paths)
    columns = ", ".join(f'"{n}"' for n in names(table))
    by_name = "" if alike else ", union_by_name = true"
    return f"select {columns} from read_parquet([{listed}]{by_name}, hive_partitioning = false)"


def read_live(con: duckdb.DuckDBPyConnection, registry_dir: Path, table: str, files: list[DataFile]) -> str:
    """SQL that reads all ``files`` of a table, and works where there are none.

    The empty file that knows the types stands last and only where it is needed: DuckDB estimates the number of rows
    from the first file, and plans joins by it.
    """
    present = f"{table}:{schema_hash(table)}"
    alike = all(f.schema == present for f in files)
    empty = [] if files and alike else [write_empty(con, registry_dir, table)]
    return read_list(registry_dir, table, [f.path for f in files] + empty, alike)


def _sync_and_hash(path: Path) -> str:
    with open(path, "rb") as stream:
        os.fsync(stream.fileno())
    return sha256_of(path)


def _newest(con, table, path) -> str | None:
    """Time of the newest measurement in the file; small tables hold no measurements."""
    time = time_column(table)
    if time is None or table not in MEASURED:
        return None
    found = con.execute(f"select max({time})::varchar from read_parquet({file_literal(path)})").fetchall()
    return found[0][0]
