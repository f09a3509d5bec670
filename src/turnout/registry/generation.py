"""Read, check and commit the generation file, the list of live files; files that it does not name do not count."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from turnout.errors import RegistryError
from turnout.files import sync_folder, write_atomic
from turnout.registry.schema import tables

if TYPE_CHECKING:
    from collections.abc import Collection

GENERATION_FILE = "_generation.json"
FORMAT_VERSION = 1
N_KEPT_GENERATIONS = 2  # for which retired files stay at least, whatever the clock says
FORBIDDEN_CHARACTERS = {"?", "\\"}  # in a path: DuckDB reads options after the first and takes the second for a slash


@dataclass(frozen=True)
class DataFile:
    """One live Parquet file: its path in the registry, its table, year, row count, size, hash and schema.

    ``newest`` is the time of its newest measurement, ``dead`` the number of superseded rows (large tables only).
    """

    path: str
    table: str
    year: int | None
    rows: int
    bytes: int
    sha256: str
    schema: str
    newest: str | None = None
    dead: int = 0


@dataclass
class Generation:
    """State of the registry after one commit.

    ``files`` are live. ``retired`` are (path, generation that removed it); they stay for another day, so that readers
    of an older state still find them. ``schemas`` maps a schema hash to its columns. ``consumed`` are the work batches
    that are already registered and may be offered again. ``incomplete`` are tables of which damaged files
    were taken off the list; the next registration restores their rows.
    """

    number: int = 0
    files: list[DataFile] = field(default_factory=list)
    retired: list[tuple[str, int]] = field(default_factory=list)
    schemas: dict[str, dict[str, str]] = field(default_factory=dict)
    consumed: list[str] = field(default_factory=list)
    incomplete: list[str] = field(default_factory=list)

    def of(self, table: str, years: Collection[int | None] | None = None) -> list[DataFile]:
        """Live files of one table.

        Parameters
        ----------
        table : str
            Name of the table.
        years : collection of int or None or None
            Years; None: all.

        Returns
        -------
        list of DataFile
            Files, sorted like ``files``.
        """
        return [f for f in self.files if f.table == table and (years is None or f.year in years)]

    def to_json(self) -> str:
        """Text of the generation file; equal generations give equal bytes."""
        content = {"format": FORMAT_VERSION} | vars(self) | {"files": [vars(file) for file in self.files]}
        if not self.incomplete:  # an earlier version of the program does not know it
            del content["incomplete"]
        return json.dumps(content, indent=1, sort_keys=True) + "\n"


def load(registry_dir: Path) -> Generation:
    """The generation file, or generation 0 where there is none yet.

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
        When the file is not readable, which means that something else changed it, for it is written in one step. Also
        for a folder in which DuckDB can make no database.
    """
    require_usable_folder(registry_dir)
    try:
        return read_generation(Path(registry_dir) / GENERATION_FILE)
    except FileNotFoundError:
        return Generation()


REMEDY = "Put it back from a backup. Without one delete its folder: the next run makes the registry again from work/."


def read_generation(path: Path) -> Generation:
    """A generation from its file.

    Parameters
    ----------
    path : Path
        ``_generation.json``, or that of an earlier generation.

    Returns
    -------
    Generation
        The list of files.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    RegistryError
        When the file is not readable.
    """
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise RegistryError(f"{path}: not a generation file ({error}). {REMEDY}") from None
    try:
        if raw.pop("format", None) != FORMAT_VERSION:
            raise RegistryError(f"{path}: written by another version of the program. Install that version.")
        files = [DataFile(**f) for f in raw.pop("files")]
        retired = [(p, n) for p, n in raw.pop("retired")]
        for listed in (*(f.path for f in files), *(p for p, _ in retired)):
            _require_inside(listed)
        return Generation(files=files, retired=retired, **raw)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        message = f"{type(error).__name__}: {error}"
        raise RegistryError(f"{path}: not a generation file ({message}). {REMEDY}") from None


def require_usable_folder(registry_dir: Path) -> None:
    """Accept a folder in which DuckDB can make a database.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry, which need not exist.

    Raises
    ------
    RegistryError
        If its path has a character that DuckDB does not take as such.
    """
    if forbidden := FORBIDDEN_CHARACTERS.intersection(Path(registry_dir).resolve().as_posix()):
        raise RegistryError(
            f"{registry_dir}: DuckDB can make no database where a folder has {min(forbidden)} in its name. "
            "Nothing was changed. Rename that folder, or put the registry elsewhere."
        )


def _require_inside(path: str) -> None:
    """ValueError for a listed path that leads out of the registry, where it would be read or deleted."""
    parts = PurePosixPath(path)
    if parts.is_absolute() or ".." in parts.parts or parts.parts[:1] == ():
        raise ValueError(f"the path {path!r} leads out of the registry")


def schema_hash(table: str) -> str:
    """Hash of the columns and types of a table, the name of its present schema.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    str
        12 hexadecimal digits.
    """
    text = json.dumps([[c.name, c.type] for c in tables()[table]])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def schema_of(table: str) -> dict[str, str]:
    """Types of the present columns of a table by their names, in order.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    dict
        SQL type by name.
    """
    return {c.name: c.type for c in tables()[table]}


def check_schemas(generation: Generation) -> None:
    """Check that all files hold the types of ``columns.csv``.

    DuckDB would silently convert both to text. A new column is allowed: it is NULL in old rows.

    Parameters
    ----------
    generation : Generation
        List of the live files.

    Raises
    ------
    RegistryError
        If files hold another type of a column.
    """
    for name, column_types in sorted(generation.schemas.items()):
        table, _, _ = name.partition(":")
        now = schema_of(table) if table in tables() else {}
        for column, old_type in column_types.items():
            if column in now and now[column] != old_type:
                raise RegistryError(
                    f"{table}, column {column}: files hold {old_type}, columns.csv says {now[column]}. "
                    "Rename the new column, or rebuild the registry from the work batches."
                )


def commit(registry_dir: Path, generation: Generation) -> None:
    """Publish the generation by replacing one file; from then on the new files count and the retired ones do not.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    generation : Generation
        List of the live files.
    """
    write_durably(Path(registry_dir) / GENERATION_FILE, generation.to_json().encode())


def write_durably(path: Path, content: bytes) -> None:
    """Write a temporary file, fsync, replace, fsync the folder: complete or not at all, also after a power cut.

    Parameters
    ----------
    path : Path
        File to write.
    content : bytes
        Its whole content.
    """
    write_atomic(path, lambda stream: stream.write(content))
    sync_folder(path.parent)


def delete_files(registry_dir: Path, paths: list[str]) -> None:
    """Delete files of the registry; one that is gone already is no error.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    paths : list of str
        Paths in the registry.
    """
    for path in paths:
        (Path(registry_dir) / path).unlink(missing_ok=True)
