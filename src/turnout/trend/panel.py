"""Arrange rows of modes as a matrix of charts x campaigns, so that all charts are computed at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from turnout.trend.campaign_groups import campaigns_of, is_isolated_first, keys_of, unique_of
from turnout.trend.times import believable_times, days, timestamps

if TYPE_CHECKING:
    from typing import Any

    from turnout.config.settings.trend import TrendSettings


def is_true(flag: Any) -> bool:
    """Whether a flag from a CSV or from the registry is true; missing or unknown texts are false.

    Parameters
    ----------
    flag : object
        Value of a cell.

    Returns
    -------
    bool
        The flag.
    """
    return flag is True or str(flag).strip().lower() in ("true", "1", "yes")


CHART_KEYS = ["turnout_id", "band", "source", "section_id"]
WHOLE_TURNOUT = "*"


@dataclass(frozen=True)
class Panel:
    """Values of charts x campaigns. A chart is one section, band and source.

    A calendar is the sequence of the campaigns of one turnout and source.

    Parameters
    ----------
    charts : DataFrame
        ``turnout_id, band, source, section_id``, sorted; ``group`` numbers turnout, band and source (the
        siblings of a chart share it) and ``calendar`` numbers turnout and source.
    time : (n_calendar, n_campaign) array of float
        Start of each campaign, nan where the turnout had fewer. [d since 1970-01-01]
    frequency, error, temperature : (n_chart, n_campaign) arrays of float
        Natural frequency and its standard error [Hz], rail temperature [°C]; nan where not known.
    left_out : DataFrame
        Rows that enter no chart, with ``reason``.
    as_of : float
        Newest campaign of the fleet with a plausible time. [d]
    """

    charts: pd.DataFrame
    time: np.ndarray
    frequency: np.ndarray
    error: np.ndarray
    temperature: np.ndarray
    left_out: pd.DataFrame
    as_of: float

    @property
    def chart_time(self) -> np.ndarray:
        """(n_chart, n_campaign) time of each cell. [d]"""
        return self.time[self.charts["calendar"].to_numpy()]


def panel_of(
    modes: pd.DataFrame, settings: TrendSettings, as_of: Any = None, events: pd.DataFrame | None = None
) -> Panel:
    """Arrange rows of the table ``modes`` as charts x campaigns.

    Values of one turnout and source within ``campaign_gap_hours`` of the first are one campaign. An event that resets
    charts starts a new campaign. Of two values of one chart in one campaign the later counts. Values from passages are
    weekly, from the view ``passage_values``.

    Parameters
    ----------
    modes : DataFrame
        Rows of that table; without a column ``source`` they are of hammer tests.
    settings : TrendSettings
        Settings of the charts.
    as_of : time or None
        Rows after it do not count; None: all with a plausible time.
    events : DataFrame or None
        Rows of the table ``events``.

    Returns
    -------
    Panel
        The charts, with the rows that were left out.
    """
    rows = modes if "source" in modes else modes.assign(source="hammer")
    time = days(rows["measured_at_utc"])
    if as_of is None:
        _, newest = believable_times(time, settings)
    else:
        newest = days([as_of])[0]
    charts, chart = _charts(rows)

    def column(name: str) -> np.ndarray:
        return rows[name].to_numpy(dtype=float, na_value=np.nan) if name in rows else np.full(len(rows), np.nan)

    frequency, error, temperature = (column(n) for n in ("frequency_hz", "frequency_se_hz", "rail_temperature_c"))
    return lay_out(charts, chart, time, frequency, error, temperature, newest, settings, events)


def lay_out(
    charts: pd.DataFrame,
    chart: np.ndarray,
    time: np.ndarray,
    frequency: np.ndarray,
    error: np.ndarray,
    temperature: np.ndarray,
    newest: float,
    settings: TrendSettings,
    events: pd.DataFrame | None = None,
) -> Panel:
    """Panel of rows whose chart is given by number.

    Left out are rows without a frequency, before ``settings.earliest_year``, after ``newest``, and those of an isolated
    first campaign (``is_isolated_first``).

    Parameters
    ----------
    charts : DataFrame
        Columns ``CHART_KEYS``, sorted by them.
    chart : (n_row,) array of int
        Chart of each row.
    time : (n_row,) array of float
        Time of each row. [d]
    frequency : (n_row,) array of float
        Natural frequency. [Hz]
    error : (n_row,) array of float
        Its standard error. [Hz]
    temperature : (n_row,) array of float
        Rail temperature. [°C]
    newest : float
        Newest time that counts. [d]
    settings : TrendSettings
        Settings of the charts.
    events : DataFrame or None
        Rows of the table ``events``.

    Returns
    -------
    Panel
        The charts, with the rows that were left out.
    """
    earliest = days([pd.Timestamp(settings.earliest_year, 1, 1)])[0]
    is_believable = (time >= earliest) & (time <= newest)
    has_value = np.isfinite(frequency) & (frequency > 0.0)
    charts = charts.assign(
        group=charts.groupby(CHART_KEYS[:3], sort=True, observed=True).ngroup().to_numpy(),
        calendar=charts.groupby(["turnout_id", "source"], sort=True, observed=True).ngroup().to_numpy(),
    )
    calendar, gap = charts["calendar"].to_numpy(), settings.campaign_gap_hours / 24.0
    n_calendar = int(calendar.max()) + 1 if len(calendar) else 0
    use = is_believable & has_value
    is_believable[use] = ~is_isolated_first(calendar[chart[use]], time[use], gap, n_calendar)
    use &= is_believable
    is_left_out = ~use
    left_out = charts[CHART_KEYS].iloc[chart[is_left_out]].reset_index(drop=True)
    left_out["measured_at_utc"] = timestamps(time[is_left_out])
    left_out["reason"] = np.where(is_believable[is_left_out], "no_value", "wrong_time")
    if not use.all():
        chart, time = chart[use], time[use]
        frequency, error, temperature = frequency[use], error[use], temperature[use]
    resets = _reset_keys(charts, events)
    column, starts = campaigns_of(calendar[chart], time, gap, n_calendar, resets)
    order = _write_order(chart, column, starts.shape[1], time)
    cell = (chart[order], column[order])

    def to_matrix(values: np.ndarray) -> np.ndarray:
        matrix = np.full((len(charts), starts.shape[1]), np.nan)
        matrix[cell] = values[order]
        return matrix

    return Panel(charts, starts, to_matrix(frequency), to_matrix(error), to_matrix(temperature), left_out, newest)


def _write_order(chart: np.ndarray, column: np.ndarray, n_column: int, time: np.ndarray) -> slice | np.ndarray:
    """Order in which rows are written into cells: by time if two rows share a cell, so that the later one stays."""
    is_occupied = np.zeros((int(chart.max(initial=-1)) + 1, n_column), dtype=bool)
    is_occupied[chart, column] = True
    return slice(None) if np.count_nonzero(is_occupied) == time.size else np.argsort(time, kind="stable")


def _charts(rows: pd.DataFrame) -> tuple[pd.DataFrame, np.ndarray]:
    """Charts in sorted order, and the chart number of each row; categories are not expanded to text per row."""
    codes, names = [], []
    for name in CHART_KEYS:
        column = rows[name]
        if isinstance(column.dtype, pd.CategoricalDtype):
            categories = np.asarray(column.cat.categories, dtype=object)
            rank = np.argsort(np.argsort(categories))
            codes.append(rank[column.cat.codes.to_numpy()])
            names.append(np.sort(categories))
        else:
            code, unique = pd.factorize(column, sort=True)
            codes.append(code)
            names.append(np.asarray(unique, dtype=object))
    sizes = [max(len(n), 1) for n in names]
    key = np.ravel_multi_index([np.asarray(c, dtype=np.int64) for c in codes], sizes) if len(rows) else np.zeros(0, int)
    unique, chart = unique_of(key)
    indices = np.unravel_index(unique, sizes)
    return pd.DataFrame({n: v[p] for n, v, p in zip(CHART_KEYS, names, indices)}, columns=CHART_KEYS), chart


def _reset_keys(charts: pd.DataFrame, events: pd.DataFrame | None) -> np.ndarray:
    """Sorted ``keys_of`` the events that reset charts, of every calendar."""
    if events is None or not len(events):
        return np.zeros(0, dtype=np.int64)
    flags = zip(events["resets_ballast"], events["resets_railpad"])
    resetting = np.array([is_true(ballast) or is_true(railpad) for ballast, railpad in flags])
    resets = events[resetting & events["event_at_utc"].notna().to_numpy()]
    rows = charts[["turnout_id", "calendar"]].drop_duplicates().astype({"turnout_id": object})
    pairs = rows.merge(resets[["turnout_id", "event_at_utc"]].astype({"turnout_id": object}), on="turnout_id")
    return np.sort(keys_of(pairs["calendar"].to_numpy(dtype=np.int64), days(pairs["event_at_utc"])))
