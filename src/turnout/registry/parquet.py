"""Write and read sorted Parquet files, complete or not at all; the same rows give the same bytes."""

from pathlib import Path

import duckdb

from turnout.content import sha256_of
from turnout.errors import RegistryError
from turnout.files import publish_file, remove_unfinished, temporary_path
from turnout.registry.generation import DataFile, schema_hash
from turnout.registry.schema import file_literal, literal, names, sort_order, tables, time_column

# Rows per row group, which is read or skipped as a whole. In a year of unmerged batches one section is read three times
# faster with small groups. In files above SMALL_FILE rows they add a tenth of size and hardly any speed.
SMALL_GROUP, LARGE_GROUP, SMALL_FILE = 16_384, 122_880, 250_000

# Tables of measurements, and the id by which their rows are superseded.
MEASUREMENT_IDS = {"models": "model_id", "modes": "model_id", "passages": "passage_id", "passage_fits": "passage_id"}


def folder_of(table: str, year: int | None) -> str:
    """Folder of the files of a table: by year, ``undated`` without one; small tables are not divided.

    Parameters
    ----------
    table : str
        Name of the table.
    year : int or None
        Year; 0: rows without a time; None: the table is not divided.

    Returns
    -------
    str
        Path in the registry.

    Examples
    --------
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
    same_source: bool = False,
) -> DataFile | None:
    """Write rows as one sorted file.

    The file's name ends with the hash of its content. The rows are first copied into a temporary table, because the
    bytes depend on properties of the source, such as a column without NULL.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the views of the registry.
    registry_dir : Path
        Folder of the registry.
    table : str
        Name of the table.
    year : int or None
        Year of the rows; None: the table is not divided.
    select : str
        SQL of the rows with all columns of the table.
    prefix : str
        First part of the file's name.
    same_source : bool
        Skip that copy; only if the rows always come from the same type of source.

    Returns
    -------
    DataFile or None
        The file, None where there are no rows.

    Raises
    ------
    RegistryError
        When the disk is full; then nothing is changed.
    """
    folder = Path(registry_dir) / folder_of(table, year)
    unfinished = temporary_path(folder / prefix)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        rows = _copy(con, table, select, unfinished, prefix.startswith("batch"), same_source)
        if rows == 0:
            return None
        digest = sha256_of(unfinished)
        final = folder / f"{prefix}-{digest[:12]}.parquet"
        size = unfinished.stat().st_size
        publish_file(unfinished, final)
    except (duckdb.IOException, OSError) as error:
        raise RegistryError(
            f"cannot write {folder_of(table, year)}/{prefix}: {str(error).splitlines()[0]}. Nothing was changed: "
            "free disk space or give write permission, then run again."
        ) from error
    finally:
        remove_unfinished(unfinished)
        con.execute("drop table if exists to_write")
    path = f"{folder_of(table, year)}/{final.name}"
    return DataFile(path, table, year, rows, size, digest, f"{table}:{schema_hash(table)}", _newest(con, table, final))


def _copy(con: duckdb.DuckDBPyConnection, table: str, select: str, path: Path, small: bool, same_source: bool) -> int:
    """Copy the rows, sorted, and return their number. ``small`` row groups are used in small files only."""
    columns = ", ".join(f'"{n}"' for n in names(table))
    source = f"({select})"
    if not same_source:
        con.execute(f"create or replace temp table to_write as select {columns} from {source}")
        source = "to_write"
        small = small and con.execute("select count(*) from to_write").fetchall()[0][0] <= SMALL_FILE
    ordered = f"select {columns} from {source} order by {', '.join(sort_order(table))}"
    group = f"row_group_size {SMALL_GROUP if small else LARGE_GROUP}"
    options = f"format parquet, compression zstd, {group}, kv_metadata {{turnout_schema: '{schema_hash(table)}'}}"
    return con.execute(f"copy ({ordered}) to {literal(str(path))} ({options})").fetchall()[0][0]


_EMPTY_FILES: dict[str, bytes] = {}  # of this process, by what is selected


def select_nothing(table: str) -> str:
    """SQL of no rows with the types of ``columns.csv``.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    str
        A SELECT statement.
    """
    typed = ", ".join(f'null::{c.type} as "{c.name}"' for c in tables()[table])
    return f"select {typed} limit 0"


def write_empty(con: duckdb.DuckDBPyConnection, registry_dir: Path, table: str) -> str:
    """Write a file of zero rows with the types of ``columns.csv``, for an empty table.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the views of the registry.
    registry_dir : Path
        Folder of the registry.
    table : str
        Name of the table.

    Returns
    -------
    str
        Path in the registry.

    Raises
    ------
    RegistryError
        When the file cannot be written.
    """
    path = Path(registry_dir) / table / schema_file(table)
    if not has_present_columns(path, table):
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = temporary_path(path)
        select = select_nothing(table)
        try:
            if select in _EMPTY_FILES:
                unfinished.write_bytes(_EMPTY_FILES[select])
            else:
                con.execute(f"copy ({select}) to {literal(str(unfinished))} (format parquet)")
                _EMPTY_FILES[select] = unfinished.read_bytes()
            publish_file(unfinished, path)
        except (duckdb.IOException, OSError) as error:
            raise RegistryError(f"cannot write {path}: {str(error).splitlines()[0]}") from error
        finally:
            remove_unfinished(unfinished)
    return f"{table}/{path.name}"


def schema_file(table: str) -> str:
    """Name of the file of zero rows that defines the columns of an empty table.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    str
        Name in the folder of the table.
    """
    return f"_schema-{schema_hash(table)}.parquet"


def has_present_columns(path: Path, table: str) -> bool:
    """Whether the file of zero rows is whole; one that a power cut has emptied is written again.

    Parameters
    ----------
    path : Path
        The file.
    table : str
        Name of the table.

    Returns
    -------
    bool
        True if it has the present columns and no rows.
    """
    import pyarrow as pa  # readers of the registry do without it
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as parquet:
            return tuple(parquet.schema_arrow.names) == names(table) and parquet.metadata.num_rows == 0
    except (pa.ArrowException, OSError):
        return False


def read_list(registry_dir: Path, table: str, paths: list[str], same_schema: bool = False) -> str:
    """SQL that reads the files of one table, its columns by name; a column that a file lacks is NULL.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    table : str
        Name of the table.
    paths : list of str
        Paths in the registry.
    same_schema : bool
        Whether all files have the present columns; then DuckDB opens only the first to get them.

    Returns
    -------
    str
        A SELECT statement.
    """
    listed = ", ".join(file_literal(Path(registry_dir) / p) for p in paths)
    columns = ", ".join(f'"{n}"' for n in names(table))
    by_name = "" if same_schema else ", union_by_name = true"
    return f"select {columns} from read_parquet([{listed}]{by_name}, hive_partitioning = false)"


def read_live(con: duckdb.DuckDBPyConnection, registry_dir: Path, table: str, files: list[DataFile]) -> str:
    """SQL that reads all ``files`` of a table, also if there are none; the file that defines the types is there then.

    Beside others that file comes last, and only if needed: DuckDB plans joins by the number of rows that it estimates
    from the first file.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the views of the registry.
    registry_dir : Path
        Folder of the registry.
    table : str
        Name of the table.
    files : list of DataFile
        Live files of the table.

    Returns
    -------
    str
        A SELECT statement.
    """
    paths, same_schema = live_paths(con, registry_dir, table, files)
    return read_list(registry_dir, table, paths, same_schema) if files else select_nothing(table)


def live_paths(
    con: duckdb.DuckDBPyConnection, registry_dir: Path, table: str, files: list[DataFile]
) -> tuple[list[str], bool]:
    """Paths of the files to read for a table, and whether their columns are the same; an empty file only if needed.

    Parameters
    ----------
    con : DuckDB connection
        Any connection; it writes the empty file.
    registry_dir : Path
        Folder of the registry.
    table : str
        Name of the table.
    files : list of DataFile
        Live files of the table.

    Returns
    -------
    (list of str, bool)
        Paths in the registry, and whether all files have the present columns.
    """
    present = f"{table}:{schema_hash(table)}"
    same_schema = all(f.schema == present for f in files)
    empty = [] if files and same_schema else [write_empty(con, registry_dir, table)]
    return [f.path for f in files] + empty, same_schema


def _newest(con: duckdb.DuckDBPyConnection, table: str, path: Path) -> str | None:
    """Time of the newest measurement in the file; None for tables without measurements."""
    time = time_column(table)
    if time is None or table not in MEASUREMENT_IDS:
        return None
    rows = con.execute(f"select max({time})::varchar from read_parquet({file_literal(path)})").fetchall()
    return rows[0][0]
