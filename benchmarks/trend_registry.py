"""Registry of simulated modes, for time and memory of the trends. It is made in parts that fit into memory."""

import duckdb
import numpy as np
import pandas as pd

from benchmarks.trend_fleet import Fleet, drift, modes
from turnout.registry.connection import connect
from turnout.registry.database import build_database
from turnout.registry.generation import Generation, commit, load
from turnout.registry.parquet import write_sorted
from turnout.registry.schema import tables

EXTRA = (
    "'joint' as method, null::double as frequency_sd_hz, 0.05 as damping_ratio, null::double as damping_se, "
    "10 as n_impacts, 'r' as run_id"
)
PER_PART = 350


def registry_of_modes(root, turnouts, weeks, holdback=1):
    """Fill ``root`` with two bands of 8 sections per turnout, all but the last ``holdback`` weeks.

    One section of turnout 3 drifts from week 80 on. Returns a function that adds the held-back weeks.
    """
    con = connect(temp_directory=str(root / ".spill"))
    con.execute("set preserve_insertion_order = false")
    for i, first in enumerate(range(0, turnouts, PER_PART)):
        n = min(PER_PART, turnouts - first)
        for band, frequency in (("railpad", 450.0), ("ballast", 150.0)):
            fleet = Fleet(turnouts=n, weeks=weeks, band=band, frequency=frequency, prefix=f"P{i:02d}T")
            which = np.zeros((n, fleet.sections), dtype=bool)
            which[3 % n, 2] = i == 0 and band == "railpad"
            con.register("came", modes(fleet, 1000 * i + len(band), drift(fleet, which, -1.5, 80)))
            make = (
                "insert into mm"
                if con.execute("select count(*) from duckdb_tables()").fetchall()[0][0]
                else "create table mm as"
            )
            con.execute(
                f"{make} select band::varchar as band, turnout_id::varchar as turnout_id, section_id::varchar as "
                "section_id, measured_at_utc, round(frequency_hz, 3) as frequency_hz, frequency_se_hz, "
                "round(rail_temperature_c, 1) as rail_temperature_c, source::varchar as source from came"
            )
            con.unregister("came")
    last = con.execute("select max(measured_at_utc) from mm").fetchall()[0][0] - pd.Timedelta(weeks=holdback)
    rows = f"select md5(section_id || band || measured_at_utc::varchar) as model_id, *, {EXTRA} from mm"
    given = [name for name, *_ in con.execute(f"describe {rows}").fetchall()]
    select = f"select *, {_absent_columns(given)} from ({rows}) where "
    years = con.execute("select distinct year(measured_at_utc) from mm order by 1").fetchall()
    _publish(
        con,
        root,
        [(y, f"{select} year(measured_at_utc) = {y} and measured_at_utc <= '{last}'") for (y,) in years],
        "all",
    )

    def add():
        _publish(con, root, [(years[-1][0], f"{select} measured_at_utc > '{last}'")], "batch-last")
        con.close()

    return add


def small_registry(root, rows, number=1):
    """Write a registry in ``root`` that holds ``rows`` of modes only, with the writer of the registry."""
    rows = rows.assign(model_id=[f"m{i}" for i in range(len(rows))], n_impacts=10, run_id="r", method="joint")
    rows = rows if "damping_ratio" in rows else rows.assign(damping_ratio=0.05)
    with duckdb.connect() as con:
        con.register("came", rows.astype({"turnout_id": str, "section_id": str, "band": str, "source": str}))
        con.execute(f"create view all_rows as select *, {_absent_columns(rows.columns)} from came")
        years = sorted(rows["measured_at_utc"].dt.year.unique())
        select = "select * from all_rows where year(measured_at_utc) = {}"
        files = [write_sorted(con, root, "modes", int(y), select.format(y), f"batch-{number}") for y in years]
    other_files = [f for f in load(root).files if f.table != "modes"]
    generation = Generation(number=number, files=sorted([*other_files, *files], key=lambda f: f.path))
    commit(root, generation)
    build_database(root, generation)


def _absent_columns(given):
    """Columns of the table ``modes`` that the rows lack, as NULL."""
    return ", ".join(f"null::{c.type} as {c.name}" for c in tables()["modes"] if c.name not in given)


def _publish(con, root, selects, prefix):
    before = load(root)
    files = [f for f in (write_sorted(con, root, "modes", y, s, prefix) for y, s in selects) if f]
    generation = Generation(before.number + 1, sorted([*before.files, *files], key=lambda f: f.path))
    commit(root, generation)
    build_database(root, generation)
