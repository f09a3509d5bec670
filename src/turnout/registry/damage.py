"""Find live files whose bytes have changed on the disk, and take them off the list so that no answer uses them."""

from __future__ import annotations

import logging
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import duckdb

from turnout.content import sha256_of
from turnout.errors import RegistryError
from turnout.registry.database import DATABASE, has_database
from turnout.registry.generation import DataFile, Generation, load

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

GONE = "is gone"
SPILL_FOLDERS = (".spill", f"{DATABASE}.tmp")  # of a registration, and of DuckDB for the database
REMEDY_OF_DAMAGE = "A file of the registry is damaged or absent: 'turnout registry check' names each, with what to do"


def find_damage(root: Path, files: Iterable[DataFile]) -> dict[str, str]:
    """Files that do not have the bytes of the list.

    Parameters
    ----------
    root : Path
        Folder of the registry.
    files : iterable of DataFile
        Live files, each of which is read as a whole.

    Returns
    -------
    dict of str to str
        What is wrong with each damaged file, by its path in the registry.

    Raises
    ------
    RegistryError
        If a file cannot be read, which is a fault of the machine.
    """
    problems = {f.path: problem for f in files if (problem := _problem(root / f.path, f))}
    return dict(sorted(problems.items()))


def damage_message(error: Exception, registry: Path | str) -> str:
    """What to do about an error of DuckDB that names a file of the registry.

    A folder beside the registry whose name begins alike holds none of them, nor do the folders into which DuckDB
    spills.

    Parameters
    ----------
    error : Exception
        Any error.
    registry : path
        Folder of the registry.

    Returns
    -------
    str
        The error and its remedy; "" for any other error.
    """
    spilled = "|".join(re.escape(name) for name in SPILL_FOLDERS)
    file = rf"{re.escape(f'{Path(registry).resolve()}{os.sep}')}(?!{spilled})"
    if not isinstance(error, duckdb.Error) or not re.search(file, str(error)):
        return ""
    return f"{error}\n{REMEDY_OF_DAMAGE}"


def without_damage(generation: Generation, damage: Collection[str]) -> Generation:
    """The generation without its damaged files, whose tables are noted as incomplete.

    All work batches count as new, so that the next registration restores the rows that they hold.

    Parameters
    ----------
    generation : Generation
        List of the live files.
    damage : collection of str
        Paths of damaged files.

    Returns
    -------
    Generation
        The same generation if no file is damaged.

    Raises
    ------
    RegistryError
        If most files are gone: then a disk is probably not mounted.
    """
    if not damage:
        return generation
    files = [f for f in generation.files if f.path not in damage]
    incomplete = {f.table for f in generation.files if f.path in damage} | set(generation.incomplete)
    return replace(generation, files=files, incomplete=sorted(incomplete), consumed=[])


def take_off_damage(root: Path, generation: Generation) -> Generation:
    """Check all live files; damaged ones are logged and taken off the list.

    Parameters
    ----------
    root : Path
        Folder of the registry.
    generation : Generation
        List of the live files.

    Returns
    -------
    Generation
        The generation without damaged files, not yet published.

    Raises
    ------
    RegistryError
        If a file cannot be read, or most files are gone.
    """
    damage = find_damage(root, generation.files)
    n_gone = sum(problem == GONE for problem in damage.values())
    if 2 * n_gone > len(generation.files) and n_gone > 1:
        raise RegistryError(
            f"{root}: {n_gone} of {len(generation.files)} files are gone, first {next(iter(damage))}. Nothing was "
            "changed: mount the disk again, or put them back from a backup."
        )
    rows = {f.path: f.rows for f in generation.files}
    for path, problem in damage.items():
        logging.getLogger("turnout.registry").warning(
            "%s %s. It counts no longer; the next registration computes its %d rows again as far as the work batches "
            "hold them",
            root / path,
            problem,
            rows[path],
        )
    return without_damage(generation, damage)


def damage_stamp(registry_dir: str | os.PathLike) -> str:
    """Text that changes when files are damaged or the database is lost: with it the job runs that restores them.

    Parameters
    ----------
    registry_dir : path-like
        Folder of the registry.

    Returns
    -------
    str
        "" without damage, also where the registry cannot be read: its job tells why.
    """
    root = Path(registry_dir)
    try:
        generation = load(root)
        damage = find_damage(root, generation.files)
    except (RegistryError, OSError):
        return ""
    lost = [DATABASE] if generation.files and not has_database(root, generation) else []
    return " ".join([*damage, *generation.incomplete, *lost])


def _problem(path: Path, file: DataFile) -> str:
    """What differs from the list; "" for an intact file."""
    try:
        size = path.stat().st_size
        if size != file.bytes:
            return f"has {size} bytes, the list says {file.bytes}"
        return "" if sha256_of(path) == file.sha256 else "has another hash than the list"
    except FileNotFoundError:
        return GONE
    except OSError as error:
        raise RegistryError(f"{path}: cannot be read: {error.strerror}. Nothing was changed.") from error
