"""Write and read batches, the files of results of a shard job: one row per unit, never changed once written.

A batch is ``work/<stage>/<shard>/batch-<hash of its content>.parquet`` with the columns

========= ====== ==================================================================================
unit      string "<turnout>/<kind>/<label>", unique in the batch; rows are sorted by it
turnout   string turnout of the unit
kind      string "hammer" or "passage"
key       string what the result was computed from: configuration, files, campaign
algo      string version of the code that computed it
status    string "ok", "partly" (some rows in quarantine), "quarantined" (nothing else), "internal_error"
rows      string JSON object {table of columns.csv: [row, ...]} without ``run_id``
========= ====== ==================================================================================

Values inside ``rows``: times are ISO 8601 in naive UTC, numbers that are not finite are null, numpy arrays are
packed with their type and are read as numpy arrays. Only batches that a state file names count; others were left by a
killed job.
"""

from __future__ import annotations

import base64
import errno
import hashlib
import json
import math
import os
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.files import write_atomic

if TYPE_CHECKING:
    import pyarrow as pa

# A stage that uses results of another one reads the few units of one turnout: groups of large results are small. Each
# group costs 0.2 ms, so groups of small results are not.
MIN_GROUP_ROWS, GROUP_TEXT = 8, 2**18  # rows, characters
COLUMNS = ("unit", "turnout", "kind", "key", "algo", "status", "rows")


@dataclass(frozen=True)
class UnitResult:
    """Result of one unit: ``tables`` maps a table of columns.csv to its rows, without ``run_id``."""

    unit: str
    turnout: str
    kind: str
    key: str
    algo: str
    status: str
    tables: dict[str, list[dict]]


def write_batch(folder: Path, results: Iterable[UnitResult]) -> Path:
    """Write one batch, named by its content; the same results give the same file name.

    Parameters
    ----------
    folder : Path
        Folder of the batches of a shard.
    results : iterable of UnitResult
        Results of units; their order does not matter.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TypeError
        If a row holds a value that is no JSON, such as a set.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = [[*_header(r), encode(r.tables)] for r in sorted(results, key=lambda r: r.unit)]
    digest = hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:24]
    path = Path(folder) / f"batch-{digest}.parquet"
    table = pa.Table.from_arrays([_string_array(values) for values in zip(*rows)], names=list(COLUMNS))
    n_text = sum(len(row[-1]) for row in rows)
    n_group = max(MIN_GROUP_ROWS, len(rows) * GROUP_TEXT // max(n_text, 1))
    write_atomic(path, lambda stream: pq.write_table(table, stream, compression="zstd", row_group_size=n_group))
    return path


def read_results(path: os.PathLike | str, units: Container[str] | None = None) -> Iterator[UnitResult]:
    """Results of one batch, sorted by unit.

    Parameters
    ----------
    path : path-like
        The batch.
    units : container of str or None
        Only the results of these units; rows of others are not decoded. None: all.

    Yields
    ------
    UnitResult
        One result per unit.

    Raises
    ------
    ArrowException
        If the file is damaged.
    """
    import pyarrow.parquet as pq

    file = pq.ParquetFile(path)
    groups = list(range(file.num_row_groups))
    if units is not None:
        groups = [k for k in groups if any(name in units for name in _units(file.read_row_group(k, columns=["unit"])))]
    for group in file.iter_batches(batch_size=64, row_groups=groups):
        columns = (group.column(column).to_pylist() for column in COLUMNS)
        for unit, turnout, kind, key, algo, status, text in zip(*columns):
            if units is None or unit in units:
                yield UnitResult(unit, turnout, kind, key, algo, status, decode(text))


def _units(rows: Any) -> list[str]:
    return rows.column("unit").to_pylist()


def read_batch(path: os.PathLike | str) -> Iterator[tuple[str, str, list[dict]]]:
    """Tables of one batch, sorted by unit.

    Parameters
    ----------
    path : path-like
        The batch.

    Yields
    ------
    tuple of (str, str, list of dict)
        Unit, table, and its rows as in columns.csv without ``run_id``; tables without rows are left out.

    Examples
    --------
    >>> import tempfile
    >>> rows = {"recordings": [{"recording_id": "ab", "n_records": 10}], "quarantine": []}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result = UnitResult("t1/hammer/A7/2024-05-13", "t1", "hammer", "k", "1", "ok", rows)
    ...     list(read_batch(write_batch(Path(folder), [result])))
    [('t1/hammer/A7/2024-05-13', 'recordings', [{'n_records': 10, 'recording_id': 'ab'}])]
    """
    for result in read_results(path):
        for table, rows in result.tables.items():
            if rows:
                yield result.unit, table, rows


def is_readable(path: os.PathLike | str) -> bool:
    """Whether a batch exists and its Parquet footer can be read; the columns are not checked.

    Parameters
    ----------
    path : path-like
        The batch.

    Returns
    -------
    bool
        False if the file is absent or damaged.

    Raises
    ------
    OSError
        For a fault of the machine: the batch may be intact.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        pq.read_metadata(path)
    except (pa.ArrowException, FileNotFoundError):
        return False
    except OSError as error:
        if error.errno == errno.EIO:
            return False
        raise  # fault of the machine: the batch may be intact
    return True


def read_column(path: os.PathLike | str, *names: str) -> list[tuple]:
    """Some columns of a batch for all its units; fast, because ``rows`` is not read.

    Parameters
    ----------
    path : path-like
        The batch.
    *names : str
        Names of the columns.

    Returns
    -------
    list of tuple
        One tuple per unit, in the order of ``names``.
    """
    import pyarrow.parquet as pq

    groups = pq.ParquetFile(path).iter_batches(columns=list(names))
    return [tuple(row[n] for n in names) for group in groups for row in group.to_pylist()]


def encode(tables: dict[str, list[dict]]) -> str:
    """JSON of the rows of one unit; equal rows give equal text.

    Parameters
    ----------
    tables : dict of str to list of dict
        Table -> rows; values are JSON types, times or numpy arrays.

    Returns
    -------
    str
        JSON text.

    Raises
    ------
    TypeError
        If a row holds a value of another type.

    Examples
    --------
    >>> encode({"modes": [{"frequency_hz": np.float64(69.1), "damping_ratio": float("nan")}]})
    '{"modes":[{"damping_ratio":null,"frequency_hz":69.1}]}'
    """
    return json.dumps(_plain(tables), sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def decode(text: str) -> dict[str, list[dict]]:
    """Rows from the JSON of ``encode``; packed arrays become numpy arrays.

    Parameters
    ----------
    text : str
        Text that ``encode`` returned.

    Returns
    -------
    dict of str to list of dict
        Table -> rows; times remain text.
    """
    return _DECODER.decode(text)


def _string_array(values: Iterable[str]) -> pa.LargeStringArray:
    """Arrow strings without ``pa.array``, which imports pandas and doubles the time of a small job."""
    import pyarrow as pa

    encoded = [value.encode() for value in values]
    offsets = np.concatenate([[0], np.cumsum([len(e) for e in encoded])]).astype(np.int64)
    return pa.LargeStringArray.from_buffers(len(encoded), pa.py_buffer(offsets), pa.py_buffer(b"".join(encoded)))


def _header(result: UnitResult) -> tuple[str, ...]:
    return tuple(getattr(result, name) for name in COLUMNS[:-1])


def _plain(value: Any) -> Any:
    """``value`` converted to JSON types."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        little = value.astype(value.dtype.newbyteorder("<"))
        return {"__array__": value.dtype.str.lstrip("<=|>"), "data": base64.b64encode(little.tobytes()).decode()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (datetime, date)):
        return value.isoformat()
    if value is None or isinstance(value, (bool, int, str)):
        return value
    raise TypeError(f"a row holds a {type(value).__name__}: {value!r}")


def _unpack(pairs: dict) -> Any:
    if "__array__" in pairs:
        return np.frombuffer(base64.b64decode(pairs["data"]), dtype=pairs["__array__"])
    return pairs


_DECODER = json.JSONDecoder(object_hook=_unpack)  # ``json.loads`` would make one for each text
