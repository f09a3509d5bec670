"""Describe flagged charts: onset and size of the change, drift, and when the limit is reached.

Flagged are charts with an open alarm and sections with a significant drift. All alarms are recomputed each night. An
open alarm that is not raised again is not removed: it stays in the table, closed by ``recomputed``.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.change_point import Change, find_change
from turnout.trend.drift import adjusted_p_values
from turnout.trend.forecast import N_RECENT, forecast
from turnout.trend.panel import WHOLE_TURNOUT
from turnout.trend.preparation import first_epoch
from turnout.trend.quantities import RESONANCES, is_damping
from turnout.trend.stiffness import COMPONENTS, ResonancePair, chart_numbers, resonance_pair, stiffness_change
from turnout.trend.times import timestamps

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.charts import Charts

COLUMNS = {
    "direction": object,
    "statistic_ratio": float,
    "since_at_utc": "datetime64[us]",
    "since_earliest_utc": "datetime64[us]",
    "since_latest_utc": "datetime64[us]",
    "change_kind": object,
    "change_pct": float,
    "change_low_pct": float,
    "change_high_pct": float,
    "n_after": float,
    "forecast": object,
    "forecast_slope_pct_per_year": float,
    "forecast_slope_se_pct_per_year": float,
    "not_before_utc": "datetime64[us]",
    "not_after_utc": "datetime64[us]",
    "changed_component": object,
    "ballast_stiffness_pct": float,
    "ballast_stiffness_low_pct": float,
    "ballast_stiffness_high_pct": float,
    "pad_stiffness_pct": float,
    "pad_stiffness_low_pct": float,
    "pad_stiffness_high_pct": float,
}

# No limit is set for a damping ratio, so there is no time to it.
WITHOUT_LIMIT: dict[str, Any] = {
    "forecast": None,
    "forecast_slope_pct_per_year": np.nan,
    "forecast_slope_se_pct_per_year": np.nan,
    "not_before_utc": np.datetime64("NaT", "us"),
    "not_after_utc": np.datetime64("NaT", "us"),
}


@dataclass(frozen=True)
class Flag:
    """What is needed to describe one chart: the values of its present epoch and its CUSUM over the threshold.

    ``time`` [d] and ``values`` [%] are (n,) arrays without ``lone_outliers``. Of a chart in alarm they also lack the
    campaigns of alarms that have closed, and the change came after ``not_before`` [d], the last of those.
    ``autocorrelation`` is the lag-one coefficient. ``temperature`` (n,) [°C] is None for a whole turnout.
    ``slope_weight`` is that of ``fit_onsets``. ``ratio`` (CUSUM over threshold) and ``opening_campaign`` (the campaign
    that raised each open alarm) are by direction. ``pair`` holds both resonances of the section, None where only one
    has a chart.
    """

    time: np.ndarray
    values: np.ndarray
    autocorrelation: float
    temperature: np.ndarray | None
    slope_weight: float
    ratio: dict[str, float]
    opening_campaign: dict[str, int]
    pair: ResonancePair | None = None
    not_before: float = -np.inf

    @property
    def direction(self) -> str | None:
        """That of the alarm, of the later one where two are open; None without an alarm."""
        return max(self.opening_campaign, key=lambda name: self.opening_campaign[name], default=None)


def candidates(charts: Charts, status: pd.DataFrame, settings: TrendSettings) -> dict[int, Flag]:
    """Charts that may be flagged, by row of ``status``: an open alarm, or a drift with p below the rate.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    status : DataFrame
        Table of ``chart_status``.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    dict
        Flag by row of ``status``.
    """
    p = charts.prepared
    whole = status["section_id"].to_numpy() == WHOLE_TURNOUT
    drifting = (
        p.baseline.complete
        & ~whole
        & ~is_damping(status["band"])
        & (status["drift_p"].to_numpy() <= settings.false_discovery)
    )
    flags, numbers = {}, chart_numbers(charts)
    for i in np.flatnonzero((status["state"].to_numpy() == "alarm") | drifting):
        column = charts.present_campaigns(int(i))
        ratio = {d: getattr(charts, d)[i, -1] / getattr(charts, f"threshold_{d}")[i] for d in ("down", "up")}
        alarms = {d: getattr(charts, f"{d}_open")[i] for d in ("down", "up")}
        opening_campaign = {d: _opening_campaign(alarm) for d, alarm in alarms.items() if alarm[-1]}
        not_before = -np.inf
        if opening_campaign and (passed := np.flatnonzero(_closed_alarms(charts, int(i)))).size:
            not_before = float(p.time[i, passed[-1]])
            column = np.setdiff1d(column, passed)
        temperature, slope_weight = _temperatures(charts, int(i), column)
        flags[int(i)] = Flag(
            p.time[i, column],
            charts.residual[i, column],
            float(charts.autocorrelation[i]),
            temperature,
            slope_weight,
            ratio,
            opening_campaign,
            resonance_pair(charts, int(i), numbers),
            not_before,
        )
    return flags


def _closed_alarms(charts: Charts, i: int) -> np.ndarray:
    """Campaigns of the present epoch from the onset of each closed alarm to its highest sum, (n_campaign,) bool.

    They have a level of their own, from which the chart has returned.
    """
    inside = np.zeros(charts.residual.shape[1], dtype=bool)
    for direction in ("down", "up"):
        is_open = getattr(charts, f"{direction}_open")[i]
        edge = np.flatnonzero(np.diff(is_open.astype(np.int8), prepend=0))
        for opening, closing in zip(edge[::2], edge[1::2]):
            highest = opening + int(np.argmax(getattr(charts, direction)[i, opening:closing]))
            inside[getattr(charts, f"{direction}_began")[i, opening] + 1 : highest + 1] = True
    epoch = charts.prepared.epoch[i]
    return inside & (epoch == epoch[-1])


def _opening_campaign(alarm: np.ndarray) -> int:
    """Campaign that raised an alarm that is open at the newest.

    >>> _opening_campaign(np.array([True, False, True, True]))
    2
    """
    return int(np.max(np.flatnonzero(~alarm), initial=-1)) + 1


def _temperatures(charts: Charts, i: int, column: np.ndarray) -> tuple[np.ndarray | None, float]:
    """Temperatures of a section's values [°C], and the weight of the slope that other values give (0: none do)."""
    p = charts.prepared
    if i >= len(p.panel.charts):
        return None, 0.0
    later = p.epoch[i, -1] > first_epoch(p)[i]
    error = p.baseline.slope_se[i]
    return p.panel.temperature[i, column], float((p.spread[i] / error) ** 2) if later and error > 0.0 else 0.0


def describe_flagged(status: pd.DataFrame, flags: Mapping[int, Flag], settings: TrendSettings) -> pd.DataFrame:
    """Add to ``chart_status`` the adjusted p value of the drift, and the description of each flagged chart.

    Flagged are charts with an open alarm, and sections whose adjusted p value of the drift is at most
    ``settings.false_discovery``. The costly steps run on them alone.

    Parameters
    ----------
    status : DataFrame
        Table of ``chart_status``, of the whole fleet.
    flags : mapping
        Result of ``candidates``, by row of ``status``.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    DataFrame
        A copy of ``status`` with the columns ``drift_q`` and ``COLUMNS``.
    """
    status = status.copy()
    damping = is_damping(status["band"])
    is_tested = status["complete"].to_numpy() & (status["section_id"].to_numpy() != WHOLE_TURNOUT) & ~damping
    status["drift_q"] = adjusted_p_values(np.where(is_tested, status["drift_p"].to_numpy(), np.nan))
    flagged = ((status["state"] == "alarm") | (status["drift_q"] <= settings.false_discovery)).to_numpy()
    changes = {
        i: find_change(
            flag.time,
            flag.values,
            flag.autocorrelation,
            flag.temperature,
            flag.slope_weight,
            direction=flag.direction,
            not_before=flag.not_before,
        )
        for i, flag in flags.items()
        if flagged[i]
    }
    of_section = _changes_of_sections(status, changes)
    descriptions = {i: _describe_chart(flags[i], change, of_section[i], settings) for i, change in changes.items()}
    for i in descriptions.keys() & set(np.flatnonzero(damping)):
        descriptions[i] |= WITHOUT_LIMIT
    for name, dtype in COLUMNS.items():
        column = np.full(len(status), None if dtype is object else np.nan, dtype=object if dtype is object else float)
        if "datetime" in str(dtype):
            column = np.full(len(status), np.datetime64("NaT", "us"), dtype="datetime64[us]")
        for i, description in descriptions.items():
            column[i] = description[name]
        status[name] = column
    return status


def _changes_of_sections(status: pd.DataFrame, changes: Mapping[int, Change]) -> dict[int, Change]:
    """The change of each flagged chart, or that of the other resonance of its section where that is clearer.

    A stiffness has one onset, so both rows of a section say the same of it.
    """
    members: dict[tuple, list[int]] = {}
    for i in changes:
        row = status.iloc[i]
        is_resonance = row["band"] in RESONANCES
        key = (row["turnout_id"], row["section_id"], row["source"]) if is_resonance else (i,)
        members.setdefault(key, []).append(i)

    def clearness(i: int) -> float:
        width = changes[i].high - changes[i].low
        return abs(changes[i].size) / width if width > 0.0 else 0.0

    return {i: changes[max(same, key=clearness)] for same in members.values() for i in same}


def _describe_chart(flag: Flag, change: Change, of_section: Change, settings: TrendSettings) -> dict[str, Any]:
    """Columns that describe one flagged chart. The change point is sought in its present epoch only."""
    time, values = flag.time, flag.values
    at = int(np.searchsorted(time, change.since)) if np.isfinite(change.since) else 0
    newest = int(np.searchsorted(time, change.course[-1][1])) if change.course else 0  # first value after all changes
    direction = flag.direction or ("down" if values[-N_RECENT:].mean() < values.mean() else "up")
    outlook = forecast(time[newest:], values[newest:], flag.autocorrelation, settings)
    now = time[-1] if len(time) else np.nan
    stiffness = stiffness_change(flag.pair, of_section.course)
    sizes = {
        f"{component}_stiffness{end}_pct": value
        for component in COMPONENTS
        for end, value in zip(("", "_low", "_high"), getattr(stiffness, component), strict=True)
    }
    return sizes | dict(
        changed_component=stiffness.component if flag.pair is not None else None,
        direction=direction,
        statistic_ratio=flag.ratio[direction],
        change_kind=change.shape,
        since_at_utc=timestamps([change.since])[0],
        since_earliest_utc=timestamps([change.earliest])[0],
        since_latest_utc=timestamps([change.latest])[0],
        change_pct=change.size,
        change_low_pct=change.low,
        change_high_pct=change.high,
        n_after=float(len(values) - at),
        forecast=outlook.verdict,
        forecast_slope_pct_per_year=outlook.slope,
        forecast_slope_se_pct_per_year=outlook.slope_error,
        not_before_utc=timestamps([now + DAYS_PER_YEAR * outlook.not_before])[0],
        not_after_utc=timestamps([now + DAYS_PER_YEAR * outlook.not_after])[0],
    )


ALARM_KEYS = ["turnout_id", "section_id", "band", "source", "direction"]
# Published alarms that the next update must raise again or close: open ones, and those closed as recomputed.
PREVIOUS_ALARMS = "select * from alarms where closed_at_utc is null or closed_by = 'recomputed' order by alarm_id"


def with_withdrawn(alarms: pd.DataFrame, before: pd.DataFrame, newest: float) -> pd.DataFrame:
    """Rows of ``alarms``, and those open ones of ``before`` without a counterpart there, closed by ``recomputed``.

    Every alarm is recomputed each night. A corrected value, an event entered late or another autocorrelation of the
    fleet can remove one. A counterpart has the same chart and direction, and is open when the old alarm was raised or
    later. If the old alarm is already closed as recomputed, the counterpart must also be raised before that closing.

    Parameters
    ----------
    alarms : DataFrame
        Rows of the table ``alarms`` as computed now.
    before : DataFrame
        Published rows that are open, or already closed by ``recomputed``: these stay.
    newest : float
        Time of the newest campaign of the fleet, at which they are closed. [d]

    Returns
    -------
    DataFrame
        Rows of both.
    """
    if before.empty:
        return alarms
    times = ["raised_at_utc", "closed_at_utc"]
    now = alarms if len(alarms) else pd.DataFrame(columns=[*ALARM_KEYS, *times])
    pairs = before.reset_index().merge(now[[*ALARM_KEYS, *times]], on=ALARM_KEYS, suffixes=("", "_now"))
    until, then = pd.to_datetime(pairs["closed_at_utc_now"]), pd.to_datetime(pairs["closed_at_utc"])
    is_counterpart = until.isna() | (until >= pairs["raised_at_utc"])
    is_counterpart &= then.isna() | (pd.to_datetime(pairs["raised_at_utc_now"]) <= then)
    matched = pairs.loc[is_counterpart.to_numpy(dtype=bool), "index"]
    withdrawn = before[~before.index.isin(matched)]
    is_open = withdrawn["closed_at_utc"].isna()
    for row in withdrawn[is_open].itertuples():
        message = "the alarm %s is not raised again by what is known now: closed as recomputed"
        logging.getLogger("turnout.trend").warning(message, row.alarm_id)
    closed = np.fmax(timestamps(np.full(len(withdrawn), newest)), withdrawn["raised_at_utc"].to_numpy("datetime64[us]"))
    withdrawn = withdrawn.assign(
        closed_at_utc=np.where(is_open, closed, withdrawn["closed_at_utc"].to_numpy("datetime64[us]")),
        closed_by="recomputed",
    )
    return withdrawn.reset_index(drop=True) if alarms.empty else pd.concat([alarms, withdrawn], ignore_index=True)
