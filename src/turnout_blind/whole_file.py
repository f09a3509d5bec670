"""Files that appear complete or not at all. The generator has its own, because it imports nothing that it tests."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file under another name, and rename it: an interrupted write leaves the former file.

    Parameters
    ----------
    path : path
        File to write; its folder is created.
    content : bytes
        Its content.

    Raises
    ------
    OSError
        If the disk fails or is full, or the file may not be written; ``filename`` is ``path``.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):  # what failed is stated, not that its rest stays
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
