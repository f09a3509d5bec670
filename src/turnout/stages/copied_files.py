"""Leave out copies of recordings: the same bytes under two names are one measurement, and count once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from turnout.content import sha256_of
from turnout.records import Unit
from turnout.workflow.scan import unit_id


def without_copies(units: Iterable[Unit], raw_root: str | Path) -> tuple[list[Unit], list[str]]:
    """Units without files that hold the same bytes as another file of the same kind.

    Of equal files the first one counts, by the name of its unit and its path, as in the workflow. Only files of equal
    size are read. A file that cannot be read is kept: whoever reads it says so.

    Parameters
    ----------
    units : iterable of Unit
        Hammer tests and passages of one turnout.
    raw_root : path
        Folder of all recordings.

    Returns
    -------
    tuple of (list of Unit, list of str)
        Units in the given order, without those that hold nothing but copies; and a sentence on each copy.
    """
    units = list(units)
    sizes = Counter((unit.kind, size) for unit in units for _, size, _ in unit.files)
    originals: dict[tuple[str, str], str] = {}
    copies: dict[str, str] = {}
    for unit in sorted(units, key=unit_id):
        for path, size, _ in sorted(unit.files):
            if sizes[unit.kind, size] > 1 and (content := _content(Path(raw_root) / path)):
                original = originals.setdefault((unit.kind, content), path)
                if original != path:
                    copies[path] = original
    if not copies:
        return units, []
    distinct = [replace(unit, files=tuple(f for f in unit.files if f[0] not in copies)) for unit in units]
    notes = [f"{path}: same bytes as {original}; not used" for path, original in copies.items()]
    return [new for new, old in zip(distinct, units) if new.files or not old.files], notes


def _content(path: Path) -> str:
    """sha256 of a file, "" if it cannot be read."""
    try:
        return sha256_of(path)
    except OSError:
        return ""
