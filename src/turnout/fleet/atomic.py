"""Texts of ``work/``, written in one step, only where they changed; and how to tell a part where there is one.

A full disk, a power failure or a copy that was broken off may leave the beginning of a file all the same.
"""

import json
import logging
import os
from pathlib import Path

from turnout.atomic import write_atomic


def write_text(path: os.PathLike, text: str) -> None:
    """Atomic write of UTF-8 text."""
    write_atomic(path, lambda stream: stream.write(text.encode()))


def write_if_changed(path: os.PathLike, text: str) -> bool:
    """Write ``text`` unless the file already says so; the file's time then tells when its content changed.

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


def is_cut(path: os.PathLike, end: str) -> bool:
    """Whether a file is there and lacks its last line ``end``; only the end of it is read."""
    try:
        with open(path, "rb") as stream:
            stream.seek(max(0, stream.seek(0, os.SEEK_END) - len(end.encode())))
            return stream.read() != end.encode()
    except FileNotFoundError:
        return False


def read_json(path: os.PathLike, otherwise):
    """What a JSON file of ``work/`` says; ``otherwise`` where there is none, and where it is cut, with a warning."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return otherwise
    except ValueError as error:
        logging.getLogger("turnout.fleet").warning("%s is cut or no JSON (%s): it is made again", path, error)
        return otherwise
