"""When the newest measurement that counts was made: a date that was corrected no longer does."""

from pathlib import Path

import duckdb

from turnout.registry.columns import file_literal, time_column
from turnout.registry.generation import Generation
from turnout.registry.parquet import MEASURED
from turnout.registry.supersede import last_word


def newest_that_counts(con: duckdb.DuckDBPyConnection, root: Path, generation: Generation) -> str | None:
    """ISO time of the newest measurement that nothing took back, None without any.

    Files are opened from the one that reaches furthest on, until no other can hold a later time.
    """
    con.execute(f"create or replace temp table no_longer as {last_word('supersedes')}")
    newest = None
    for file in sorted((f for f in generation.files if f.newest), key=lambda f: str(f.newest), reverse=True):
        if newest is not None and str(file.newest) <= newest:
            break
        source = f"read_parquet({file_literal(root / file.path)})"
        counts = f"{MEASURED[file.table]} not in (select old_id from no_longer)"
        found = con.execute(f"select max({time_column(file.table)})::varchar from {source} where {counts}").fetchall()
        newest = max(filter(None, (newest, found[0][0])), default=None)
    con.execute("drop table no_longer")
    return newest
