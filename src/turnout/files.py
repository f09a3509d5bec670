"""Atomic writing of files: a reader sees the old file or the new one, never an incomplete one.

A full disk, a power failure or an interrupted copy may still truncate a file. ``is_truncated`` and ``read_json``
detect that.
"""

import errno
import glob
import json
import logging
import os
import secrets
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

MIN_LEFTOVER_AGE = 3600.0  # s since the last write: an unfinished file is then that of a command that was killed


def temporary_path(path: Path) -> Path:
    """Hidden name in the folder of ``path`` for an unfinished file; no other process or machine uses it.

    Parameters
    ----------
    path : Path
        File that is going to be written.

    Returns
    -------
    Path
        A new path at each call.

    Examples
    --------
    >>> name = temporary_path(Path("pages/a.html"))
    >>> name.parent.name, name.name.startswith(".a.html."), name.suffix, name == temporary_path(Path("pages/a.html"))
    ('pages', True, '.tmp', False)
    """
    return path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")


def write_atomic(path: os.PathLike | str, write: Callable) -> None:
    """Write a file in one step.

    The content is written to a temporary file in the same folder, flushed to the disk, then renamed. An existing file
    keeps its permissions. If ``write`` or the disk fails, it keeps its content as well.

    Parameters
    ----------
    path : path-like
        File to write; its folder is created.
    write : callable
        Called with the binary stream of the temporary file.

    Raises
    ------
    OSError
        If the disk fails or is full, or the file may not be written; ``filename`` is ``path``.
    """
    path = Path(path)
    make_folder(path.parent)
    with _unfinished_file(path, temporary_path(path)) as temporary, open(temporary, "wb") as stream:
        if path.exists():
            os.chmod(temporary, stat.S_IMODE(path.stat().st_mode))
        write(stream)
        stream.flush()
        os.fsync(stream.fileno())


@contextmanager
def whole_file(path: os.PathLike | str) -> Iterator[Path]:
    """Context in which a library writes a file that appears under its name when it is complete, or not at all.

    Unfinished files of the same name that a killed command left are deleted.

    Parameters
    ----------
    path : path-like
        File to write; its folder is created. A device or a pipe, such as /dev/stdout, is written directly.

    Yields
    ------
    Path
        File to write in its place: in the same folder, hidden, with the same ending.

    Raises
    ------
    OSError
        If the disk fails or is full, or the file may not be written; ``filename`` is ``path``. An existing file then
        keeps its content.
    """
    path = Path(path)
    if (
        path.is_relative_to("/dev")
        or path.is_relative_to("/proc")
        or (path.exists() and special_kind(path.stat().st_mode))
    ):
        yield path  # a new file would not be that which other programs have open
        return
    path = path.resolve() if path.is_symlink() else path
    make_folder(path.parent)
    for leftover in path.parent.glob(f".{glob.escape(path.stem)}.{'[0-9a-f]' * 12}{glob.escape(path.suffix)}"):
        with suppress(OSError):  # another command may delete it, too
            if time.time() - leftover.stat().st_mtime > MIN_LEFTOVER_AGE:
                leftover.unlink()
    with _unfinished_file(path, path.with_name(f".{path.stem}.{secrets.token_hex(6)}{path.suffix}")) as temporary:
        yield temporary
        if path.exists():
            os.chmod(temporary, stat.S_IMODE(path.stat().st_mode))


def make_folder(folder: os.PathLike | str) -> None:
    """Make a folder for output, and the folders above it, where they do not exist.

    Parameters
    ----------
    folder : path-like
        The folder.

    Raises
    ------
    OSError
        If it cannot be made; NotADirectoryError if it, or a folder above it, is a file. ``filename`` names that file.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        file = next((p for p in (folder, *folder.parents) if p.exists() and not p.is_dir()), folder)
        raise NotADirectoryError(errno.ENOTDIR, "it is a file, not a folder", str(file)) from None


def output_problem(path: os.PathLike | str) -> tuple[str, str] | None:
    """Why a file cannot be written, as far as that can be said before its content is computed.

    Parameters
    ----------
    path : path-like
        File to write. Missing folders are no problem, because they are made.

    Returns
    -------
    tuple of (str, str) or None
        The problem and what to do; None without one.

    Examples
    --------
    >>> output_problem("/")
    ('it is a folder', 'Write the name of a file')
    """
    path = Path(path)
    if path.is_dir():
        return "it is a folder", "Write the name of a file"
    if path.exists() and special_kind(path.stat().st_mode):  # such as /dev/stdout
        return None
    above = next(p for p in path.absolute().parents if os.path.lexists(p))
    if not above.is_dir():
        return f"{above} is a file, not a folder", "Write the name of a file in a folder"
    if os.statvfs(above).f_flag & os.ST_RDONLY:
        return f"the disk of {above} is mounted for reading", "Mount it for writing, or write a file in another folder"
    if not os.access(above, os.W_OK | os.X_OK):
        return f"no permission to write in {above}", "Correct its permissions, or write a file in another folder"
    return None


@contextmanager
def _unfinished_file(path: Path, temporary: Path) -> Iterator[Path]:
    """Context of a temporary file that becomes ``path``, or is deleted if an exception is raised."""
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        if error.filename is None and error.errno:  # of a write; libraries add texts of their own
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        if error.filename == str(temporary):
            error.filename = str(path)  # nobody knows the temporary name
        raise
    finally:
        remove_unfinished(temporary)


def remove_unfinished(*paths: Path) -> None:
    """Delete temporary files, where they are and can be: on a read-only disk this fails even without such a file.

    An error of it would take the place of that which ended the writing.

    Parameters
    ----------
    *paths : Path
        Temporary files.
    """
    for path in paths:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def publish_file(unfinished: Path, final: Path) -> None:
    """Give a finished temporary file its name; its content and the name survive a power cut.

    Parameters
    ----------
    unfinished : Path
        Temporary file in the folder of ``final``, written by this program or a library.
    final : Path
        Its name from now on; an existing file is replaced.

    Raises
    ------
    OSError
        If the disk fails.
    """
    with open(unfinished, "rb") as stream:
        os.fsync(stream.fileno())
    os.replace(unfinished, final)
    sync_folder(final.parent)


def sync_folder(folder: Path) -> None:
    """Wait until the names in ``folder`` are on the disk, so that they survive a power cut.

    Parameters
    ----------
    folder : Path
        Folder with new names.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def changed_at(path: Path) -> int:
    """Time of change of a file [ns since 1970], 0 if there is none.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    int
        Time in nanoseconds.
    """
    try:
        return path.stat().st_mtime_ns
    except (FileNotFoundError, NotADirectoryError):
        return 0


SPECIAL_FILES = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
    (stat.S_ISCHR, "character device"),
    (stat.S_ISBLK, "block device"),
)


def special_kind(mode: int) -> str:
    """What a name stands for if it is no regular file; opening a pipe waits for ever, a device may have no end.

    Parameters
    ----------
    mode : int
        ``st_mode`` of its status.

    Returns
    -------
    str
        "pipe", "socket" and the like; "" for a regular file.

    Examples
    --------
    >>> special_kind(os.stat(os.devnull).st_mode), special_kind(os.stat("/").st_mode)
    ('character device', 'folder')
    """
    if stat.S_ISREG(mode):
        return ""
    return next((kind for is_kind, kind in SPECIAL_FILES if is_kind(mode)), "special file")


MIN_SPARSE_SIZE = 2**26  # bytes: a smaller file is read anyway
MAX_HOLES = 1032  # bytes of a file per byte on the disk: the bound of deflate, for file systems that compress


def sparse_size(path: os.PathLike | str, status: os.stat_result) -> int:
    """Bytes on the disk of a file that is nearly empty: a size without content, which takes hours to read.

    Parameters
    ----------
    path : path-like
        The file.
    status : os.stat_result
        Its status.

    Returns
    -------
    int
        0 or more for a sparse file; -1 for any other, and where the system does not say. Some file systems report no
        blocks for any file: then the file is sparse if it has no data at all.
    """
    on_disk = 512 * getattr(status, "st_blocks", status.st_size)
    if on_disk == 0 and status.st_size > MIN_SPARSE_SIZE and _has_data(path):
        return -1
    return on_disk if status.st_size > max(MIN_SPARSE_SIZE, MAX_HOLES * on_disk) else -1


def _has_data(path: os.PathLike | str) -> bool:
    """Whether a file has any data that is no hole; True where the system does not say."""
    if not hasattr(os, "SEEK_DATA"):
        return True
    try:
        with open(path, "rb") as stream:
            os.lseek(stream.fileno(), 0, os.SEEK_DATA)
    except OSError as error:  # what else cannot be opened is said by those who read it
        return error.errno != errno.ENXIO
    return True


def read_regular(path: os.PathLike | str) -> bytes:
    """All bytes of a regular file; what else the name may stand for is not opened.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    bytes
        Its content.

    Raises
    ------
    OSError
        If it is absent, not readable, or no regular file.
    """
    if kind := special_kind(os.stat(path).st_mode):
        if kind == "folder":
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        raise OSError(errno.EINVAL, f"it is a {kind}, not a file", str(path))
    return Path(path).read_bytes()


def write_text(path: os.PathLike | str, text: str) -> None:
    """Atomic write of UTF-8 text.

    Parameters
    ----------
    path : path-like
        The file.
    text : str
        Its new content.

    Raises
    ------
    OSError
        If the disk fails or is full.
    """
    write_atomic(path, lambda stream: stream.write(text.encode()))


def write_if_changed(path: os.PathLike | str, text: str) -> bool:
    """Write ``text`` unless it is already the content; so the file's time is that of its last change.

    Parameters
    ----------
    path : path-like
        The file.
    text : str
        Its new content.

    Returns
    -------
    bool
        Whether it was written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_if_changed(f"{folder}/plan", "a"), write_if_changed(f"{folder}/plan", "a")
    (True, False)
    """
    path = Path(path)
    if path.exists() and path.read_bytes() == text.encode():
        return False
    write_text(path, text)
    return True


def is_truncated(path: os.PathLike | str, end: str) -> bool:
    """Whether an existing file lacks its last line ``end``; only the end of the file is read.

    Parameters
    ----------
    path : path-like
        The file.
    end : str
        Last line of a complete file.

    Returns
    -------
    bool
        False if there is no such file.
    """
    try:
        with open(path, "rb") as stream:
            stream.seek(max(0, stream.seek(0, os.SEEK_END) - len(end.encode())))
            return stream.read() != end.encode()
    except FileNotFoundError:
        return False


def read_json(path: os.PathLike | str, default: Any) -> Any:
    """Content of a JSON file of ``work/``.

    Parameters
    ----------
    path : path-like
        The file.
    default : any
        Result for a file that is absent, or (with a warning) truncated or of another type than the default.

    Returns
    -------
    any
        The content, or ``default``.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if type(content) is not type(default):
            raise ValueError(f"{type(content).__name__} instead of {type(default).__name__}")
    except FileNotFoundError:
        return default
    except ValueError as error:
        logging.getLogger("turnout.workflow").warning("%s is cut or no JSON (%s): it is made again", path, error)
        return default
    return content
