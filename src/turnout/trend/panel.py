"""Arrange rows of modes as a matrix of charts x campaigns, so that all charts are computed at once.

Also decides which values of a turnout form one campaign, and which times are plausible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from turnout.constants import DAYS_PER_YEAR

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout.config.settings.trend import TrendSettings

SECONDS_PER_DAY = 86400.0  # s
# [d] A first campaign isolated by more than this from the next is left out: a mistyped year or a clock that was reset.
# A true one, such as an acceptance test, must not start the baseline either.
ISOLATED_FIRST_GAP = 5 * DAYS_PER_YEAR


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


def keys_of(visits: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Row of visits and time combined in one sortable integer.

    Parameters
    ----------
    visits : (n,) array of int
        Row of ``Panel.time``.
    time : (n,) array of float
        Time. [d]

    Returns
    -------
    (n,) array of int
        Sorts by row of visits, then by time.
    """
    return visits * 2**40 + np.round((time + 2e6) * SECONDS_PER_DAY).astype(np.int64)


def unique_of(key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``np.unique(key, return_inverse=True)`` by hashing, which is faster for many rows and few charts.

    Parameters
    ----------
    key : (n,) array of float
        Keys.

    Returns
    -------
    two arrays
        Sorted distinct keys, and the index of each key among them.
    """
    code, unique = pd.factorize(key)
    order = np.argsort(unique, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return np.asarray(unique)[order], rank[code]


def campaigns_of(
    visits: np.ndarray, time: np.ndarray, gap: float, n_visits: int, resets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Group values in campaigns.

    A campaign lasts ``gap`` from its first value on, and ends at an event that resets charts.

    Parameters
    ----------
    visits : (n,) array of int
        Row of ``Panel.time`` of each value.
    time : (n,) array of float
        Time of each value. [d]
    gap : float
        Longest duration of a campaign. [d]
    n_visits : int
        Number of rows of ``Panel.time``.
    resets : (n_reset,) array of int
        Sorted ``keys_of`` the events that reset charts.

    Returns
    -------
    (n,) array of int, (n_visits, n_campaign) array of float
        Number of the campaign of each row within its turnout, and start times [d], nan where there are fewer.
    """
    if not time.size:  # one empty column, so that later steps need no special case
        return np.zeros(0, dtype=np.int64), np.full((n_visits, 1), np.nan)
    stamp, row = unique_of(keys_of(visits, time))
    visit, moment = stamp >> 40, (stamp & (2**40 - 1)) / SECONDS_PER_DAY - 2e6
    new_turnout = np.diff(visit, prepend=-1) != 0
    after_reset = np.diff(np.searchsorted(resets, stamp, side="right"), prepend=0) > 0
    new = split(new_turnout | after_reset | (np.diff(moment, prepend=0.0) > gap), moment, gap)
    running = np.cumsum(new) - 1
    first = np.zeros(n_visits, dtype=np.int64)
    first[visit[new_turnout]] = running[new_turnout]
    number = running - first[visit]
    starts = np.full((n_visits, int(number.max()) + 1), np.nan)
    starts[visit[new], number[new]] = moment[new]
    return number[row], starts


def is_isolated_first(visits: np.ndarray, time: np.ndarray, gap: float, n_visits: int) -> np.ndarray:
    """Which rows belong to a first campaign more than ``ISOLATED_FIRST_GAP`` before the next, if at least two follow.

    A baseline that begins with it would last a year without a value in summer.

    Parameters
    ----------
    visits : (n,) array of int
        Row of ``Panel.time`` of each value.
    time : (n,) array of float
        Time of each value. [d]
    gap : float
        Longest duration of a campaign. [d]
    n_visits : int
        Number of rows of ``Panel.time``.

    Returns
    -------
    (n,) array of bool
        Whether each row belongs to such a campaign.

    Examples
    --------
    >>> is_isolated_first(np.zeros(4, int), np.array([0.0, 9000.0, 1.0, 9007.0]), 1.5, 1)
    array([ True, False,  True, False])
    """
    first, second = np.full((2, n_visits), np.inf)
    last = np.full(n_visits, -np.inf)
    np.minimum.at(first, visits, time)
    early = time <= first[visits] + gap
    np.minimum.at(second, visits[~early], time[~early])
    np.maximum.at(last, visits, time)
    lone = (second > first + ISOLATED_FIRST_GAP) & (last > second + gap)
    return early & lone[visits]


def split(new: np.ndarray, moment: np.ndarray, gap: float) -> np.ndarray:
    """Start a new campaign after every ``gap`` within a long run of values, as with daily measurements.

    Parameters
    ----------
    new : (n,) array of bool
        Whether each value is the first of a campaign.
    moment : (n,) array of float
        Times, ascending within a campaign. [d]
    gap : float
        Longest duration of a campaign. [d]

    Returns
    -------
    (n,) array of bool
        First values, also those of the new campaigns.

    Examples
    --------
    >>> split(np.array([True, False, False, False, True]), np.array([0.0, 1.0, 2.0, 3.0, 9.0]), 1.5)
    array([ True, False,  True, False,  True])
    """
    new, begin = new.copy(), np.flatnonzero(new)
    end = np.append(begin[1:], new.size)
    long = moment[end - 1] - moment[begin] > gap
    for first, last in zip(begin[long], end[long]):
        while moment[last - 1] - moment[first] > gap:
            first += int(np.searchsorted(moment[first:last], moment[first] + gap, side="right"))
            new[first] = True
    return new


CHART_KEYS = ["turnout_id", "band", "source", "section_id"]
WHOLE_TURNOUT = "*"


@dataclass(frozen=True)
class Panel:
    """Values of charts x campaigns. A chart is one section, band and source; a campaign is one visit to its turnout.

    Parameters
    ----------
    charts : DataFrame
        ``turnout_id, band, source, section_id``, sorted; ``group`` numbers turnout, band and source (the
        siblings of a chart share it) and ``visits`` the row of ``time``.
    time : (n_visits, n_campaign) array of float
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
        return self.time[self.charts["visits"].to_numpy()]


def days(times: Any) -> np.ndarray:
    """Naive UTC times as days since 1970-01-01; nan for a missing time.

    Parameters
    ----------
    times : sequence of times
        Times as pandas reads them.

    Returns
    -------
    (n,) array of float
        Days since 1970-01-01. [d]

    Examples
    --------
    >>> days(pd.Series(pd.to_datetime(["1970-01-02 12:00"])))
    array([1.5])
    """
    stamps = pd.to_datetime(pd.Series(times)).to_numpy().astype("datetime64[us]")
    return np.where(np.isnat(stamps), np.nan, stamps.astype("int64") / (SECONDS_PER_DAY * 1e6))


def timestamps(day: ArrayLike) -> np.ndarray:
    """Days since 1970-01-01 as datetime64[us], NaT for nan; the inverse of ``days``.

    Parameters
    ----------
    day : (n,) array of float
        Days since 1970-01-01. [d]

    Returns
    -------
    (n,) array of datetime64[us]
        Times, rounded to seconds.

    Examples
    --------
    >>> str(timestamps(np.array([1.5]))[0])
    '1970-01-02T12:00:00.000000'
    """
    day = np.asarray(day, dtype=float)
    micro = np.round(np.nan_to_num(day) * SECONDS_PER_DAY).astype("int64") * 1_000_000
    return np.where(np.isfinite(day), micro.view("datetime64[us]"), np.datetime64("NaT", "us"))


def believable_times(time: np.ndarray, settings: TrendSettings, until: float = np.inf) -> tuple[np.ndarray, float]:
    """Which times of a fleet are plausible, and the newest of them.

    A time before ``earliest_year`` or after ``until`` is implausible. So is a single last day of measurement more
    than ``clock_gap_days`` after all others of the fleet.

    Parameters
    ----------
    time : (n,) array of float
        Times. [d]
    settings : TrendSettings
        Settings of the charts.
    until : float
        Newest time that may be. [d]

    Returns
    -------
    ((n,) array of bool, float)
        Whether each time is plausible, and the newest one [d], -inf if none is.

    Examples
    --------
    >>> from turnout.config.settings.trend import TrendSettings
    >>> believable_times(np.array([-3.0, 15000.0, 15007.0, 26000.0]), TrendSettings())
    (array([False,  True,  True, False]), 15007.0)
    """
    earliest = days([pd.Timestamp(settings.earliest_year, 1, 1)])[0]
    is_believable = np.isfinite(time) & (time >= earliest) & (time <= until)
    dates = np.unique(np.floor(time[is_believable]))
    if dates.size >= 3 and dates[-1] - dates[-2] > settings.clock_gap_days:
        is_believable &= time < dates[-1]
    return is_believable, float(np.max(time, where=is_believable, initial=-np.inf))


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
        visits=charts.groupby(["turnout_id", "source"], sort=True, observed=True).ngroup().to_numpy(),
    )
    visits, gap = charts["visits"].to_numpy(), settings.campaign_gap_hours / 24.0
    n_visits = int(visits.max()) + 1 if len(visits) else 0
    use = is_believable & has_value
    is_believable[use] = ~is_isolated_first(visits[chart[use]], time[use], gap, n_visits)
    use &= is_believable
    is_left_out = ~use
    left_out = charts[CHART_KEYS].iloc[chart[is_left_out]].reset_index(drop=True)
    left_out["measured_at_utc"] = timestamps(time[is_left_out])
    left_out["reason"] = np.where(is_believable[is_left_out], "no_value", "wrong_time")
    if not use.all():
        chart, time = chart[use], time[use]
        frequency, error, temperature = frequency[use], error[use], temperature[use]
    resets = _reset_keys(charts, events)
    column, starts = campaigns_of(visits[chart], time, gap, n_visits, resets)
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
    """Sorted ``keys_of`` the events that reset charts, for every row of visits."""
    if events is None or not len(events):
        return np.zeros(0, dtype=np.int64)
    flags = zip(events["resets_ballast"], events["resets_railpad"])
    resetting = np.array([is_true(ballast) or is_true(railpad) for ballast, railpad in flags])
    resets = events[resetting & events["event_at_utc"].notna().to_numpy()]
    rows = charts[["turnout_id", "visits"]].drop_duplicates().astype({"turnout_id": object})
    pairs = rows.merge(resets[["turnout_id", "event_at_utc"]].astype({"turnout_id": object}), on="turnout_id")
    return np.sort(keys_of(pairs["visits"].to_numpy(dtype=np.int64), days(pairs["event_at_utc"])))
