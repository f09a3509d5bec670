"""Check that the registry holds the files of its list, and find files that are not on it."""

import re
from os import PathLike
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from turnout.content import sha256_of
from turnout.registry.arrow_types import arrow_type
from turnout.registry.database import DATABASE, is_behind
from turnout.registry.generation import DataFile, Generation, load
from turnout.registry.lock import registry_lock
from turnout.registry.parquet import has_present_columns, schema_file
from turnout.registry.schema import tables

REMEDY = "Put it back from a backup, or run the workflow, which computes its rows again."
_SCHEMA = re.compile(r"_schema-[0-9a-f]{12}\.parquet")


def check(registry_dir: PathLike, hashes: bool = True) -> list[str]:
    """Problems of a registry, one sentence each.

    Compares every live file with the list: size, hash, row count, types.

    Parameters
    ----------
    registry_dir : PathLike
        Folder of the registry.
    hashes : bool
        Whether hashes are compared, for which every file must be read as a whole.

    Returns
    -------
    list of str
        Sentences, empty without a problem.
    """
    root = Path(registry_dir)
    generation = load(root)
    problems = [p for file in generation.files for p in _check_file(root, file, hashes)]
    if is_behind(root, generation):
        wanted = f"generation {generation.number} with this program's views"
        problems.append(f"{DATABASE} is not of {wanted}: run 'turnout registry relocate'.")
    for table in tables():
        path = root / table / schema_file(table)
        if not generation.of(table) and path.exists() and not has_present_columns(path, table):
            name = path.relative_to(root).as_posix()
            problems.append(f"{name}: not the file of an empty table. 'turnout registry relocate' writes it again.")
    if generation.incomplete:
        names = ", ".join(generation.incomplete)
        problems.append(f"Damaged files of {names} were taken off the list: the next run restores their rows.")
    lost = unlisted_files(root, generation)
    if lost:
        number = "1 file is" if len(lost) == 1 else f"{len(lost)} files are"
        problems.append(f"{number} on no list, the first {lost[0]}: run 'turnout registry vacuum'.")
    return problems


def vacuum(registry_dir: PathLike) -> list[str]:
    """Delete files on no list, which killed runs leave.

    Parameters
    ----------
    registry_dir : PathLike
        Folder of the registry.

    Returns
    -------
    list of str
        Paths of the deleted files.

    Raises
    ------
    RegistryError
        When the registry is locked.
    """
    root = Path(registry_dir)
    with registry_lock(root):
        lost = unlisted_files(root, load(root))
        for path in lost:
            (root / path).unlink(missing_ok=True)
    return lost


def unlisted_files(root: Path, generation: Generation) -> list[str]:
    """Files below the tables' folders, and temporary ones, that are neither live nor retired.

    Parameters
    ----------
    root : Path
        Folder of the registry.
    generation : Generation
        List of the live files.

    Returns
    -------
    list of str
        Paths in the registry, sorted.
    """
    listed = {f.path for f in generation.files} | {path for path, _ in generation.retired}
    candidates = [p for table in tables() for p in (root / table).rglob("*") if p.is_file()]
    candidates += list(root.glob(".*.tmp"))
    paths = (p.relative_to(root).as_posix() for p in candidates if not _SCHEMA.fullmatch(p.name))
    return sorted(set(paths) - listed)


def _check_file(root: Path, file: DataFile, hashes: bool) -> list[str]:
    path = root / file.path
    if not path.exists():
        return [f"{file.path}: is gone. {REMEDY}"]
    if path.stat().st_size != file.bytes:
        return [f"{file.path}: {path.stat().st_size} bytes, the list says {file.bytes}. {REMEDY}"]
    try:
        parquet = pq.ParquetFile(path)
    except (pa.ArrowException, OSError) as error:
        return [f"{file.path}: not a Parquet file ({str(error).splitlines()[0]}). {REMEDY}"]
    problems = []
    if parquet.metadata.num_rows != file.rows:
        problems.append(f"{file.path}: {parquet.metadata.num_rows} rows, the list says {file.rows}.")
    file_types = {f.name: f.type for f in parquet.schema_arrow}
    for column in tables().get(file.table, ()):
        if column.name in file_types and not _is_same_type(file_types[column.name], arrow_type(column)):
            problems.append(
                f"{file.path}, column {column.name}: {file_types[column.name]}, columns.csv says {column.type}."
            )
    if hashes and sha256_of(path) != file.sha256:
        problems.append(f"{file.path}: its hash differs from the list. {REMEDY}")
    return problems


def _is_same_type(actual: pa.DataType, wanted: pa.DataType) -> bool:
    if pa.types.is_list(actual) and pa.types.is_list(wanted):
        return actual.value_type == wanted.value_type
    return actual == wanted
