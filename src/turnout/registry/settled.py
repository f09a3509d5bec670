"""Which files hold rows that no longer count: the others are read without looking each row up.

Looking up 29 million ids costs more than most questions. So each file of the large tables knows how many of its rows
are superseded; compaction parts the two kinds, and a file in which nothing counts is not read at all.
"""

from dataclasses import replace
from pathlib import Path

import duckdb

from turnout.registry.columns import file_literal, names
from turnout.registry.generation import DataFile
from turnout.registry.parquet import read_live

# The large tables, and the ids by which a row of them can be superseded.
LARGE = {"modes": ("model_id",), "impact_modes": ("model_id",), "passage_fits": ("passage_id", "model_id")}


def dead_rows(table: str, alias: str = "t") -> str:
    """SQL condition: the row is superseded, by the ids in the table or view ``superseded``."""
    return " or ".join(f"{alias}.{i} in (select old_id from superseded)" for i in LARGE[table])


def with_dead(con: duckdb.DuckDBPyConnection, root: Path, files: list[DataFile]) -> list[DataFile]:
    """The files with the number of their rows that are superseded, by the table ``superseded`` of ``con``."""
    counted: dict[str, int] = {}
    for table in LARGE:
        paths = {str(root / f.path): f.path for f in files if f.table == table}
        if paths:
            listed = ", ".join(map(file_literal, paths))
            ids = ", ".join(LARGE[table])
            sql = f"select {ids}, filename from read_parquet([{listed}], filename = true, union_by_name = true)"
            rows = con.execute(
                f"select filename, count(*) from ({sql}) t where {dead_rows(table)} group by 1"
            ).fetchall()
            counted |= {paths[name]: count for name, count in rows}
    return [replace(f, dead=counted.get(f.path, 0)) if f.table in LARGE else f for f in files]


def create_parts(con: duckdb.DuckDBPyConnection, root: Path, table: str, files: list[DataFile]) -> None:
    """Views ``<table>_settled`` of the files in which every row counts, ``<table>_touched`` of those where some do."""
    settled = [f for f in files if f.dead == 0]
    touched = [f for f in files if 0 < f.dead < f.rows]
    for part, chosen in (("settled", settled), ("touched", touched)):
        con.execute(f"create view {table}_{part} as {read_live(con, root, table, chosen)}")


def halves(table: str, select: str) -> tuple[str, str]:
    """SELECTs of the rows that count and of those that do not."""
    columns = ", ".join(f't."{n}"' for n in names(table))
    return tuple(f"select {columns} from ({select}) t where {sign} ({dead_rows(table)})" for sign in ("not", ""))  # type: ignore[return-value]
