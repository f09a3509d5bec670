"""Write a file so that a reader sees the old one or the new one, never a part."""

import os
import secrets
import stat
from collections.abc import Callable
from pathlib import Path


def beside(path: Path) -> Path:
    """A hidden name beside ``path`` for what is not finished, that no process uses, on this machine or another.

    >>> name = beside(Path("pages/a.html"))
    >>> name.parent.name, name.name.startswith(".a.html."), name.suffix, name == beside(Path("pages/a.html"))
    ('pages', True, '.tmp', False)
    """
    return path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")


def write_atomic(path: os.PathLike, write: Callable) -> None:
    """Call ``write(stream)`` on a temporary file beside ``path``, flush it to the disk, then put it in place.

    A file that is there keeps its permissions, and its content where ``write`` or the disk fails (OSError).
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = beside(path)
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
