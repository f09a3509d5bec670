"""From what a unit is computed: quickly by names, sizes and times of its files, surely by their content."""

import os
from collections.abc import Container, Sequence
from pathlib import Path

from turnout.config.merge import digest
from turnout.content import sha256_of
from turnout.fleet.plan import Planned
from turnout.fleet.state import ELSEWHERE


def stamp_of(planned: Planned) -> str:
    """Digest of configuration, note, and name, size and time of each file; no file is opened."""
    unit = planned.unit
    return digest([unit.config_hash, planned.note, unit.files])


def contents_of(planned: Planned, raw_root: Path) -> list[str | None]:
    """sha256 of each file of a unit, None for one that is gone; OSError where one cannot be read."""
    return [_content(os.path.join(raw_root, path)) for path, *_ in planned.unit.files]


def key_of(planned: Planned, contents: Sequence[str | None]) -> str:
    """Digest of configuration, note, and name and content of each file."""
    unit = planned.unit
    files = [[path, content] for (path, *_), content in zip(unit.files, contents, strict=True)]
    return digest([unit.config_hash, planned.note, files])


def short(contents: Sequence[str | None], elsewhere: Container[int] = ()) -> str:
    """The contents as a state keeps them: enough to tell the files of a fleet; "" where one was gone.

    The files whose numbers are in ``elsewhere`` count elsewhere.

    >>> short(["e3b0c44298fc1c149afbf4c8996fb924", "0123456789abcdef0123456789abcdef"], {1})
    'e3b0c44298fc1c14 -0123456789abcdef'
    """
    marks = [ELSEWHERE if k in elsewhere else "" for k in range(len(contents))]
    return " ".join(mark + c[:16] for mark, c in zip(marks, contents) if c) if all(contents) else ""


def _content(path: str) -> str | None:
    try:
        return sha256_of(path)
    except (FileNotFoundError, IsADirectoryError):
        return None
