"""Convert finished charts into rows of the tables ``charts``, ``baselines`` and ``alarms``.

``arrow_rows`` makes Arrow tables of the registry from them: unknown values are NULL, numbers are rounded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pyarrow as pa
from scipy.special import ndtri

from turnout.registry.arrow_types import arrow_schema
from turnout.registry.schema import tables
from turnout.trend.detectable_change import campaigns_a_year, detectable_in_epoch, spread_in
from turnout.trend.epochs import by_epoch
from turnout.trend.preparation import first_epoch
from turnout.trend.quantities import ACCELERATION, DAMPING_SCALE, is_damping
from turnout.trend.threshold import run_lengths
from turnout.trend.times import timestamps

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings
    from turnout.registry.schema import Column
    from turnout.trend.charts import Charts
    from turnout.trend.preparation import Prepared

TABLE_KEYS = ["turnout_id", "section_id", "band", "source"]
CELL_STATES = np.array(
    ["ok", "baseline", "learning", "alarm_down", "alarm_up", "no_temperature", "not_judged", "wrong_time"]
)
NORMAL_QUANTILE = -float(ndtri(0.025))


def cell_states(charts: Charts) -> np.ndarray:
    """State of every campaign of every chart.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.

    Returns
    -------
    (n_chart, n_campaign) array of int
        Index in ``CELL_STATES``.
    """
    p = charts.prepared
    n_section = len(p.panel.charts)
    no_temperature = np.zeros(charts.z.shape, dtype=bool)
    no_temperature[:n_section] = np.isfinite(p.panel.frequency) & ~np.isfinite(p.values)
    first = p.epoch <= first_epoch(p)[:, None]
    learning = charts.learning | p.aside
    started = p.baseline.complete[:, None] & ~(learning & first)
    return np.select(
        [no_temperature, ~started, learning, ~np.isfinite(charts.z), charts.down_open, charts.up_open],
        [5, 1, 2, 6, 3, 4],
        0,
    ).astype(np.int8)


def is_measured(charts: Charts) -> np.ndarray:
    """Cells with a row: a frequency was measured, or the median of the turnout exists.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.

    Returns
    -------
    (n_chart, n_campaign) array of bool
        True for cells with a row.
    """
    n_section = len(charts.prepared.panel.charts)
    return np.isfinite(np.vstack([charts.prepared.panel.frequency, charts.residual[n_section:]]))


def chart_rows(charts: Charts) -> pd.DataFrame:
    """Table ``charts``: one row per chart and campaign, in the order of the charts, keys as categories.

    The expected band is the 95 % interval of one campaign at its temperature, from the guarded spread of the baseline.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.

    Returns
    -------
    DataFrame
        Rows of the table.
    """
    p = charts.prepared
    n_section = len(p.panel.charts)
    order = p.charts.sort_values(["turnout_id", "section_id", "band", "source"]).index.to_numpy()
    row, campaign = np.nonzero(is_measured(charts)[order])
    chart = order[row]
    cell = chart * p.time.shape[1] + campaign
    section = chart < n_section
    f0 = reference_frequency(p)[chart]

    def section_values(values: np.ndarray) -> np.ndarray:
        """Values of the sections' cells; nan for the whole turnout, whose charts come last."""
        cell_values = np.take(values.ravel(), np.where(section, cell, 0))
        return np.where(section, cell_values, np.nan)

    residual = np.take(charts.residual.ravel(), cell)
    expected = section_values(p.panel.frequency) - f0 * residual / 100.0
    half = NORMAL_QUANTILE * charts.guard[chart] * np.take(charts.sigma.ravel(), cell) * f0 / 100.0
    keys = {k: pd.Categorical.from_codes(*_codes(p.charts[k], chart)) for k in TABLE_KEYS}
    rows = pd.DataFrame(
        keys
        | {
            "measured_at_utc": timestamps(np.take(p.time.ravel(), cell)),
            "epoch": np.take(p.epoch.ravel(), cell).astype(np.int32),
            "rail_temperature_c": section_values(p.panel.temperature),
            "expected_hz": expected,
            "expected_low_hz": expected - half,
            "expected_high_hz": expected + half,
            "residual_pct": residual,
            "z": np.take(charts.z.ravel(), cell),
            "deviation_pct": np.take(charts.deviation.ravel(), cell),
            "cusum_down": np.take(charts.down.ravel(), cell),
            "cusum_up": np.take(charts.up.ravel(), cell),
            "is_sibling": section & np.take(charts.is_sibling.ravel(), np.where(section, cell, 0)),
            "state": pd.Categorical.from_codes(np.take(cell_states(charts).ravel(), cell), CELL_STATES),
        }
    )
    return _with_wrong_times(rows, p.panel.left_out)


def reference_frequency(p: Prepared) -> np.ndarray:
    """f0 of each chart; nan for a whole turnout, and for amplitudes and damping ratios, which are no frequencies.

    Parameters
    ----------
    p : Prepared
        Prepared charts.

    Returns
    -------
    (n_chart,) array of float
        Frequency. [Hz]
    """
    is_frequency = (p.charts["band"] != ACCELERATION) & ~is_damping(p.charts["band"])
    return np.where(is_frequency, p.baseline.frequency, np.nan)


def _with_wrong_times(rows: pd.DataFrame, left_out: pd.DataFrame) -> pd.DataFrame:
    """Add campaigns with an implausible time, without values; keys remain categories."""
    wrong = left_out[(left_out["reason"] == "wrong_time") & left_out["measured_at_utc"].notna()]
    if wrong.empty:
        return rows
    wrong = (
        wrong[[*TABLE_KEYS, "measured_at_utc"]]
        .drop_duplicates()
        .assign(epoch=np.int32(0), is_sibling=False, state="wrong_time")
    )
    for name in (*TABLE_KEYS, "state"):
        categories = rows[name].cat.categories
        categories = categories.append(pd.Index(wrong[name].unique()).difference(categories, sort=True))
        rows[name] = rows[name].cat.set_categories(categories)
        wrong[name] = pd.Categorical(wrong[name], categories=categories)
    combined = pd.concat([rows, wrong], ignore_index=True)
    texts = {name: combined[name].astype(object) for name in TABLE_KEYS[:3]}
    order = pd.DataFrame(texts).sort_values(TABLE_KEYS[:3], kind="stable").index
    return combined.loc[order].reset_index(drop=True)


def _codes(column: pd.Series, chart: np.ndarray) -> tuple[np.ndarray, pd.Index]:
    code, unique = pd.factorize(column)
    return code[chart], pd.Index(unique)


def baseline_rows(charts: Charts, settings: TrendSettings) -> pd.DataFrame:
    """Table ``baselines``: one row per chart and epoch that has a campaign.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    DataFrame
        Rows of the table.
    """
    p = charts.prepared
    _, count = by_epoch(np.zeros(p.time.shape), is_measured(charts), p.epoch, charts.level.shape[1])
    chart, epoch = np.nonzero(count)
    base = p.baseline
    rows = p.charts.iloc[chart][TABLE_KEYS].reset_index(drop=True)
    n_learned = charts.n_learned[chart, epoch]
    later = epoch > first_epoch(p)[chart]
    allowance = charts.allowance[chart] + np.where(later, 1.0 / np.sqrt(np.maximum(n_learned, 1)), 0.0)
    return rows.assign(
        epoch=epoch.astype(np.int32),
        epoch_start_utc=timestamps(p.started[chart, epoch]),
        frequency_hz=reference_frequency(p)[chart],
        damping_ratio=np.where(is_damping(p.charts["band"]), p.baseline.frequency / DAMPING_SCALE, np.nan)[chart],
        acceleration_ms2=np.where(p.charts["band"] == ACCELERATION, p.baseline.frequency, np.nan)[chart],
        rail_temperature_c=base.reference[chart],
        slope_pct_per_c=base.slope[chart],
        slope_se_pct_per_c=base.slope_se[chart],
        curvature_pct_per_c2=base.curvature[chart],
        level_pct=charts.level[chart, epoch],
        sibling_shift_pct=charts.shift[chart, epoch],
        sd_pct=spread_in(charts, chart, epoch),
        sd_alone_pct=p.spread_alone[chart],
        phi=charts.autocorrelation[chart],
        guard=charts.guard[chart],
        allowance=allowance,
        threshold_down=charts.threshold_down[chart],
        threshold_up=charts.threshold_up[chart],
        single_share=settings.single_share,
        outlier_limit=settings.outlier_limit,
        n_baseline=base.count[chart],
        n_learned=n_learned,
        complete=base.complete[chart],
        with_siblings=p.with_siblings[chart],
        detectable_pct=detectable_in_epoch(charts, chart, epoch, allowance, campaigns_a_year(p)[chart], settings),
    )


def alarm_rows(charts: Charts, settings: TrendSettings) -> pd.DataFrame:
    """Table ``alarms``: one row per alarm, open or closed.

    ``began_at_utc`` is the last campaign at which the sum was 0: the change came after it. An alarm closes as stated
    in ``cusum``, or when an event starts a new epoch.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    DataFrame
        Rows of the table, by time.
    """
    frames = [
        _alarms(charts, direction, run_lengths(charts.prepared.charts["band"], direction, settings))
        for direction in ("down", "up")
    ]
    rows = pd.concat(frames, ignore_index=True)
    return rows.sort_values(["raised_at_utc", *TABLE_KEYS, "direction"], kind="stable", ignore_index=True)


def _alarms(charts: Charts, direction: str, run_length: np.ndarray) -> pd.DataFrame:
    p = charts.prepared
    is_open = getattr(charts, f"{direction}_open")
    edge = np.diff(is_open.astype(np.int8), axis=1, prepend=0)
    chart, campaign = np.nonzero(edge > 0)
    closing = np.where(edge < 0, np.arange(is_open.shape[1]), is_open.shape[1])
    next_close = np.minimum.accumulate(closing[:, ::-1], axis=1)[:, ::-1] if closing.size else closing
    close = next_close[chart, campaign]
    is_closed = close < is_open.shape[1]
    closing_campaign = np.where(is_closed, close, 0)
    by_event = is_closed & (p.epoch[chart, closing_campaign] > p.epoch[chart, campaign])
    began = getattr(charts, f"{direction}_began")[chart, campaign]
    rows = p.charts.iloc[chart][TABLE_KEYS].reset_index(drop=True)
    raised = timestamps(p.time[chart, campaign])
    names = rows["section_id"].where(rows["section_id"] != "*", rows["turnout_id"] + "/*")
    stamp = np.datetime_as_string(raised, unit="s")
    return rows.assign(
        alarm_id=names + ":" + rows["band"] + ":" + rows["source"] + f":{direction}:" + stamp,
        direction=direction,
        raised_at_utc=raised,
        began_at_utc=timestamps(np.where(began >= 0, p.time[chart, np.maximum(began, 0)], np.nan)),
        statistic=getattr(charts, direction)[chart, campaign],
        threshold=getattr(charts, f"threshold_{direction}")[chart],
        run_length=run_length[chart],
        closed_at_utc=timestamps(np.where(is_closed, p.time[chart, closing_campaign], np.nan)),
        closed_by=np.where(is_closed, np.where(by_event, "event", "recovered"), np.array(None, dtype=object)),
    )


def arrow_rows(table: str, frame: pd.DataFrame, rounded: bool = True, single: bool = False) -> pa.Table:
    """``frame`` with the columns and types of a table; NaN, infinity and NaT become NULL.

    A column that the frame lacks is NULL.

    Parameters
    ----------
    table : str
        Name of the table.
    frame : DataFrame
        Its rows.
    rounded : bool
        Whether numbers are rounded to the stated decimals; False is for tests of the views.
    single : bool
        Whether numbers with stated decimals are stored in single precision, which has enough digits and halves the
        memory.

    Returns
    -------
    Table
        Arrow table of the registry.
    """
    schema, columns = arrow_schema(table), tables()[table]
    arrays = [_array(frame, c, field.type, rounded, single) for c, field in zip(columns, schema)]
    return pa.table(arrays, names=[c.name for c in columns])


def _array(frame: pd.DataFrame, column: Column, arrow_type: pa.DataType, rounded: bool, single: bool) -> pa.Array:
    if column.name not in frame:
        return pa.nulls(len(frame), arrow_type)
    values = frame[column.name]
    if pa.types.is_floating(arrow_type) or pa.types.is_integer(arrow_type):
        numbers = values.to_numpy(dtype=float, na_value=np.nan) if values.dtype.kind not in "iub" else values.to_numpy()
        if rounded and column.decimals is not None:
            numbers = np.round(numbers, column.decimals) + 0.0
        if single and column.decimals is not None:
            numbers, arrow_type = numbers.astype(np.float32), pa.float32()
        if numbers.dtype.kind == "f":
            return pa.array(numbers, mask=~np.isfinite(numbers)).cast(arrow_type)
        return pa.array(numbers).cast(arrow_type)
    if str(values.dtype) == "category":
        return pa.DictionaryArray.from_arrays(
            pa.array(values.cat.codes.to_numpy(), mask=values.cat.codes.to_numpy() < 0), values.cat.categories.tolist()
        )
    return pa.array(values, type=arrow_type, from_pandas=True)
