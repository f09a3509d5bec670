"""Check rows in staging tables with CHECK and PRIMARY KEY, because Parquet has no constraints.

A rejected row becomes a quarantine row, so it is not lost and does not stop the others.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import duckdb
import pyarrow as pa

from turnout.registry.arrow_arrays import arrow_array, arrow_table
from turnout.registry.ids import content_id
from turnout.registry.intake import Arrival, RejectedRow
from turnout.registry.schema import CHILDREN, create_table, key, names, tables

if TYPE_CHECKING:
    from typing import Any

UNIQUE = "unique, and another row has it already"
FILLED_AT_THE_END = ("runs", "supersedes")  # by the registration itself, not from the rows of units
MARK_COLUMNS = ", _unit integer, _row integer, _year integer"


def create_staging(con: duckdb.DuckDBPyConnection, is_indexed: bool = True) -> None:
    """Create the table ``came`` of incoming units, and an empty staging table for each table of the registry.

    Parameters
    ----------
    con : DuckDB connection
        Connection in memory.
    is_indexed : bool
        Whether a row with the key of another is rejected at once; otherwise ``has_duplicate_keys`` finds it later.
    """
    con.execute("create table came (_unit integer, unit_id varchar, result_id varchar, algo varchar)")
    for table in tables():
        con.execute(create_table(table, f"new_{table}", MARK_COLUMNS, is_indexed or table in FILLED_AT_THE_END))


def has_duplicate_keys(con: duckdb.DuckDBPyConnection, among: Iterable[str]) -> bool:
    """Whether two rows of a staging table have the same key.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    among : iterable of str
        Names of the tables to be searched.

    Returns
    -------
    bool
        True if a table has such rows.
    """
    for table in among:
        keys = ", ".join(f'"{k}"' for k in key(table))
        if con.execute(f"select 1 from new_{table} group by {keys} having count(*) > 1 limit 1").fetchall():
            return True
    return False


def note_arrivals(con: duckdb.DuckDBPyConnection, arrivals: list[Arrival]) -> None:
    """Enter the units of a chunk in ``came``, before their rows.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    arrivals : list of Arrival
        Units of a chunk.
    """
    columns = {"unit_id": "unit", "result_id": "result_id", "algo": "algo"}
    texts = {name: arrow_array([getattr(a, of) for a in arrivals], pa.string()) for name, of in columns.items()}
    con.register("_arrivals", arrow_table({"_unit": arrow_array([a.index for a in arrivals], pa.int32())} | texts))
    con.execute("insert into came select * from _arrivals")
    con.unregister("_arrivals")


def admit(con: duckdb.DuckDBPyConnection, table: str, gathered: pa.Table, run_id: str) -> list[RejectedRow]:
    """Insert the valid rows into ``new_<table>``.

    All rows are inserted at once; only if a constraint fails are the bad rows searched.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    table : str
        Name of the table.
    gathered : pa.Table
        Rows from ``gather``.
    run_id : str
        Id of the run, entered in every row.

    Returns
    -------
    list of RejectedRow
        The rows that break a rule.
    """
    if gathered.num_rows == 0:
        return []
    con.register("_gathered", gathered)
    rejected_rows: list[RejectedRow] = []
    try:
        con.execute(f"insert into new_{table} {_select(table, run_id)}")
    except duckdb.ConstraintException:
        con.execute(f"create or replace temp table arriving as {_select(table, run_id)}")
        rejected_rows = _bad_values(con, table) + _duplicate_keys(con, table)
        con.execute(f"insert into new_{table} select * from arriving")
        con.execute("drop table arriving")
    finally:
        con.unregister("_gathered")
    return rejected_rows


def reject_orphans(
    con: duckdb.DuckDBPyConnection, rejected_rows: list[RejectedRow], arrivals: Mapping[int, Arrival]
) -> int:
    """Remove the rows that belong to a rejected model or passage, and what was reported of them.

    Parameters
    ----------
    con : DuckDB connection
        Connection with the staging tables.
    rejected_rows : list of RejectedRow
        Rejected rows of the chunk; changed.
    arrivals : mapping
        Units of the chunk by their number.

    Returns
    -------
    int
        Number of rows that were removed.
    """
    n_removed = 0
    for rejected in list(rejected_rows):
        if rejected.table not in CHILDREN:
            continue
        id_column, children = CHILDREN[rejected.table]
        parent = arrivals[rejected.unit].tables[rejected.table][rejected.row].get(id_column)
        for child in children:
            where = f"from new_{child} where _unit = ? and {id_column} is not distinct from ?"
            n_removed += con.execute(f"select count(*) {where}", [rejected.unit, parent]).fetchall()[0][0]
            con.execute(f"delete {where}", [rejected.unit, parent])
            child_rows = arrivals[rejected.unit].tables.get(child, ())
            rejected_rows[:] = [
                r
                for r in rejected_rows
                if (r.unit, r.table) != (rejected.unit, child) or child_rows[r.row].get(id_column) != parent
            ]
    return n_removed


def _select(table: str, run_id: str) -> str:
    """SELECT of rounded values in the order of the table, with the columns that the registration fills in."""
    filled = {"run_id": f"'{run_id}'", "result_id": "_result_id"}
    expressions = [f'{filled.get(c.name, c.rounded)} as "{c.name}"' for c in tables()[table]]
    return f"select {', '.join(expressions)}, _unit, _row, _year from _gathered"


def _bad_values(con: duckdb.DuckDBPyConnection, table: str) -> list[RejectedRow]:
    """Rejected rows: those that break a CHECK or lack a value; these rows are deleted from ``arriving``."""
    rejected_rows = []
    for column in tables()[table]:
        rules = ([f'"{column.name}" is null'] if column.required or column.key else []) + (
            [f"not ({column.check})"] if column.check else []
        )
        if not rules:
            continue
        where = f"coalesce({' or '.join(rules)}, false)"
        number = f'"{column.name}"::double' if column.type in ("double", "float", "integer", "bigint") else "null"
        rows = con.execute(
            f'select _unit, _row, "{column.name}"::varchar, {number} from arriving where {where} order by all'
        ).fetchall()
        for unit, row, value, figure in rows:
            requirement = "given" if value is None else column.rule
            rejected_rows.append(
                RejectedRow(
                    unit, table, row, column.name, "missing" if value is None else value[:200], requirement, figure
                )
            )
        if rows:
            con.execute(f"delete from arriving where {where}")
    return rejected_rows


def _duplicate_keys(con: duckdb.DuckDBPyConnection, table: str) -> list[RejectedRow]:
    """Rejected rows: all those but the first of each key, in the order of the units, including earlier chunks."""
    keys = key(table)
    quoted = ", ".join(f'"{k}"' for k in keys)
    numbered = f"select _unit, _row, {quoted}, row_number() over (partition by {quoted} order by _unit, _row) as nth"
    later = f"select * exclude nth from ({numbered} from arriving) where nth > 1"
    existing = f"select _unit, _row, {quoted} from arriving semi join new_{table} using ({quoted})"
    rows = con.execute(f"from ({later} union {existing}) order by all").fetchall()
    for unit, row, *_ in rows:
        con.execute("delete from arriving where _unit = ? and _row = ?", [unit, row])
    return [
        RejectedRow(unit, table, row, "+".join(keys), " ".join(map(str, values)), UNIQUE) for unit, row, *values in rows
    ]


REMEDY = "This is a fault of the stage that made the row, not of the measurement: report it with this"
_MAX_LENGTH = 2000  # characters of the column ``found``


def quarantine_of(rejected: RejectedRow, arrival: Arrival) -> dict:
    """Quarantine row that names table, row, column and value, with the whole row in ``found``.

    Parameters
    ----------
    rejected : RejectedRow
        The rejected row.
    arrival : Arrival
        Its unit.

    Returns
    -------
    dict
        Row of the table ``quarantine``, without its id.
    """
    source_row = arrival.tables[rejected.table][rejected.row]
    row = source_row if isinstance(source_row, dict) else {}
    recordings = [r for r in arrival.tables.get("recordings", ()) if isinstance(r, dict)] or [{}]
    path = row.get("path") or recordings[0].get("path") or arrival.unit
    record = row.get("record")
    number = rejected.number
    whole = json.dumps(source_row, default=str, sort_keys=True)
    return {
        "turnout_id": arrival.turnout,
        "section_id": _text(row.get("section_id") or recordings[0].get("section_id")),
        "kind": arrival.kind if arrival.kind in ("hammer", "passage") else None,
        "path": str(path),
        "record": record if isinstance(record, int) and record >= 0 else None,
        "recording_id": _text(row.get("recording_id")),
        "stage": "register",
        "reason_code": "internal_error",
        "place": f"{rejected.table}, row {rejected.row + 1}, column {rejected.column}",
        "found": f"{rejected.value}, must be {rejected.requirement}; row: {whole}"[:_MAX_LENGTH],
        "remedy": REMEDY,
        "measured_value": number if number is not None and math.isfinite(number) else None,
    }


def with_quarantine_id(row: dict, unit: str) -> dict:
    """The quarantine row with its id, the hash of the unit and of its content.

    The channels do not count: they stand in the place as well, and rows of earlier versions have none.

    Parameters
    ----------
    row : dict
        Row of the table ``quarantine``.
    unit : str
        Name of its unit.

    Returns
    -------
    dict
        A copy with ``quarantine_id``.
    """
    without = ("quarantine_id", "channels", "run_id", "result_id")
    content = {k: row.get(k) for k in names("quarantine") if k not in without}
    return row | {"quarantine_id": content_id("quarantine", unit, content)}


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None
