"""Registry of a network for the benchmarks: 3,500 turnouts x 8 sections x 2 resonances, weekly for ten years.

Nine complete years are compacted and the tenth has one batch a week, as in daily use.
"""

from pathlib import Path

from turnout.registry.connection import connect
from turnout.registry.database import build_database
from turnout.registry.generation import Generation, commit, schema_of
from turnout.registry.parquet import read_live, write_sorted
from turnout.registry.schema import names, tables
from turnout.registry.supersede import count_superseded, latest_supersession

WEEKS, WEEKS_A_YEAR, FIRST = 520, 52, "2016-01-04 10:00:00"
# Uniform numbers from a hash and normal numbers from two of them: the same rows on every machine.
MACROS = """
create macro uniform(a, b) as (hash(a, b) % 1000000007 + 0.5) / 1000000007.0;
create macro normal(a, b) as sqrt(-2 * ln(uniform(a, b))) * cos(2 * pi() * uniform(b, a || 'x'));
"""
MODES = """
with grid as (
    select t.t, s.s, w.w, b.band, printf('t%04d', t.t) as turnout_id, printf('t%04d/S%d', t.t, s.s) as section_id,
        timestamp '{first}' + to_days((7 * w.w)::integer) as measured_at_utc,
        10 - 15 * cos(2 * pi() * w.w / 52.18) + 6 * normal('T' || t.t, w.w) as temperature
    from range({turnouts}) t(t), range(8) s(s), range({from_week}, {to_week}) w(w),
        (values ('ballast'), ('railpad')) b(band)
)
select md5(section_id || w) as model_id, band, turnout_id, section_id, measured_at_utc, 'joint' as method,
    if(band = 'ballast', 130 + 40 * uniform(section_id, 1), 420 + 120 * uniform(section_id, 2)) * (1
        - 0.0015 * (temperature - 10) + 0.006 * normal(section_id || band, w)
        - if(hash(section_id, band) % 50 = 0, 0.03 * w / 52.18, 0)) as frequency_hz,
    if(band = 'ballast', 0.5, 1.2) * (0.8 + 0.4 * uniform(section_id || band || 'e', w)) as frequency_se_hz,
    if(band = 'ballast', 2.0, 5.0) * (0.8 + 0.4 * uniform(section_id || band || 'd', w)) as frequency_sd_hz,
    0.08 * (1 + 0.05 * normal(section_id || band || 'z', w)) as damping_ratio,
    0.002 * (0.8 + 0.4 * uniform(section_id || band || 'y', w)) as damping_se,
    temperature as rail_temperature_c, (24 + hash(section_id, w) % 7)::integer as n_impacts, 'hammer' as source,
    md5('run' || {run}) as run_id
from grid
"""
SMALL = {
    "turnouts": "select printf('t%04d', t) as turnout_id, 'l' as layout, 'h' as config_hash "
    "from range({turnouts}) r(t)",
    "sections": "select printf('t%04d/S%d', t, s) as section_id, printf('t%04d', t) as turnout_id, 'S' || s as label, "
    "'CP' as panel, 'main' as track, 5.0 * s as position_m from range({turnouts}) r(t), range(8) q(s)",
    # five events a turnout, the tamping in different years, so that most charts have an epoch
    "events": "select md5(t || '-' || k) as event_id, printf('t%04d', t) as turnout_id, null as section_id, "
    "timestamp '{first}' + to_days((300 + (hash(t, k) % 3000))::integer) as event_at_utc, "
    "['tamping', 'grinding', 'pad_exchange', 'other', 'grinding'][k] as kind, k = 1 as resets_ballast, "
    "k = 3 as resets_railpad, null as note from range({turnouts}) r(t), range(1, 6) q(k)",
    # 1,000 models of the last year computed again; what was superseded before, compaction has parted from the rest
    "supersedes": "select md5(printf('t%04d/S%d', hash(i) % {turnouts}, hash(i, 1) % 8) || (468 + i % 52)) as old_id, "
    "1 as generation, null as new_id, 'model' as kind, "
    "'new_code' as reason, 'r' as run_id from range(1000) r(i)",
}


def make_network(root: Path, turnouts: int = 3500) -> Generation:
    """Write the registry with its own writer; about 0.75 GB for the whole network."""
    con = connect(temp_directory=str(root / ".spill"))
    con.execute(MACROS)
    files = []
    for year in range(WEEKS // WEEKS_A_YEAR - 1):
        select = _modes(turnouts, WEEKS_A_YEAR * year, WEEKS_A_YEAR * (year + 1), f"{year}")
        files.append(write_sorted(con, root, "modes", 2016 + year, select, "compact", True))
    for week in range(WEEKS - WEEKS_A_YEAR, WEEKS):
        year = 2016 + WEEKS // WEEKS_A_YEAR - 1
        files.append(
            write_sorted(con, root, "modes", year, _modes(turnouts, week, week + 1, f"{week}"), f"batch-{week}")
        )
    for table, sql in SMALL.items():
        files.append(
            write_sorted(
                con, root, table, None, _typed_select(table, sql.format(turnouts=turnouts, first=FIRST)), "all"
            )
        )
    con.execute(
        "create view said as " + read_live(con, root, "supersedes", [f for f in files if f.table == "supersedes"])
    )
    con.execute(f"create table superseded as {latest_supersession('said')}")
    files = count_superseded(con, root, files)
    schemas = {f.schema: schema_of(f.table) for f in files}
    generation = Generation(1, sorted(files, key=lambda f: f.path), [], schemas)
    commit(root, generation)
    build_database(root, generation)
    return generation


def _modes(turnouts, from_week, to_week, run):
    sql = MODES.format(turnouts=turnouts, first=FIRST, from_week=from_week, to_week=to_week, run=run)
    return _typed_select("modes", sql)


def _typed_select(table: str, sql: str) -> str:
    """SQL of the rows as the registration writes them: typed, rounded, absent columns NULL."""
    connection = connect()
    connection.execute(MACROS)
    present = [r[0] for r in connection.execute(f"describe {sql}").fetchall()]
    columns = [c for c in tables()[table]]
    assert set(present) <= set(names(table))
    expressions = [
        f'{c.rounded}::{c.type} as "{c.name}"' if c.name in present else f'null::{c.type} as "{c.name}"'
        for c in columns
    ]
    return f"select {', '.join(expressions)} from ({sql})"
