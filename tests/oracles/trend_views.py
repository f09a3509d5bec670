"""The views of the registry over frames in memory, for use without a registry and for tests."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

import duckdb
import pyarrow as pa

from turnout.registry.arrow_types import arrow_schema
from turnout.registry.schema import tables
from turnout.registry.view_texts import view_files
from turnout.trend.tables import arrow_rows
from turnout.trend.times import days, timestamps

NAMES = (
    "students_t", "campaign_name", "campaign_weight", "epochs", "resonance_drift",
    "passage_trains", "passage_values", "chart_values", "recursive_modes", "mode_residuals",
    "cusum", "change_since_event", "maintenance_effect",
    "chart_status_at", "unusable", "cannot_see", "acknowledgement_counts", "in_service", "time_to_threshold",
    "is_below_target", "stiffness_words", "half_band_pct", "damping_charts", "chart_states", "worklist",
)  # fmt: skip


SETTINGS = {"autoinstall_known_extensions": False, "autoload_known_extensions": False}


@cache
def _empty_database() -> Path:
    """File with all tables, empty, and the views over them, made once per process: creating a view binds it."""
    folder = tempfile.mkdtemp(prefix="trend-views-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    file = Path(folder) / "views.duckdb"
    with duckdb.connect(str(file), config=SETTINGS) as con:
        for table in tables():
            con.register("rows", pa.Table.from_pylist([], schema=arrow_schema(table)))
            con.execute(f"create table {table} as from rows")
        con.unregister("rows")
        con.execute("create macro newest_measurement() as null::timestamp")
        con.execute("create macro published_at() as date_trunc('day', newest_measurement()) + interval 1 day")
        for table in ("models", "modes", "impacts", "passages", "passage_fits"):
            con.execute(f"create view {table}_current as select * from {table}")
        con.execute("create view quarantine_open as select *, false as is_remark from quarantine")
        con.execute("create view findings_current as select * from mismatch_findings")
        for name in view_files():
            if name in NAMES:
                con.execute(view_files()[name])
    return file


def connect_views(frames, newest, rounded=True) -> duckdb.DuckDBPyConnection:
    """DuckDB in memory with the trend's views over ``frames``, a mapping of table to DataFrame.

    Tables that are not given are empty; ``modes`` is also used as ``modes_current``. ``newest`` is the time of the
    newest measurement; the registry counts as computed on the day after it.
    """
    con = duckdb.connect(":memory:", config=SETTINGS)
    con.execute(f"attach '{_empty_database()}' as made (read_only)")
    con.execute("copy from database made to memory")
    con.execute("detach made")
    for table in tables().keys() & frames.keys():
        con.execute(f"drop table {table}")
        con.register(table, arrow_rows(table, frames[table], rounded))
    stamp = timestamps(days([newest]))[0]
    con.execute(f"create or replace macro newest_measurement() as timestamp '{stamp}'")
    return con
