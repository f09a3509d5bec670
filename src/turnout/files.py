"""Atomic writing of files: a reader sees the old file or the new one, never an incomplete one.

A full disk, a power failure or an interrupted copy may still truncate a file. ``is_truncated`` and ``read_json``
detect that.
"""

import json
import logging
import os
import secrets
import stat
from collections.abc import Callable
from pathlib import Path


def temporary_path(path: Path) -> Path:
    """Hidden name in the folder of ``path`` for an unfinished file; no other process or machine uses it.

    >>> name = temporary_path(Path("pages/a.html"))
    >>> name.parent.name, name.name.startswith(".a.html."), name.suffix, name == temporary_path(Path("pages/a.html"))
    ('pages', True, '.tmp', False)
    """
    return path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")


def write_atomic(path: os.PathLike, write: Callable) -> None:
    """Call ``write(stream)`` on a temporary file in the same folder, flush it to the disk, then rename it to ``path``.

    An existing file keeps its permissions. If ``write`` or the disk fails (OSError), it keeps its content as well.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_path(path)
    try:
        with open(temporary, "wb") as stream:
            if path.exists():
                os.chmod(temporary, stat.S_IMODE(path.stat().st_mode))
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def changed_at(path: Path) -> int:
    """Time of change of a file [ns since 1970], 0 if there is none."""
    try:
        return path.stat().st_mtime_ns
    except (FileNotFoundError, NotADirectoryError):
        return 0


def write_text(path: os.PathLike, text: str) -> None:
    """Atomic write of UTF-8 text."""
    write_atomic(path, lambda stream: stream.write(text.encode()))


def write_if_changed(path: os.PathLike, text: str) -> bool:
    """Write ``text`` unless it is already the content; so the file's time is that of its last change.

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


def is_truncated(path: os.PathLike, end: str) -> bool:
    """Whether an existing file lacks its last line ``end``; only the end of the file is read."""
    try:
        with open(path, "rb") as stream:
            stream.seek(max(0, stream.seek(0, os.SEEK_END) - len(end.encode())))
            return stream.read() != end.encode()
    except FileNotFoundError:
        return False


def read_json(path: os.PathLike, default):
    """Content of a JSON file of ``work/``; ``default`` if it is absent, or (with a warning) if it is truncated."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return default
    except ValueError as error:
        logging.getLogger("turnout.workflow").warning("%s is cut or no JSON (%s): it is made again", path, error)
        return default
