"""Check before a run that everything it stores can be written: nobody computes a night that is lost."""

import errno
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from turnout.errors import TurnoutError, remedy_of_access
from turnout.files import remove_unfinished, temporary_path

FOLDERS = ("work", "work/plan", "results", "results/registry", "results/pages", "logs", ".snakemake", ".")
# Files that a run opens or replaces; a lock is opened for writing, the others are replaced by new files.
LOCKS = ("work/.nightly.lock", "work/.run.lock", "results/registry/.lock")
FILES = (
    "work/launched",
    "results/registry/_generation.json",
    "results/registry/registry.duckdb",
    "results/worklist.csv",
)
PROBE = bytes(4096)  # one block: a full disk has none left
LITTLE_SPACE = 100e6  # bytes: the temporary files of a registry of some turnouts already need a part of it
FEW_FILES = 1000  # of a disk that can have no more: each unit and each batch of a run is a file


def require_writable_places(project: Path = Path()) -> None:
    """Check that a run can store its results: no permission, no space or a wrong kind of entry ends it at once.

    Parameters
    ----------
    project : Path
        Folder of the project.

    Raises
    ------
    TurnoutError
        If a folder cannot be written or is a file, its disk is full, or a file is a folder or a lock that cannot be
        opened for writing. The message says what to do.
    """
    for name in FOLDERS:
        _require(project / name, "folder", "Rename or remove it: the run makes a folder there", _write_probe)
    for name in (*LOCKS, *FILES):
        _require(project / name, "file", "Rename or remove it: the run makes a file there", _check_file)


def nearly_full_disks(project: Path = Path()) -> list[str]:
    """Disks of the results, and of temporary files, that have little room left, in words.

    Parameters
    ----------
    project : Path
        Folder of the project.

    Returns
    -------
    list of str
        For each disk one of its folders, and how many bytes or files it can still store.
    """
    disks: dict[int, str] = {}
    for folder in (*(project / name for name in FOLDERS), Path(tempfile.gettempdir())):
        with suppress(OSError):
            device, disk = folder.stat().st_dev, os.statvfs(folder)
            room, sentence = disk.f_bavail * disk.f_frsize, f"the disk of {folder.absolute()} has room for only"
            if room < LITTLE_SPACE:
                disks.setdefault(device, f"{sentence} {room / 1e6:.1f} MB")
            elif disk.f_files and disk.f_favail < FEW_FILES:  # some file systems do not count files
                disks.setdefault(device, f"{sentence} {disk.f_favail} files")
    return list(disks.values())


def _require(path: Path, entry_type: str, otherwise: str, check: Callable[[Path], None]) -> None:
    if not os.path.lexists(path):
        return
    if not path.exists():
        problem = f"{path.absolute()}, the {entry_type}: its link leads to nothing, and nothing was computed"
        raise TurnoutError(f"{problem}. Mount the disk that it leads to, or remove the link.")
    try:
        check(path)
    except OSError as error:
        problem = (
            f"{path.absolute()}, the {entry_type}: it cannot be written ({error.strerror}), and nothing was computed"
        )
        raise TurnoutError(f"{problem}. {remedy_of_access(error, otherwise)}.") from None


def _write_probe(folder: Path) -> None:
    """Write and remove a file: permissions alone show neither a full disk nor one that is mounted for reading."""
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file, not a folder")
    probe = temporary_path(folder / "probe")
    try:
        with open(probe, "wb") as stream:
            stream.write(PROBE)
            stream.flush()
            os.fsync(stream.fileno())
    finally:
        remove_unfinished(probe)


def _check_file(path: Path) -> None:
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "it is a folder, not a file")
    if path.name.endswith(".lock"):
        with open(path, "ab"):
            pass
