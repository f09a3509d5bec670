"""Recompute all charts of the registry after a registration, in groups of turnouts that fit into memory.

Rows of ``charts`` are stored by year, so only years with a change are written again.
"""

from __future__ import annotations

import hashlib
import logging
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from turnout.registry.connection import limit_memory
from turnout.registry.database import open_registry
from turnout.registry.derived_tables import publish
from turnout.registry.generation import load
from turnout.registry.schema import names
from turnout.trend.alarms import PREVIOUS_ALARMS, Flag, candidates, describe_flagged, with_withdrawn
from turnout.trend.cusum import finish
from turnout.trend.evaluation import shared_autocorrelation
from turnout.trend.panel import CHART_KEYS, lay_out
from turnout.trend.preparation import prepare
from turnout.trend.quantities import DAMPING_ENDING, DAMPING_SCALE, RESONANCES
from turnout.trend.states import chart_status
from turnout.trend.tables import alarm_rows, arrow_rows, baseline_rows, chart_rows
from turnout.trend.times import SECONDS_PER_DAY, believable_times, days, timestamps

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from datetime import date
    from typing import Any

    import duckdb

    from turnout.config.settings.trend import TrendSettings
    from turnout.registry.generation import Generation
    from turnout.trend.panel import Panel
    from turnout.trend.preparation import Prepared


def split_by_year(rows: pa.Table) -> dict[int, pa.Table]:
    """The rows of each year of ``measured_at_utc``, in their order.

    Parameters
    ----------
    rows : pa.Table
        Arrow table with this column.

    Returns
    -------
    dict
        Rows by year.

    Examples
    --------
    >>> when = pa.array([0, 40_000_000_000_000], pa.timestamp("us"))
    >>> {year: part.num_rows for year, part in split_by_year(pa.table({"measured_at_utc": when})).items()}
    {1970: 1, 1971: 1}
    """
    year = pc.year(rows.column("measured_at_utc"))
    return {int(y.as_py()): rows.filter(pc.equal(year, y)) for y in sorted(pc.unique(year), key=lambda y: y.as_py())}


def digest(tables: Sequence[pa.Table], *settings: Any) -> str:
    """Hash of the content of concatenated Arrow tables, however they are split, and of the ``settings``.

    Parameters
    ----------
    tables : sequence of Table
        Tables of one schema.
    *settings : object
        Anything whose ``repr`` shall count.

    Returns
    -------
    str
        32 hexadecimal characters.

    Examples
    --------
    >>> whole, other = pa.table({"z": [1.0, 2.0]}), pa.table({"z": [1.0, 3.0]})
    >>> digest([whole]) == digest([whole.slice(0, 1), whole.slice(1)]), digest([whole]) == digest([other])
    (True, False)
    """
    columns = [hashlib.blake2b(digest_size=16) for _ in (tables[0].columns if tables else ())]
    for table in tables:
        for column_hash, column in zip(columns, table.columns):
            for chunk in column.chunks:
                column_hash.update(_plain(chunk))
    whole = hashlib.blake2b(repr(settings).encode(), digest_size=16)
    for column_hash in columns:
        whole.update(column_hash.digest())
    return whole.hexdigest()


def _plain(chunk: pa.Array) -> memoryview:
    """Bytes of the values: NULL as NaN or 0, text as its CRC-32."""
    if pa.types.is_string(chunk.type) or pa.types.is_large_string(chunk.type):
        chunk = chunk.dictionary_encode()
    if pa.types.is_dictionary(chunk.type):
        texts = chunk.dictionary.to_pylist()
        names = np.array([zlib.crc32(str(text).encode()) for text in texts], dtype=np.uint32)
        return np.ascontiguousarray(names[chunk.indices.to_numpy(zero_copy_only=False)]).view(np.uint8).data
    if chunk.null_count:
        chunk = chunk.fill_null(float("nan") if pa.types.is_floating(chunk.type) else 0)
    return np.ascontiguousarray(chunk.to_numpy(zero_copy_only=False)).view(np.uint8).data


CELLS_PER_PART = 1_500_000  # values per group of turnouts that is evaluated at once; limits the memory
HAMMER_MODES_SQL = (
    "select turnout_id, section_id, band, source, measured_at_utc, frequency_hz, frequency_se_hz, rail_temperature_c "
    "from modes_current where source = 'hammer' and coalesce(method, 'joint') = 'joint'"
)
# Damping ratios in percent of critical damping. One without a standard error is not charted.
HAMMER_DAMPING_SQL = (
    f"select turnout_id, section_id, band || '{DAMPING_ENDING}' as band, source, measured_at_utc, "
    f"{DAMPING_SCALE} * damping_ratio as frequency_hz, {DAMPING_SCALE} * damping_se as frequency_se_hz, "
    "rail_temperature_c "
    "from modes_current where source = 'hammer' and coalesce(method, 'joint') = 'joint' and damping_se is not null "
    f"and band in {RESONANCES}"
)


@dataclass(frozen=True)
class TrendUpdate:
    """Result of an update: rows by table, years of ``charts`` written, registry ``generation``.

    ``newest`` is the time of the newest plausible campaign; ``digests`` are hash of the rows and file, by year.
    """

    rows: dict[str, int]
    written: tuple[int, ...]
    generation: int
    newest: datetime | None
    digests: dict[str, str]


def update(
    registry_dir: str | Path,
    settings: TrendSettings,
    digests: Mapping[str, str] | None = None,
    as_of: Any = None,
    acknowledgements: Sequence[Mapping[str, Any]] | None = None,
    day: date | str | None = None,
) -> TrendUpdate:
    """Compute every chart of a registry and replace the tables of charts, baselines, alarms and states.

    Parameters
    ----------
    registry_dir : str or Path
        Folder of the registry.
    settings : TrendSettings
        Settings of the charts.
    digests : dict, optional
        Those of the last update: an unchanged year of ``charts``, in the same file, is not written again.
    as_of : time, optional
        Evaluate as of this time: newer campaigns and later events are ignored. By default everything counts up to the
        newest campaign of the fleet with a plausible time.
    acknowledgements : list of dict, optional
        All rows of the table of that name; None leaves it alone.
    day : date or str, optional
        The present day, by default that of this machine in UTC. Events planned for later do not reset charts yet, and
        later campaigns are implausible.

    Returns
    -------
    TrendUpdate
        What was written.
    """
    day_end = np.floor(days([datetime.now(UTC).replace(tzinfo=None) if day is None else day])[0]) + 1.0
    with open_registry(registry_dir) as con:
        limit_memory(con)
        events = con.execute("select * from events order by event_at_utc, event_id").df()
        groups, newest = _chart_groups(con, settings, as_of, day_end)
        at = days(events["event_at_utc"])
        events = events[(at <= newest) | ((as_of is None) & (at < day_end))]
        previous_alarms = con.execute(PREVIOUS_ALARMS if as_of is None else f"from ({PREVIOUS_ALARMS}) limit 0").df()
        prepared = [prepare(_panel(con, block, newest, events, settings), events, settings) for block in groups]
    years, tables = _tables(prepared, settings, lambda alarms: with_withdrawn(alarms, previous_alarms, newest))
    rows = {name: table.num_rows for name, table in tables.items()}
    rows["charts"] = sum(block.num_rows for year_tables in years.values() for block in year_tables)
    digests_now = {str(year): digest(year_tables, names("charts")) for year, year_tables in years.items()}
    live = _chart_files(load(Path(registry_dir)))  # after a restored backup these differ from those of the last update
    same = {
        year
        for year in digests_now
        if year in live and (digests or {}).get(year) == f"{digests_now[year]} {live[year]}"
    }
    changed = [block for year, year_tables in sorted(years.items()) if str(year) not in same for block in year_tables]
    tables["charts"] = (
        pa.concat_tables(changed, promote_options="permissive") if changed else arrow_rows("charts", pd.DataFrame())
    )
    written = tuple(sorted(year for year in years if str(year) not in same))
    if acknowledgements is not None:
        tables["acknowledgements"] = arrow_rows("acknowledgements", pd.DataFrame(acknowledgements))
    years.clear()
    changed.clear()
    published = publish(Path(registry_dir), tables, keep={"charts": {int(year) for year in same}})
    stamp = None if not np.isfinite(newest) else timestamps([newest])[0].item()
    digests_now = {
        year: f"{content_hash} {_chart_files(published)[year]}" for year, content_hash in digests_now.items()
    }
    result = TrendUpdate(rows, written, published.number, stamp, digests_now)
    logging.getLogger("turnout.trend").info("%s, years of charts written: %s, newest %s", rows, written, stamp)
    return result


def _chart_files(generation: Generation) -> dict[str, str]:
    """Path of the file of each year of ``charts``; it ends with the hash of the content."""
    return {str(f.year): f.path for f in generation.of("charts")}


def _tables(
    prepared: list[Prepared], settings: TrendSettings, account: Callable[[pd.DataFrame], pd.DataFrame]
) -> tuple[dict[int, list[pa.Table]], dict[str, pa.Table]]:
    """Arrow tables of ``charts`` by year, and those of the other derived tables; ``account`` completes the alarms.

    ``prepared`` is emptied meanwhile, to free the arrays of each finished group.
    """
    frames: dict[str, list[pd.DataFrame]] = {name: [] for name in ("chart_status", "baselines", "alarms")}
    years: dict[int, list[pa.Table]] = {}
    flags: dict[int, Flag] = {}
    n_charts = 0
    memory = shared_autocorrelation(prepared)
    while prepared:
        charts = finish(prepared.pop(0), memory.pop(0), settings)
        status = chart_status(charts, settings)
        flags |= {n_charts + i: flag for i, flag in candidates(charts, status, settings).items()}
        n_charts += len(status)
        frames["chart_status"].append(status)
        frames["baselines"].append(baseline_rows(charts, settings))
        frames["alarms"].append(alarm_rows(charts, settings))
        for year, year_rows in split_by_year(arrow_rows("charts", chart_rows(charts), single=True)).items():
            years.setdefault(year, []).append(year_rows)
    joined = {
        name: pd.concat(pieces, ignore_index=True) if pieces else pd.DataFrame() for name, pieces in frames.items()
    }
    joined["alarms"] = account(joined["alarms"])
    if n_charts:
        joined["chart_status"] = describe_flagged(joined["chart_status"], flags, settings)
    return years, {name: arrow_rows(name, frame) for name, frame in joined.items()}


def _chart_groups(
    con: duckdb.DuckDBPyConnection, settings: TrendSettings, as_of: Any, end: float
) -> tuple[list[pd.DataFrame], float]:
    """Charts in groups of whole turnouts, and the newest time that counts; ``end`` is that of the present day. [d]"""
    # values from passages are aggregated once; values from hammer tests are read group by group
    con.execute("create temp table by_trains as select * from passage_values")
    later = "" if as_of is None else f" where measured_at_utc <= timestamp '{timestamps(days([as_of]))[0]}'"
    con.execute(
        f"create temp view charted as select * from ({HAMMER_MODES_SQL} union all {HAMMER_DAMPING_SQL} "
        f"union all select * from by_trains){later}"
    )
    charts = con.execute(
        f"select {', '.join(CHART_KEYS)}, max(measured_at_utc) as newest from charted group by all"
    ).df()
    for name in CHART_KEYS:
        charts[name] = charts[name].astype(object)
    charts = charts.sort_values(CHART_KEYS, ignore_index=True)
    last = days(charts.pop("newest"))
    if as_of is None:
        times = con.execute("select distinct measured_at_utc from charted").df()
        _, newest = believable_times(
            days(times["measured_at_utc"]), settings, _last_believable(charts, last, end + 1.0)
        )
    else:
        newest = days([as_of])[0]
    if charts.empty:
        return [], newest
    rows = con.execute("select turnout_id, count(*) as n from charted group by all order by all").df()
    share = dict(zip(rows["turnout_id"], rows["n"].cumsum() // CELLS_PER_PART))
    number = charts["turnout_id"].map(share)
    return [group.reset_index(drop=True) for _, group in charts.groupby(number, sort=True)], newest


def _last_believable(charts: pd.DataFrame, last: np.ndarray, until: float) -> float:
    """Time [d] after which campaigns are implausible: ``until``, or infinity if most charts have a later campaign.

    Then the clock of this machine is late, or the fleet is simulated. ``last`` are the newest campaigns of the charts.
    [d]
    """
    ahead = last > until
    if 2 * ahead.sum() > len(ahead):
        return np.inf
    if ahead.any():
        message = "campaigns after %s are in the future: shown, not used. Correct the dates of %d charts, first %s"
        where = " ".join(charts.loc[ahead, ["section_id", "band"]].iloc[0])
        logging.getLogger("turnout.trend").warning(message, timestamps([until])[0].item(), ahead.sum(), where)
    return until


def _panel(
    con: duckdb.DuckDBPyConnection, charts: pd.DataFrame, newest: float, events: pd.DataFrame, settings: TrendSettings
) -> Panel:
    """Panel of the turnouts of one group."""
    con.register("_part", charts.assign(chart=np.arange(len(charts), dtype=np.int32)))
    names = ("frequency_hz", "frequency_se_hz", "rail_temperature_c")
    rows = con.execute(
        f"""
        select p.chart, epoch_us(m.measured_at_utc) as us, {", ".join(f"coalesce(m.{n}, 'nan') as {n}" for n in names)}
        from charted m join _part p using (turnout_id, band, source, section_id)
        where m.turnout_id between ? and ?
        """,
        [charts["turnout_id"].iloc[0], charts["turnout_id"].iloc[-1]],
    ).fetchnumpy()
    con.unregister("_part")
    time = np.asarray(rows["us"], dtype=float) / (SECONDS_PER_DAY * 1e6)
    frequency, error, temperature = (np.asarray(rows[n], dtype=float) for n in names)
    return lay_out(charts, np.asarray(rows["chart"]), time, frequency, error, temperature, newest, settings, events)
