"""Register work batches: one sorted Parquet file per table, year and run, then one atomic commit."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.registry.batch_stream import chunks, existing_batches, merge_units, table_arrivals, unread_positions
from turnout.registry.damage import take_off_damage
from turnout.registry.generation import check_schemas, load
from turnout.registry.lock import registry_lock
from turnout.registry.registration import Registration, RegistrationResult

if TYPE_CHECKING:
    from collections.abc import Iterator


def register(
    batches: Sequence[PathLike],
    registry_dir: PathLike,
    *,
    read: Callable,
    tables: Mapping[str, list[dict]] | None = None,
    config_hash: str | None = None,
    code_version: str = "",
    started_at: datetime | None = None,
    max_wait: float = 600.0,
) -> RegistrationResult:
    """Register the results of work batches and rows from the configuration.

    The same results give byte-identical files, however they are divided into batches and however often a run was killed
    before; only ``runs`` contains the time of day. A row that breaks a rule becomes a quarantine row.

    A live file whose bytes have changed on the disk is logged and taken off the list. Then all batches are read again,
    and the rows that are missing are written.

    Parameters
    ----------
    batches : sequence of path
        In the order in which they were written: of a unit in two of them the later counts.
    registry_dir : path
        Created where it does not exist.
    read : callable
        ``read(path)`` yields results sorted by unit, with unit, turnout, kind, key, algo, tables.
    tables : mapping of table to rows
        Rows that come from no recording. turnouts, sections, events, campaigns, acknowledgements are replaced as a
        whole. In other tables, rows of an earlier call that are missing now are superseded.
    config_hash, code_version, started_at
        Written to ``runs``; by default the run began with this call. [UTC, naive]
    max_wait : float
        How long to wait for another run that holds the lock. [s]

    Raises
    ------
    RegistryError
        Locked, disk full, no permission, or made by another version. Then nothing was changed.
    """
    root, started = Path(registry_dir), started_at or datetime.now(UTC).replace(tzinfo=None)
    with registry_lock(root, max_wait):
        before = take_off_damage(root, load(root))
        check_schemas(before)
        faults: dict[str, str] = {}
        existing, tokens = existing_batches(batches, faults)
        folders = [fspath(Path(path).parent) for path in existing]
        unread = [existing[i] for i in unread_positions(tokens, before.consumed, folders)]
        registration = Registration(root, before, is_indexed=False)
        _take_all(registration, unread, read, faults, tables or {})
        if registration.has_duplicates():  # rare: a stage made a wrong id, or two units have the same
            registration.con.close()
            registration = Registration(root, before)
            _take_all(registration, unread, read, faults, tables or {})
        consumed = [t for t, p in zip(tokens, existing) if fspath(p) not in faults]
        run_info = {"code_version": code_version, "config_hash": config_hash, "started_at_utc": started}
        return registration.finish(consumed, faults, run_info)


def _take_all(
    registration: Registration,
    unread: Sequence[PathLike],
    read: Callable,
    faults: dict[str, str],
    tables: Mapping[str, list[dict]],
) -> None:
    """Take the units of the batches, then the rows that come from no recording."""
    count = 0
    with _without_collection():
        for chunk in chunks(merge_units(unread, read, faults)):
            count = chunk[-1].index + 1
            registration.take(chunk)
    registration.replace_whole(tables)
    registration.take(table_arrivals(tables, count))


@contextmanager
def _without_collection() -> Iterator[None]:
    """Disable garbage collection: rows form no cycles, and searching them takes a quarter of the time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
