"""From a path to a file that lies inside the raw root and can be opened."""

import os
from pathlib import Path

from turnout.errors import ReadError, of_the_machine
from turnout.readers.raw import Source

HEAD = 4096  # bytes, enough for every signature


def load(path, root) -> Source:
    """The file at ``path`` (relative to ``root``, or absolute inside it); ReadError says why not.

    A symbolic link counts by what it points to: one that leads out of the raw root is refused.
    """
    root = Path(root)
    inside = "Put the file under the raw root or correct the turnout's pattern"
    try:
        base = root.resolve()
        resolved = (base / Path(path)).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise ReadError(path, "the path", f"it cannot be followed ({error})", inside, reason="outside_root") from error
    name = _name(path, root, base)
    if not resolved.is_relative_to(base):
        raise ReadError(name, "the path", "it leads outside the raw root", inside, reason="outside_root")
    try:
        with resolved.open("rb") as file:
            head, size = file.read(HEAD), os.fstat(file.fileno()).st_size
    except (FileNotFoundError, NotADirectoryError) as error:
        again = "Correct the path; if it was there before, start again when it is back, or plan anew without it"
        raise ReadError(name, "the path", "there is no such file", again, reason="vanished") from error
    except OSError as error:
        if of_the_machine(error) and not isinstance(error, PermissionError):
            raise
        found = f"the file cannot be opened ({error.strerror})"
        raise ReadError(name, "the path", found, "Correct its permissions or copy it again") from error
    if not size:
        raise ReadError(name, "byte 0", "the file has no bytes", "Copy the file again from the logger", reason="empty")
    return Source(resolved, name, size, head)


def _name(path, root, base):
    """The path relative to the raw root where it has one, with forward slashes."""
    path = Path(path)
    for start in (root, base):
        if path.is_absolute() and path.is_relative_to(start):
            return path.relative_to(start).as_posix()
    return path.as_posix()
