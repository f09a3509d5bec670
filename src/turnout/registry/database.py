"""Build and open ``registry.duckdb``: views over the live files, macros and comments, but no data.

Its catalogue is a copy of a template, see ``registry.catalogue``; only what depends on the live files is made for each
generation.
"""

from __future__ import annotations

import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import duckdb

from turnout.errors import RegistryError
from turnout.files import publish_file, remove_unfinished, temporary_path
from turnout.registry import view_texts
from turnout.registry.catalogue import create_catalogue, use_generation
from turnout.registry.catalogue_template import catalogue_template
from turnout.registry.connection import OFFLINE_CONFIG, connect
from turnout.registry.generation import GENERATION_FILE, Generation, load
from turnout.registry.generation_history import find_generation
from turnout.registry.schema import literal

if TYPE_CHECKING:
    from os import PathLike

DATABASE = "registry.duckdb"


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
        When there is none, when it cannot be opened, when it was moved or copied and not relocated, or when
        the generation ``as_of`` is not kept.
    """
    path = Path(path)
    file = path / DATABASE if path.is_dir() else path
    if as_of is not None and file.exists():
        return _open_generation(file.parent, as_of)
    if not file.exists():
        raise RegistryError(
            f"{file}: there is no registry here. 'turnout nightly' makes one; or name the folder that holds {DATABASE}."
        )
    try:
        connection = duckdb.connect(str(file), read_only=read_only, config=OFFLINE_CONFIG)
        connection.execute("set enable_progress_bar = false")
        ((folder,),) = connection.execute("select folder from registry_info").fetchall()
    except duckdb.Error as error:
        problem = str(error).splitlines()[0].rstrip(".!")
        remedy = f"Name the folder that holds {DATABASE}. A damaged one is made again by: turnout registry relocate"
        if "lock" in problem:  # DuckDB lets one process write, or any number read
            remedy = "Another program has it open for writing: close it there, or open it there read-only"
        raise RegistryError(f"{file}: cannot be opened: {problem}. {remedy}.") from error
    if not Path(folder).is_dir():
        connection.close()
        remedy = f"Where it was moved, run once: turnout registry relocate --registry '{file.parent}'"
        raise RegistryError(f"{file}: was made in {folder}, which is not there. {remedy}.")
    if (file.parent / GENERATION_FILE).is_file() and not file.parent.samefile(folder):
        connection.close()
        remedy = f"To read the copy, run once: turnout registry relocate --registry '{file.parent}'"
        raise RegistryError(f"{file}: is a copy, and its views read the files of {folder}. {remedy}.")
    return connection


def _open_generation(folder: Path, as_of: int | str | datetime) -> duckdb.DuckDBPyConnection:
    """Views of an earlier generation in a database in memory."""
    generation, time = find_generation(folder, as_of)
    connection = duckdb.connect(":memory:", config=OFFLINE_CONFIG)
    connection.execute("set enable_progress_bar = false")
    published = time or datetime.now(UTC)
    try:
        if _has_copied_template(connection):
            use_generation(connection, folder.resolve(), generation, published)
        else:
            create_catalogue(connection, folder.resolve(), generation, published)
    except duckdb.Error as error:
        connection.close()
        raise RegistryError(f"{folder}, generation {generation.number}: {str(error).splitlines()[0]}") from error
    return connection


def _has_copied_template(connection: duckdb.DuckDBPyConnection) -> bool:
    """Copy the template into the database of the connection; False where no temporary file can be written."""
    try:
        with tempfile.TemporaryDirectory(prefix="turnout-catalogue-") as name:
            file = Path(name) / DATABASE
            file.write_bytes(catalogue_template())
            connection.execute(f"attach {literal(str(file))} as template (read_only)")
            connection.execute("copy from database template to memory (schema)")
            connection.execute("detach template")
    except OSError:
        return False
    return True


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
        unfinished.write_bytes(catalogue_template())
        con.execute(f"attach {literal(str(unfinished))} as registry")
        con.execute("use registry")
        con.execute("begin")
        use_generation(con, root, generation, datetime.now(UTC))
        con.execute("commit")
        con.execute("use memory")
        con.execute("detach registry")
        publish_file(unfinished, root / DATABASE)
    except (duckdb.IOException, duckdb.TransactionException, duckdb.OutOfMemoryException, OSError) as error:
        # DuckDB reports a full disk also as a transaction that cannot be committed
        raise RegistryError(
            f"cannot write {DATABASE}: {str(error).splitlines()[0]}. The new rows are stored; free disk space or give "
            "write permission, then 'turnout registry relocate' makes the file again."
        ) from error
    finally:
        con.close()
        remove_unfinished(unfinished, Path(f"{unfinished}.wal"))


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
    return not has_database(registry_dir, generation) or _registry_info(registry_dir)[2] != view_texts.views_version()


def has_database(registry_dir: Path, generation: Generation) -> bool:
    """Whether readers find a ``registry.duckdb`` of this generation and folder.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    generation : Generation
        List of the live files.

    Returns
    -------
    bool
        False if the file is missing or no database, and after the folder was copied or moved.
    """
    return _registry_info(registry_dir)[:2] == (generation.number, str(Path(registry_dir).resolve()))


def _registry_info(registry_dir: Path) -> tuple:
    """Generation, folder and version of the views in ``registry.duckdb``; empty without such a database."""
    file = Path(registry_dir) / DATABASE
    if not file.exists():
        return ()
    try:
        with duckdb.connect(str(file), read_only=True, config=OFFLINE_CONFIG) as con:
            return con.execute("select generation, folder, views_version from registry_info").fetchall()[0]
    except duckdb.Error:
        return ()


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
