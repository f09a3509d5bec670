"""Carry out one registration: staging tables in memory, then Parquet files, then one commit."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from turnout.registry.arrow_arrays import arrow_array, arrow_table
from turnout.registry.connection import connect, limit_memory
from turnout.registry.database import build_database, is_behind
from turnout.registry.generation import GENERATION_FILE, Generation, commit, schema_of
from turnout.registry.ids import content_id
from turnout.registry.intake import Arrival, RejectedRow, gather
from turnout.registry.parquet import read_live, write_sorted
from turnout.registry.publication import publish
from turnout.registry.schema import CHILDREN, WHOLE_TABLES, key, literal, tables
from turnout.registry.staging import (
    admit,
    create_staging,
    has_duplicate_keys,
    note_arrivals,
    quarantine_of,
    reject_orphans,
    with_quarantine_id,
)
from turnout.registry.supersede import (
    count_superseded,
    latest_supersession,
    note_superseded,
    remove_known_rows,
    remove_present_rows,
    supersede,
    supersede_unlisted_results,
)

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

    import duckdb

    from turnout.registry.generation import DataFile

ONE_FILE_TABLES = (*WHOLE_TABLES, "runs", "supersedes")
INTERNAL_TABLES = ("quarantine", "results", "runs", "supersedes")
PENDING = "pending"
# A section with measurements stays in the table if the configuration drops it or never named it, because charts and
# events refer to it. ``left_layout`` marks a section that was in the configuration before.
SECTIONS_SQL = """
with given as (select * exclude (_unit, _row, _year) replace (false as left_layout) from new_sections),
left_over as (
    select * replace (left_layout or (panel is not null and exists (from given)) as left_layout)
    from old_sections anti join given using (section_id)
),
kept as (from given union all by name from left_over),
measured as (select section_id, turnout_id from new_models union select section_id, turnout_id from new_modes
    union select section_id, turnout_id from new_passage_fits)
from kept union all by name
select section_id, turnout_id, split_part(section_id, '/', -1) as label from measured anti join kept using (section_id)
"""


@dataclass(frozen=True)
class RegistrationResult:
    """Result of ``register``. ``rows`` are the numbers of new rows by table, ``faults`` the unreadable batches."""

    run_id: str | None
    generation: int
    n_units: int = 0
    rows: Mapping[str, int] = field(default_factory=dict)
    n_rejected: int = 0
    n_superseded: int = 0
    faults: Mapping[str, str] = field(default_factory=dict)


class Registration:
    """Takes units in chunks, rejects rows that break a rule, and publishes all at once.

    Without an index, rows with the same key are not rejected; ``has_duplicates`` tells whether there are any.
    """

    def __init__(self, root: Path, before: Generation, is_indexed: bool = True) -> None:
        self.root, self.before, self.is_indexed = root, before, is_indexed
        self.lost_duplicates = False
        self.result_ids: list[str] = []
        self.n_rejected = self.n_bad = 0
        self.filled = {"results", "runs", "supersedes"}  # tables that may have new rows
        self.whole: set[str] = set()
        self.replaced: set[str] = set()

    @cached_property
    def con(self) -> duckdb.DuckDBPyConnection:
        """Connection with the staging tables and the views of the live rows; a night without news needs none."""
        con = connect(temp_directory=str(self.root / ".spill"))
        limit_memory(con)  # a second thread would take more CPU time, too
        create_staging(con, self.is_indexed)
        for table in tables():
            con.execute(f"create view old_{table} as {read_live(con, self.root, table, self.before.of(table))}")
        note_superseded(con)
        return con

    def take(self, arrivals: list[Arrival]) -> None:
        """Admit those units of a chunk whose result is not live already.

        Parameters
        ----------
        arrivals : list of Arrival
            Units of a chunk.
        """
        arrivals = self._select_changed(arrivals)
        # a whole table without a change is not in the staging tables and stays as it is
        self.replaced |= self.whole & {table for a in arrivals for table in a.tables}
        if not arrivals:
            return
        note_arrivals(self.con, arrivals)
        by_index = {a.index: a for a in arrivals}
        quarantine = {a.index: [r for r in a.tables.get("quarantine", ())] for a in arrivals}
        rejected_rows = [
            _unknown_table(a, t) for a in arrivals for t in sorted(a.tables.keys() - tables().keys()) if a.tables[t]
        ]
        arrived = set[str]().union(*(a.tables for a in arrivals))
        self.filled |= arrived | {"quarantine"}
        for table in tables():
            if table not in INTERNAL_TABLES and table in arrived:
                gathered, untyped = gather(table, arrivals)
                rejected_rows += untyped + admit(self.con, table, gathered, PENDING)
        self._note_duplicates({r.table for r in rejected_rows})
        reject_orphans(self.con, rejected_rows, by_index)
        for rejected in rejected_rows:
            quarantine[rejected.unit].append(quarantine_of(rejected, by_index[rejected.unit]))
        self._admit_quarantine(arrivals, quarantine)
        for arrival in arrivals:
            arrival.tables = {"results": [_result_row(arrival)]}
        admit(self.con, "results", gather("results", arrivals)[0], PENDING)
        self.n_rejected += len(rejected_rows)
        self.n_bad += sum(bool(rows) for rows in quarantine.values())
        self.result_ids += [a.result_id for a in arrivals]

    def replace_whole(self, names: Iterable[str]) -> None:
        """Name the small tables of which all rows are replaced.

        Parameters
        ----------
        names : iterable of str
            Names of tables; those that are not replaced as a whole are ignored.
        """
        self.whole |= set(names) & set(WHOLE_TABLES)

    def finish(self, consumed: list[str], faults: dict[str, str], run_info: dict) -> RegistrationResult:
        """Write the files and publish them; without new results, only complete what a killed run left unfinished.

        Parameters
        ----------
        consumed : list of str
            Tokens of all batches that are registered now.
        faults : dict
            Reasons of the batches that could not be read, by path.
        run_info : dict
            Columns ``code_version``, ``config_hash`` and ``started_at_utc`` of the run.

        Returns
        -------
        RegistrationResult
            Numbers of units, rows and rejected rows.

        Raises
        ------
        RegistryError
            When a file cannot be written; then nothing is changed.
        """
        before = self.before
        if not self.result_ids and not before.incomplete:
            if consumed != before.consumed or not (self.root / GENERATION_FILE).exists():
                commit(self.root, replace(before, consumed=consumed))
            if is_behind(self.root, before):
                build_database(self.root, before)
            return RegistrationResult(None, before.number, faults=faults)
        number = before.number + 1
        run_id = self._run_id(number)
        stored = {table for table in tables() if before.of(table)}
        n_superseded = supersede(self.con, number, run_id, self.filled, stored)
        if before.incomplete:
            n_superseded += supersede_unlisted_results(self.con, number, run_id)
        if before.incomplete:
            remove_present_rows(self.con)
        else:
            remove_known_rows(self.con, self.filled)
        self._note_run(run_id, run_info)
        now, rows = self._write(run_id, number)
        if n_superseded:
            now.files = self._count_superseded(now.files)
        now.consumed = consumed
        self.con.close()  # the rows are written: their memory is free for the catalogue
        publish(self.root, now)
        return RegistrationResult(run_id, number, len(self.result_ids), rows, self.n_rejected, n_superseded, faults)

    def has_duplicates(self) -> bool:
        """Whether rows that were taken have the same key, so that they must be taken again with an index."""
        if self.is_indexed or not self.result_ids:
            return False
        return self.lost_duplicates or has_duplicate_keys(self.con, sorted(self.filled & tables().keys()))

    def _note_duplicates(self, rejected: set[str]) -> None:
        """Search the tables whose rows are about to be removed with their parent, and with them a duplicate."""
        children = {child for parent in rejected & CHILDREN.keys() for child in CHILDREN[parent][1]}
        if children and not self.is_indexed and not self.lost_duplicates:
            self.lost_duplicates = has_duplicate_keys(self.con, sorted(children))

    def _select_changed(self, arrivals: list[Arrival]) -> list[Arrival]:
        # a result that is live may have lost rows
        if self.before.incomplete or not arrivals or not self.before.of("results"):
            return arrivals
        offered_ids = arrow_table({"result_id": arrow_array([a.result_id for a in arrivals], pa.string())})
        self.con.register("_asked", offered_ids)
        live = self.con.execute(
            "select result_id from old_results semi join _asked using (result_id) anti join dead on result_id = old_id"
        ).fetchall()
        self.con.unregister("_asked")
        live_ids = {r for (r,) in live}
        return [a for a in arrivals if a.result_id not in live_ids]

    def _admit_quarantine(self, arrivals: list[Arrival], quarantine: Mapping[int, list[dict]]) -> None:
        """Admit quarantine rows with their ids; a rejected one is replaced by a row about its rejection."""
        by_index = {a.index: a for a in arrivals}
        for arrival in arrivals:
            arrival.tables["quarantine"] = _by_id(quarantine[arrival.index], arrival.unit)
        gathered, rejected_rows = gather("quarantine", arrivals)
        rejected_rows += admit(self.con, "quarantine", gathered, PENDING)
        replacements: dict[int, list[dict]] = {}
        for rejected in rejected_rows:
            replacements.setdefault(rejected.unit, []).append(quarantine_of(rejected, by_index[rejected.unit]))
        wrong_arrivals = [by_index[i] for i in sorted(replacements)]
        for arrival in wrong_arrivals:
            arrival.tables["quarantine"] = _by_id(replacements[arrival.index], arrival.unit)
        admit(self.con, "quarantine", gather("quarantine", wrong_arrivals)[0], PENDING)
        self.n_rejected += len(rejected_rows)

    def _run_id(self, number: int) -> str:
        run_id = content_id("run", sorted(self.result_ids))
        if self.con.execute("select count(*) from old_runs where run_id = ?", [run_id]).fetchall()[0][0]:
            return content_id(run_id, number)
        return run_id

    def _note_run(self, run_id: str, run_info: dict[str, Any]) -> None:
        """Enter the run in ``runs``, the only table with the time of day."""
        row = run_info | {
            "run_id": run_id, "ended_at_utc": datetime.now(UTC).replace(tzinfo=None), "host": platform.node(),
            "n_ok": len(self.result_ids) - self.n_bad, "n_quarantined": self.n_bad,
        }  # fmt: skip
        columns = ", ".join(row)
        marks = ", ".join("?" for _ in row)
        self.con.execute(f"insert into new_runs ({columns}, _year) values ({marks}, 0)", list(row.values()))

    def _write(self, run_id: str, number: int) -> tuple[Generation, dict[str, int]]:
        """Write one file per table and year; returns the new generation and the number of rows by table."""
        files, retired = list(self.before.files), list(self.before.retired)
        rows: dict[str, int] = {}
        schemas = dict(self.before.schemas)
        for table in tables():
            for year, select in self._selects(table):
                prefix = "all" if table in WHOLE_TABLES else f"batch-{run_id[:12]}"
                written = write_sorted(self.con, self.root, table, year, _with_run_id(table, select, run_id), prefix)
                if table in WHOLE_TABLES:
                    keep = written.path if written else None
                    retired += [(f.path, number) for f in files if f.table == table and f.path != keep]
                    files = [f for f in files if f.table != table]
                if written:
                    files.append(written)
                    rows[table] = rows.get(table, 0) + written.rows
                    schemas[written.schema] = schema_of(table)
        files.sort(key=lambda f: f.path)
        return Generation(number, files, retired, schemas), rows

    def _count_superseded(self, files: list[DataFile]) -> list[DataFile]:
        self.con.execute(f"create temp table superseded as {latest_supersession('old_supersedes', 'new_supersedes')}")
        return count_superseded(self.con, self.root, files)

    def _selects(self, table: str) -> list[tuple[int | None, str]]:
        """(year, SELECT) of every file to be written for a table."""
        if table == "sections":
            return [(None, SECTIONS_SQL)]
        if table not in self.filled:
            return []
        if table in WHOLE_TABLES:
            n_new = self.con.execute(f"select count(*) from new_{table}").fetchall()[0][0]
            if table in self.replaced:
                return [(None, f"select * exclude (_unit, _row, _year) from new_{table}")]
            keys = ", ".join(key(table))
            unchanged = f"select * from old_{table} anti join new_{table} using ({keys})"
            new = f"select * exclude (_unit, _row, _year) from new_{table}"
            return [(None, f"{unchanged} union all by name {new}")] if n_new else []
        years = self.con.execute(f"select distinct _year from new_{table} order by 1").fetchall()
        if table in ONE_FILE_TABLES:
            return [(None, f"select * from new_{table}")] if years else []
        return [(year, f"select * from new_{table} where _year = {year}") for (year,) in years]


def _with_run_id(table: str, select: str, run_id: str) -> str:
    if not any(c.name == "run_id" for c in tables()[table]):
        return select
    return f"select * replace ({literal(run_id)} as run_id) from ({select})"


def _by_id(rows: list[dict], unit: str) -> list[dict]:
    rows_by_id = {row["quarantine_id"]: row for row in (with_quarantine_id(row, unit) for row in rows)}
    return [rows_by_id[i] for i in sorted(rows_by_id)]


def _unknown_table(arrival: Arrival, table: str) -> RejectedRow:
    return RejectedRow(arrival.index, table, 0, "any", f"a table {table!r}", "a table of columns.csv")


def _result_row(arrival: Arrival) -> dict:
    models = arrival.tables.get("models") or [{}]
    config_hash = models[0].get("config_hash") if isinstance(models[0], dict) else None
    return {
        "unit_id": arrival.unit, "turnout_id": arrival.turnout, "kind": arrival.kind, "label": arrival.label,
        "unit_key": arrival.key, "code_version": arrival.algo,
        "config_hash": config_hash if isinstance(config_hash, str) else None,
        "n_rows": sum(len(rows) for rows in arrival.tables.values()),
    }  # fmt: skip
