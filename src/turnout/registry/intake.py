"""Collect rows of many units as typed columns; a row with a value of another type is rejected, never guessed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import compress
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from turnout.registry.arrow_arrays import NONE, arrow_array, arrow_table, from_numpy
from turnout.registry.arrow_types import arrow_type
from turnout.registry.ids import content_id
from turnout.registry.schema import FILLED_BY_REGISTER, Column, names, tables

if TYPE_CHECKING:
    from collections.abc import Collection

UNDATED = 0  # year of units without a time
_DATE = re.compile(r"(?<!\d)(\d{4})(?:-\d\d-\d\d|\d{4}T?)")


@dataclass(frozen=True)
class RejectedRow:
    """A rejected row: index of its unit, table and row, column and value at fault, and the ``requirement``."""

    unit: int
    table: str
    row: int
    column: str
    value: str
    requirement: str
    number: float | None = None

    def __str__(self) -> str:
        return f"{self.table}, row {self.row + 1}, column {self.column}: {self.value}, must be {self.requirement}"


@dataclass
class Arrival:
    """One computed unit to be registered; ``index`` is its position among all units sorted by name."""

    index: int
    unit: str
    turnout: str
    kind: str
    key: str
    algo: str
    tables: dict[str, list[dict]]
    result_id: str = field(init=False)
    year: int = field(init=False)

    def __post_init__(self) -> None:
        self.result_id = content_id("result", self.unit, self.key, self.algo)
        self.year = unit_year(self.unit, self.tables)

    @property
    def label(self) -> str:
        """The unit without turnout and kind."""
        return self.unit.split("/", 2)[-1]


def unit_year(unit: str, rows: Mapping[str, list[dict]]) -> int:
    """Year under which all rows of a unit are stored: that in its name, else of its first time, else ``UNDATED``.

    Parameters
    ----------
    unit : str
        Name of the unit.
    rows : mapping
        Rows of the unit by table.

    Returns
    -------
    int
        The year.

    Examples
    --------
    >>> unit_year("t1/hammer/A7/2024-05-13", {}), unit_year("t1/passage/20260105T101112Z", {}), unit_year("t1/x/y", {})
    (2024, 2026, 0)
    """
    if date := _DATE.search(unit.split("/", 1)[-1]):
        return int(date[1])
    times = (str(v) for table in sorted(rows) for row in rows[table] for k, v in row.items() if k.endswith("_at_utc"))
    return next((int(t[:4]) for t in times if t[:4].isdigit()), UNDATED)


def gather(table: str, arrivals: Iterable[Arrival]) -> tuple[pa.Table, list[RejectedRow]]:
    """Typed columns of one table over all units, and columns ``_unit``, ``_row``, ``_year`` and ``_result_id``.

    Parameters
    ----------
    table : str
        Name of the table.
    arrivals : iterable of Arrival
        Units with their rows.

    Returns
    -------
    (Table, list of RejectedRow)
        All rows whose values fit their types; a rejected row for every other one: one with a column that is not in
        ``columns.csv``, or with a value of another type.
    """
    column_names = frozenset(names(table))
    units, years, result_ids = list[int](), list[int](), list[str]()
    row_numbers, rows = list[int](), list[Any]()
    for arrival in arrivals:
        unit_rows = arrival.tables.get(table, ())
        n = len(unit_rows)
        units += [arrival.index] * n
        row_numbers += range(n)
        years += [arrival.year] * n
        result_ids += [arrival.result_id] * n
        rows += unit_rows
    rejected_rows: list[RejectedRow] = []
    stated = set[str]().union(*(row for row in rows if isinstance(row, dict)))
    if not (column_names.issuperset(stated) and set(map(type, rows)) <= {dict}):
        known = [isinstance(row, dict) and column_names.issuperset(row) for row in rows]
        rejected_rows = [
            _rejected_row(unit, table, k, row, column_names)
            for unit, k, row, is_known in zip(units, row_numbers, rows, known)
            if not is_known
        ]
        units, row_numbers, years = (list(compress(numbers, known)) for numbers in (units, row_numbers, years))
        result_ids, rows = list(compress(result_ids, known)), list(compress(rows, known))
    columns = [c for c in tables()[table] if c.name not in FILLED_BY_REGISTER]
    bad: dict[int, RejectedRow] = {}
    arrays = {c.name: pa.nulls(len(rows), arrow_type(c)) for c in columns}
    columns = [c for c in columns if c.name in stated]
    for column, values in zip(columns, _by_column(rows, [c.name for c in columns])):
        arrays[column.name], wrong = to_arrow(column, values)
        for i in wrong:
            value = repr(values[i])[:200]
            bad.setdefault(
                i, RejectedRow(units[i], table, row_numbers[i], column.name, value, f"of type {column.type}")
            )
    numbers = {"_unit": units, "_row": row_numbers, "_year": years}
    marks = {name: arrow_array(values, pa.int32()) for name, values in numbers.items()}
    gathered = arrow_table(arrays | marks | {"_result_id": arrow_array(result_ids, pa.string())})
    if bad:
        gathered = gathered.filter(pa.array([i not in bad for i in range(len(rows))]))
    return gathered, rejected_rows + [bad[i] for i in sorted(bad)]


def _rejected_row(unit: int, table: str, row_number: int, row: Any, column_names: Collection[str]) -> RejectedRow:
    if not isinstance(row, dict):
        return RejectedRow(unit, table, row_number, "all", repr(row)[:200], "a row")
    name = min(map(str, row.keys() - column_names))
    return RejectedRow(unit, table, row_number, name, repr(row.get(name))[:200], "a column of columns.csv")


def _by_column(rows: list[dict], wanted: list[str]) -> list[Sequence]:
    """Values of each column. Rows usually have the same keys, and using that halves the time."""
    if not rows:
        return [()] * len(wanted)
    shared_names = [name for name in wanted if name in rows[0]]
    try:
        transposed = zip(*map(itemgetter(*shared_names, shared_names[0]), rows)) if shared_names else ()
        fetched: dict[str, Sequence] = dict(zip(shared_names, transposed))
    except KeyError:
        return [[row.get(name) for row in rows] for name in wanted]
    fetched |= {name: [row.get(name) for row in rows] for name in wanted if name not in fetched}
    return [fetched[name] for name in wanted]


def to_arrow(column: Column, values: Sequence) -> tuple[pa.Array, list[int]]:
    """Arrow array of the values of a column.

    Parameters
    ----------
    column : Column
        Column with its type.
    values : Sequence
        Values of any type.

    Returns
    -------
    (Array, list of int)
        Array with NULL for the values that do not fit, and their indices.

    Examples
    --------
    >>> from turnout.registry.schema import column
    >>> to_arrow(column("modes", "n_impacts"), [30, None, "many"])[1]
    [2]
    """
    try:
        return _convert(column, values), []
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        pass
    wrong = []
    for i, value in enumerate(values):
        try:
            _convert(column, [value])
        except (pa.ArrowException, TypeError, ValueError, OverflowError):
            wrong.append(i)
    misfit = set(wrong)
    return _convert(column, [None if i in misfit else v for i, v in enumerate(values)]), wrong


def _convert(column: Column, values: Sequence) -> pa.Array:
    if column.is_list:
        return _lists(column, values)
    if column.type == "timestamp":
        distinct = list(set(values))
        parsed = arrow_array([_time(v) for v in distinct], pa.timestamp("us"))
        positions = {v: k for k, v in enumerate(distinct)}
        return parsed.take(from_numpy(np.array([positions[v] for v in values], np.int64)))
    if pa.types.is_floating(arrow_type(column)) or pa.types.is_integer(arrow_type(column)):
        kinds = set(map(type, values))
        if not kinds.isdisjoint((bool, str, np.bool_)):
            raise TypeError("text or truth value where a number belongs")
        if pa.types.is_integer(arrow_type(column)) and float in kinds:  # pa.array would silently truncate
            return pa.array(values, pa.float64()).cast(arrow_type(column))
    return arrow_array(values, arrow_type(column))


def _time(value: Any) -> datetime | None:
    """Naive UTC from ISO text or a datetime; ValueError for another time zone."""
    if value is None:
        return None
    time = datetime.fromisoformat(value) if isinstance(value, str) else _as_datetime(value)
    if time.utcoffset():
        raise ValueError("a time in another zone than UTC")
    return time.replace(tzinfo=None)


def _as_datetime(value: Any) -> datetime:
    if type(value) is datetime:
        return value
    import pandas as pd  # results of the workflow are text; pandas takes 0.3 CPU s and 50 MB

    return pd.Timestamp(value).to_pydatetime()


def _lists(column: Column, values: Sequence) -> pa.Array:
    """List array from lists or numpy arrays, through one flat array."""
    kinds = set(map(type, values))
    if any(issubclass(kind, (str, bytes, Mapping)) for kind in kinds):
        raise TypeError("not a list")
    element_type = arrow_type(column).value_type
    if not all(issubclass(kind, (np.ndarray, NONE)) for kind in kinds):
        return pa.array([v.tolist() if isinstance(v, np.ndarray) else v for v in values], arrow_type(column))
    arrays = [np.ravel(v) for v in values if v is not None]
    flat = np.concatenate(arrays) if arrays else np.zeros(0)
    lengths = np.array([0 if v is None else np.size(v) for v in values], dtype=np.int64)
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    if pa.types.is_string(element_type):
        elements = arrow_array(flat.tolist(), element_type)
    else:
        elements = from_numpy(flat.astype(element_type.to_pandas_dtype()))
    is_valid = np.packbits(np.array([v is not None for v in values], dtype=bool), bitorder="little")
    buffers = [pa.py_buffer(is_valid.tobytes()), pa.py_buffer(offsets)]
    return pa.Array.from_buffers(arrow_type(column), len(values), buffers, children=[elements])
