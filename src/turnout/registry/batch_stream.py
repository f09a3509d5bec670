"""Merge the results of many work batches into one stream sorted by unit."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from turnout.registry.ids import content_id
from turnout.registry.intake import Arrival

if TYPE_CHECKING:
    from typing import Any

CHUNK_SIZE = 4096  # units per chunk that is in memory at once
CHUNK_ROWS = 4_096  # rows of a chunk, from which on it takes no further unit


def token(path: str | PathLike) -> str:
    """Name of a consumed batch in the generation file; batches are named by their content and never change.

    Parameters
    ----------
    path : str or PathLike
        Path of a batch.

    Returns
    -------
    str
        Name and size of the file.
    """
    path = Path(path)
    return f"{path.name}:{path.stat().st_size}"


def existing_batches(paths: Sequence[PathLike], faults: dict[str, str]) -> tuple[list[PathLike], list[str]]:
    """Find the batches that exist.

    Parameters
    ----------
    paths : sequence of PathLike
        Paths of batches.
    faults : dict
        Filled with the reason for each other batch, by its path.

    Returns
    -------
    (list of path, list of str)
        Paths and tokens of the batches that exist.
    """
    existing, tokens = [], []
    for path in paths:
        try:
            tokens.append(token(path))
            existing.append(path)
        except OSError as error:
            faults[fspath(path)] = _describe(error)
    return existing, tokens


def unread_positions(tokens: Sequence[str], consumed: Sequence[str], folders: Sequence[str]) -> list[int]:
    """Positions of the batches to read: those that are new, or that follow a new one or come later than before.

    The batches of a folder are in the order of writing, and the last result of a unit counts. A configuration that is
    changed back, or a damaged batch that is written again, gives an old batch again, behind new ones.

    Parameters
    ----------
    tokens : sequence of str
        Tokens of the offered batches, in the order of writing.
    consumed : sequence of str
        Tokens of the batches that were registered already.
    folders : sequence of str
        Folder of each offered batch; those of another shard hold other units.

    Returns
    -------
    list of int
        Positions in ``tokens``, ascending.

    Examples
    --------
    >>> unread_positions(["a", "b", "c"], ["a", "c"], ["1", "1", "1"]), unread_positions(["b", "a"], ["a", "b"], "11")
    ([1, 2], [1])
    >>> unread_positions(["a", "b", "c"], ["a", "c"], ["1", "1", "2"])
    [1]
    """
    positions = {name: i for i, name in enumerate(consumed)}
    last, new, changed = -1, [], set()
    for i, (name, folder) in enumerate(zip(tokens, folders, strict=True)):
        if positions.get(name, -1) > last and folder not in changed:
            last = positions[name]
        else:
            new.append(i)
            changed.add(folder)
    return new


def merge_units(paths: Sequence[PathLike], read: Callable, faults: dict[str, str]) -> Iterator[Arrival]:
    """Units of all batches sorted by name; of a unit in several batches the result in the last one.

    A batch that cannot be read does not stop the others.

    Parameters
    ----------
    paths : sequence of PathLike
        Batches in the order of writing.
    read : Callable
        ``read(path)`` yields objects with unit, turnout, kind, key, algo and tables, sorted by unit.
    faults : dict
        Filled with the reason for each batch that cannot be read, by its path.

    Yields
    ------
    Arrival
        Units, numbered in their order.
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
    """Rows that come from no recording, one unit per table: configuration, alarms, findings.

    Parameters
    ----------
    tables : mapping
        Rows by table.
    first_index : int
        Number of the first of these units.

    Returns
    -------
    list of Arrival
        One unit for each table.
    """
    return [
        Arrival(
            index=first_index + i, unit=f"registry/{'configuration'}/{table}", turnout="registry",
            kind="configuration", key=content_id(table, tables[table]), algo="", tables={table: tables[table]},
        )
        for i, table in enumerate(sorted(tables))
    ]  # fmt: skip


def chunks(
    arrivals: Iterable[Arrival], size: int = CHUNK_SIZE, n_most_rows: int = CHUNK_ROWS
) -> Iterator[list[Arrival]]:
    """Lists of units, of which each but the last has ``size`` units or at least ``n_most_rows`` rows.

    That limits the memory, and small units come in large lists, because each list has a cost of its own.

    Parameters
    ----------
    arrivals : iterable of Arrival
        Units.
    size : int
        Largest number of units in a list.
    n_most_rows : int
        Number of rows after which a list ends.

    Yields
    ------
    list[Arrival]
        Units, in their order.

    Examples
    --------
    >>> units = [Arrival(k, "", "", "", "", "", {"impacts": [{}] * n}) for k, n in enumerate((1, 1, 9, 1, 1, 1))]
    >>> [[arrival.index for arrival in chunk] for chunk in chunks(units, 2, 9)]
    [[0, 1], [2], [3, 4], [5]]
    """
    chunk: list[Arrival] = []
    n_row = 0
    for arrival in arrivals:
        chunk.append(arrival)
        n_row += sum(map(len, arrival.tables.values()))
        if len(chunk) == size or n_row >= n_most_rows:
            yield chunk
            chunk, n_row = [], 0
    if chunk:
        yield chunk


def _read_guarded(path: PathLike, read: Callable, rank: int, faults: dict[str, str]) -> Iterator[tuple[str, int, Any]]:
    try:
        for result in read(path):
            yield result.unit, rank, result
    except (OSError, pa.ArrowException, ValueError, KeyError, TypeError) as error:
        faults[fspath(path)] = _describe(error)


def _describe(error: Exception) -> str:
    return f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"


def _with_method(tables: dict[str, list[dict]]) -> dict[str, list[dict]]:
    """Copy the method of each model to its modes, so that charts need no join."""
    methods = {m.get("model_id"): m.get("method") for m in tables.get("models", ())}
    for mode in tables.get("modes", ()):
        if isinstance(mode, dict) and mode.get("method") is None and mode.get("model_id") in methods:
            mode["method"] = methods[mode["model_id"]]
    return tables
