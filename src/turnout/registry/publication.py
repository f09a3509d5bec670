"""Publish a generation, and keep the earlier ones for a day.

Each published generation also leaves ``generations/<number>-<time>.json``. The files that a generation names stay for a
day after its successor was published, so that a reader that opened it, or asks about yesterday, still finds them.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

from turnout.errors import RegistryError
from turnout.registry.database import build_database
from turnout.registry.generation import (
    GENERATION_FILE,
    N_KEPT_GENERATIONS,
    Generation,
    commit,
    delete_files,
    write_durably,
)
from turnout.registry.generation_history import HISTORY_FOLDER, TIME_FORMAT, entries_of

KEPT_TIME = timedelta(days=1)


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
    former = [path for number, (path, _) in entries_of(root).items() if number >= generation.number]
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
    for number, (path, _) in entries_of(root).items():
        if number < max(expired, default=0):
            path.unlink(missing_ok=True)


def _expired_generations(root: Path, number: int, now: datetime) -> set[int]:
    """Numbers of the generations whose predecessors nobody reads any more when ``number`` is published.

    A generation expires a day after its publication and two generations later. One with an unknown time (of an earlier
    version of the program), or a time that is still to come (the clock was wrong), expires two generations later.
    """
    times = {n: time for n, (_, time) in entries_of(root).items()}
    oldest = min((n for n, time in times.items() if now - KEPT_TIME < time <= now), default=number)
    return {n for n in range(number - N_KEPT_GENERATIONS + 1) if n < oldest or times.get(n, now) > now}


def _due_for_deletion(generation: Generation, expired: set[int]) -> list[str]:
    """Remove from ``retired``, and return, the files that were removed by an expired generation."""
    live = {f.path for f in generation.files}
    # a small table that was changed back has its old path again, which may be live or retired a second time
    retired = dict(sorted(generation.retired, key=lambda entry: entry[1]))
    waiting = {path: n for path, n in retired.items() if path not in live}
    generation.retired = sorted((path, n) for path, n in waiting.items() if n not in expired)
    return sorted(path for path, n in waiting.items() if n in expired)
