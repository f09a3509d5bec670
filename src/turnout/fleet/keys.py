"""From what a unit is computed: quickly by names, sizes and times of its files, surely by their content."""

import os
from pathlib import Path

from turnout.config.build import digest
from turnout.content import sha256_of
from turnout.fleet.plan import Planned


def stamp_of(planned: Planned) -> str:
    """Digest of configuration, note, and name, size and time of each file; no file is opened."""
    unit = planned.unit
    return digest([unit.config_hash, planned.note, unit.files])


def key_of(planned: Planned, raw_root: Path) -> str:
    """Digest of configuration, note, and name and content of each file; a file that is gone counts as None."""
    unit = planned.unit
    contents = [[path, _content(os.path.join(raw_root, path))] for path, *_ in unit.files]
    return digest([unit.config_hash, planned.note, contents])


def _content(path: str) -> str | None:
    """sha256 of a file's bytes; None where it is gone, OSError where it cannot be read."""
    try:
        return sha256_of(path)
    except (FileNotFoundError, IsADirectoryError):
        return None
