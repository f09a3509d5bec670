"""Merge the results of many work batches into one stream sorted by unit."""

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from os import PathLike, fspath
from pathlib import Path

import pyarrow as pa

from turnout.registry.ids import content_id
from turnout.registry.intake import Arrival

CHUNK_SIZE = 1024  # units per chunk that is in memory at once


def token(path) -> str:
    """Name of a consumed batch in the generation file; batches are named by their content and never change."""
    path = Path(path)
    return f"{path.name}:{path.stat().st_size}"


def existing_batches(paths: Sequence[PathLike], faults: dict[str, str]) -> tuple[list[PathLike], list[str]]:
    """(paths, tokens) of the batches that exist; the others are entered in ``faults`` under their path."""
    existing, tokens = [], []
    for path in paths:
        try:
            tokens.append(token(path))
            existing.append(path)
        except OSError as error:
            faults[fspath(path)] = _describe(error)
    return existing, tokens


def unread_positions(tokens: Sequence[str], consumed: Sequence[str]) -> list[int]:
    """Positions of the batches to read: those that are new, or that come later in the list than before.

    Batches are in the order of writing, and the last result of a unit counts. A configuration that is changed back
    gives an old batch again, at the end of the list.

    >>> unread_positions(["a", "b", "c"], ["a", "c"]), unread_positions(["b", "a"], ["a", "b"])
    ([1], [1])
    """
    positions = {name: i for i, name in enumerate(consumed)}
    last, new = -1, []
    for i, name in enumerate(tokens):
        if positions.get(name, -1) > last:
            last = positions[name]
        else:
            new.append(i)
    return new


def merge_units(paths: Sequence[PathLike], read: Callable, faults: dict[str, str]) -> Iterator[Arrival]:
    """Units of all batches sorted by name; of a unit in several batches the result in the last one.

    ``read(path)`` yields objects with unit, turnout, kind, key, algo and tables, sorted by unit. A batch that cannot be
    read is entered in ``faults`` under its path, and the others are read.
    """
    streams = [_read_guarded(path, read, -i, faults) for i, path in enumerate(paths)]
    in_order = heapq.merge(*streams, key=lambda entry: entry[:2])
    for index, (_, group) in enumerate(groupby(in_order, key=lambda entry: entry[0])):
        _, _, result = next(group)
        yield Arrival(
            index=index, unit=result.unit, turnout=result.turnout, kind=result.kind,
            key=result.key, algo=result.algo, tables=_with_method(result.tables),
        )  # fmt: skip


def table_arrivals(tables: Mapping[str, list[dict]], first_index: int) -> list[Arrival]:
    """Rows that come from no recording, one unit per table: configuration, alarms, findings."""
    return [
        Arrival(
            index=first_index + i, unit=f"registry/{'configuration'}/{table}", turnout="registry",
            kind="configuration", key=content_id(table, tables[table]), algo="", tables={table: tables[table]},
        )
        for i, table in enumerate(sorted(tables))
    ]  # fmt: skip


def chunks(arrivals: Iterable[Arrival], size: int = CHUNK_SIZE) -> Iterator[list[Arrival]]:
    """Lists of at most ``size`` units, which limits the memory."""
    chunk: list[Arrival] = []
    for arrival in arrivals:
        chunk.append(arrival)
        if len(chunk) == size:
            yield chunk
            chunk = []
    if chunk:
        yield chunk


def _read_guarded(path, read, rank, faults):
    try:
        for result in read(path):
            yield result.unit, rank, result
    except (OSError, pa.ArrowException, ValueError, KeyError, TypeError) as error:
        faults[fspath(path)] = _describe(error)


def _describe(error: Exception) -> str:
    return f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"


def _with_method(tables):
    """Copy the method of each model to its modes, so that charts need no join."""
    methods = {m.get("model_id"): m.get("method") for m in tables.get("models", ())}
    for mode in tables.get("modes", ()):
        if isinstance(mode, dict) and mode.get("method") is None and mode.get("model_id") in methods:
            mode["method"] = methods[mode["model_id"]]
    return tables
