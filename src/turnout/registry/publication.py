"""Publish a generation, keep the earlier ones for a day, and find the generation of a time.

Each published generation also leaves ``generations/<number>-<time>.json``. The files that a generation names stay for a
day after its successor was published, so that a reader that opened it, or asks about yesterday, still finds them.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.errors import RegistryError
from turnout.registry.database import build_database
from turnout.registry.generation import (
    GENERATION_FILE,
    N_KEPT_GENERATIONS,
    Generation,
    commit,
    delete_files,
    load,
    read_generation,
    write_durably,
)

if TYPE_CHECKING:
    from os import PathLike

HISTORY_FOLDER = "generations"
KEPT_TIME = timedelta(days=1)
TIME_FORMAT = "%Y%m%dT%H%M%S%fZ"
_ENTRY = re.compile(r"(\d+)-(\d{8}T\d{12}Z)\.json")


def publish(registry_dir: Path, generation: Generation) -> None:
    """Publish a generation and delete the files that only expired generations name.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry.
    generation : Generation
        List of the live and retired files; ``retired`` is changed.

    Raises
    ------
    RegistryError
        If the disk fails or is full, or without write permission; then the former generation stays. Or if
        ``registry.duckdb`` cannot be written; the generation is published by then.
    """
    root, now = Path(registry_dir), datetime.now(UTC)
    expired = _expired_generations(root, generation.number, now)
    due = _due_for_deletion(generation, expired)
    entry = root / HISTORY_FOLDER / f"{generation.number:06d}-{now.strftime(TIME_FORMAT)}.json"
    former = [path for number, (path, _) in _entries(root).items() if number >= generation.number]
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        write_durably(entry, generation.to_json().encode())
        for path in former:  # of a run that was killed before its generation was published
            path.unlink(missing_ok=True)
        commit(root, generation)
    except OSError as error:
        raise RegistryError(
            f"cannot write {GENERATION_FILE} in {root}: {error}. The new rows do not count yet: make room or give "
            "write permission, then run again."
        ) from error
    build_database(root, generation)
    delete_files(root, due)
    for number, (path, _) in _entries(root).items():
        if number < max(expired, default=0):
            path.unlink(missing_ok=True)


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
    entries = _entries(registry_dir)  # first: what is published meanwhile is left out as a whole
    newest = load(Path(registry_dir)).number
    return {number: entry for number, entry in entries.items() if number <= newest}


def _entries(registry_dir: Path) -> dict[int, tuple[Path, datetime]]:
    """The same with generations that are not published."""
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
            f"{root}: no generation of {as_of} is kept. Kept are, with the time of publication in UTC: "
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


def _expired_generations(root: Path, number: int, now: datetime) -> set[int]:
    """Numbers of the generations whose predecessors nobody reads any more when ``number`` is published.

    A generation expires a day after its publication and two generations later. One with an unknown time (of an earlier
    version of the program), or a time that is still to come (the clock was wrong), expires two generations later.
    """
    times = {n: time for n, (_, time) in _entries(root).items()}
    oldest = min((n for n, time in times.items() if now - KEPT_TIME < time <= now), default=number)
    return {n for n in range(number - N_KEPT_GENERATIONS + 1) if n < oldest or times.get(n, now) > now}


def _due_for_deletion(generation: Generation, expired: set[int]) -> list[str]:
    """Remove from ``retired``, and return, the files that were removed by an expired generation."""
    live = {f.path for f in generation.files}
    # a small table that was changed back has its old path again, which may be live or retired a second time
    dropped = dict(sorted(generation.retired, key=lambda entry: entry[1]))
    waiting = {path: n for path, n in dropped.items() if path not in live}
    generation.retired = sorted((path, n) for path, n in waiting.items() if n not in expired)
    return sorted(path for path, n in waiting.items() if n in expired)
