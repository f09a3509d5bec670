"""The views of the registry over frames in memory, for a look without a registry and for tests."""

import duckdb
import pyarrow as pa

from turnout.registry.arrow_types import arrow_schema
from turnout.registry.schema import tables
from turnout.registry.view_texts import view_files
from turnout.trend.tables import arrow_rows
from turnout.trend.times import days, timestamps

NAMES = (
    "students_t", "campaign_weight", "epochs", "resonance_drift",
    "passage_values", "chart_values", "recursive_modes", "mode_residuals",
    "cusum", "change_since_event", "maintenance_effect",
    "chart_status_at", "unusable", "cannot_see", "was_said", "in_service", "time_to_threshold",
    "is_below_target", "stiffness_words", "damping_charts", "chart_states", "worklist",
)  # fmt: skip


def connect_views(frames, newest, rounded=True) -> duckdb.DuckDBPyConnection:
    """DuckDB in memory with the trend's views over ``frames``, a mapping of table to DataFrame.

    Tables that are not given are empty; ``modes`` stands for itself and for ``modes_current``. ``newest`` is the
    time of the newest measurement, on the day after which all this was put together.
    """
    con = duckdb.connect(":memory:", config={"autoinstall_known_extensions": False, "autoload_known_extensions": False})
    for table in tables():
        if table in frames:
            con.register(table, arrow_rows(table, frames[table], rounded))
        else:
            con.register(table, pa.Table.from_pylist([], schema=arrow_schema(table)))
    stamp = timestamps(days([newest]))[0]
    con.execute(f"create macro newest_measurement() as timestamp '{stamp}'")
    con.execute("create macro published_at() as date_trunc('day', newest_measurement()) + interval 1 day")
    for table in ("models", "modes", "impacts", "passages", "passage_fits"):
        con.execute(f"create view {table}_current as select * from {table}")
    con.execute("create view quarantine_open as select *, false as is_remark from quarantine")
    con.execute("create view findings_current as select * from mismatch_findings")
    for name in view_files():
        if name in NAMES:
            con.execute(view_files()[name])
    return con
