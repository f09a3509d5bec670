"""Find the earlier generations that are kept: all of them, and the one of a number or a time."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.errors import RegistryError
from turnout.registry.generation import Generation, load, read_generation

if TYPE_CHECKING:
    from os import PathLike

HISTORY_FOLDER = "generations"
TIME_FORMAT = "%Y%m%dT%H%M%S%fZ"
_ENTRY = re.compile(r"(\d+)-(\d{8}T\d{12}Z)\.json")


def history(registry_dir: Path) -> dict[int, tuple[Path, datetime]]:
    """Kept generations, without one that is being published now or that a killed run left unpublished.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.

    Returns
    -------
    dict of int to (Path, datetime)
        Number -> file, time of publication in UTC; in the order of the numbers.
    """
    entries = entries_of(registry_dir)  # first: what is published meanwhile is left out as a whole
    newest = load(Path(registry_dir)).number
    return {number: entry for number, entry in entries.items() if number <= newest}


def entries_of(registry_dir: Path) -> dict[int, tuple[Path, datetime]]:
    """All listed generations, also those that are not published.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.

    Returns
    -------
    dict of int to (Path, datetime)
        As of ``history``.
    """
    entries: dict[int, tuple[Path, datetime]] = {}
    for path in sorted((Path(registry_dir) / HISTORY_FOLDER).glob("*.json")):
        if match := _ENTRY.fullmatch(path.name):
            entries[int(match[1])] = path, datetime.strptime(match[2], TIME_FORMAT).replace(tzinfo=UTC)
    return dict(sorted(entries.items()))


def find_generation(registry_dir: PathLike | str, as_of: int | str | datetime) -> tuple[Generation, datetime | None]:
    """The generation of a number, or the one that readers saw at a time.

    Parameters
    ----------
    registry_dir : path-like
        Folder of the registry.
    as_of : int or str or datetime
        Number of a generation, or a time: ISO text or datetime, UTC where it states no zone.

    Returns
    -------
    tuple of (Generation, datetime or None)
        The generation, and its time of publication if known.

    Raises
    ------
    RegistryError
        If it is not kept, or ``as_of`` is neither a number nor a time.
    """
    root = Path(registry_dir)
    generations = history(root)
    now = load(root)
    if isinstance(as_of, int) or str(as_of).strip().isdigit():
        wanted = int(as_of) if isinstance(as_of, int) else int(str(as_of))
    else:
        moment = _moment(as_of)
        wanted = max((number for number, (_, time) in generations.items() if time <= moment), default=-1)
    if wanted == now.number:
        return now, generations[wanted][1] if wanted in generations else None
    if wanted not in generations:
        listed = ", ".join(f"{number} ({time:%Y-%m-%d %H:%M:%S})" for number, (_, time) in generations.items())
        raise RegistryError(
            f"{root}: no generation is kept for {as_of}. Kept are, with the time of publication in UTC: "
            f"{listed or now.number}. Give one of these numbers, or a later time."
        )
    return read_generation(generations[wanted][0]), generations[wanted][1]


def _moment(as_of: str | datetime) -> datetime:
    try:
        moment = as_of if isinstance(as_of, datetime) else datetime.fromisoformat(as_of.strip())
    except ValueError:
        raise RegistryError(
            f"as of {as_of!r}: no time and no number of a generation. Write 2026-11-24T06:00:00 (UTC), or 17."
        ) from None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)
