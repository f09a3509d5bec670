"""Describe flagged charts: onset and size of the change, drift, and when the limit is reached.

Flagged are charts with an open alarm and sections with a significant drift. All alarms are recomputed each night. An
open alarm that is not raised again is not removed: it stays in the table, closed by ``recomputed``.
"""

import logging
from dataclasses import dataclass

import numpy as np
import pandas as pd

from turnout.trend.change_point import find_change
from turnout.trend.drift import discoveries
from turnout.trend.forecast import RECENT, forecast
from turnout.trend.panel import WHOLE, timestamps
from turnout.trend.residuals import first_epoch

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
}


@dataclass(frozen=True)
class Flag:
    """What is needed to describe one chart: the values of its present epoch and its CUSUM over the threshold.

    ``time`` [d] and ``values`` [%] are (n,) arrays; ``autocorrelation`` is their lag-one coefficient. ``temperature``
    (n,) [°C] is None for a whole turnout. ``slope_weight`` is that of ``fit_onsets``. ``ratio`` (CUSUM over threshold)
    and ``opening_campaign`` (the campaign that raised each open alarm) are by direction.
    """

    time: np.ndarray
    values: np.ndarray
    memory: float
    temperature: np.ndarray | None
    known: float
    ratio: dict
    opened: dict


def candidates(charts, status, settings) -> dict[int, Flag]:
    """Charts that may be flagged, by row of ``status``: an open alarm, or a drift with p below the rate."""
    p = charts.prepared
    whole = status["section_id"].to_numpy() == WHOLE
    drifting = p.baseline.complete & ~whole & (status["drift_p"].to_numpy() <= settings.false_discovery)
    found = {}
    for i in np.flatnonzero((status["state"].to_numpy() == "alarm") | drifting):
        column = np.flatnonzero(np.isfinite(charts.residual[i]) & (p.epoch[i] == p.epoch[i, -1]))
        ratio = {d: getattr(charts, d)[i, -1] / getattr(charts, f"threshold_{d}")[i] for d in ("down", "up")}
        alarms = {d: getattr(charts, f"{d}_open")[i] for d in ("down", "up")}
        opened = {d: _raised(alarm) for d, alarm in alarms.items() if alarm[-1]}
        if len(opened) == 2:  # describe the later alarm, relative to the level after the earlier one
            column = column[column >= min(opened.values())]
        temperature, known = _heat(charts, i, column)
        found[int(i)] = Flag(
            p.time[i, column],
            charts.residual[i, column],
            float(charts.memory[i]),
            temperature,
            known,
            ratio,
            opened,
        )
    return found


def _raised(alarm) -> int:
    """Campaign that raised an alarm that is open at the newest.

    >>> _raised(np.array([True, False, True, True]))
    2
    """
    return int(np.max(np.flatnonzero(~alarm), initial=-1)) + 1


def _heat(charts, i, column):
    """Temperatures of a section's values [°C], and the weight of the slope that other values give (0: none do)."""
    p = charts.prepared
    if i >= len(p.panel.charts):
        return None, 0.0
    later = p.epoch[i, -1] > first_epoch(p)[i]
    error = p.baseline.slope_se[i]
    return p.panel.temperature[i, column], float((p.spread[i] / error) ** 2) if later and error > 0.0 else 0.0


def describe_flagged(status, flags, settings) -> pd.DataFrame:
    """Add to ``chart_status`` the adjusted p value of the drift, and the description of each flagged chart.

    ``flags`` are the ``candidates`` by row of ``status``. Flagged are charts with an open alarm, and sections whose
    adjusted p value of the drift is at most ``settings.false_discovery``. The costly steps run on them alone.
    """
    status = status.copy()
    judged = status["complete"].to_numpy() & (status["section_id"].to_numpy() != WHOLE)
    status["drift_q"] = discoveries(np.where(judged, status["drift_p"].to_numpy(), np.nan))
    flagged = ((status["state"] == "alarm") | (status["drift_q"] <= settings.false_discovery)).to_numpy()
    stories = {i: _story(flag, settings) for i, flag in flags.items() if flagged[i]}
    for name, kind in COLUMNS.items():
        column = np.full(len(status), None if kind is object else np.nan, dtype=object if kind is object else float)
        if "datetime" in str(kind):
            column = np.full(len(status), np.datetime64("NaT"), dtype="datetime64[us]")
        for i, story in stories.items():
            column[i] = story[name]
        status[name] = column
    return status


def _story(flag, settings):
    """Columns that describe one flagged chart. The change point is sought in its present epoch only."""
    time, values = flag.time, flag.values
    found = find_change(time, values, flag.memory, flag.temperature, flag.known)
    at = int(np.searchsorted(time, found.since)) if np.isfinite(found.since) else 0
    if flag.opened:
        direction = max(flag.opened, key=flag.opened.get)
    else:
        direction = "down" if values[-RECENT:].mean() < values.mean() else "up"
    seen = forecast(time[at:], values[at:], flag.memory, settings)
    now = time[-1] if len(time) else np.nan
    return dict(
        direction=direction,
        statistic_ratio=flag.ratio[direction],
        change_kind=found.kind,
        since_at_utc=timestamps([found.since])[0],
        since_earliest_utc=timestamps([found.earliest])[0],
        since_latest_utc=timestamps([found.latest])[0],
        change_pct=found.size,
        change_low_pct=found.low,
        change_high_pct=found.high,
        n_after=float(len(values) - at),
        forecast=seen.verdict,
        forecast_slope_pct_per_year=seen.slope,
        forecast_slope_se_pct_per_year=seen.slope_error,
        not_before_utc=timestamps([now + 365.25 * seen.not_before])[0],
        not_after_utc=timestamps([now + 365.25 * seen.not_after])[0],
    )


CHART = ["turnout_id", "section_id", "band", "source", "direction"]
# Published alarms that the next update must raise again or close: open ones, and those closed as recomputed.
ACCOUNTED = "select * from alarms where closed_at_utc is null or closed_by = 'recomputed' order by alarm_id"


def with_withdrawn(alarms, before, newest) -> pd.DataFrame:
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
    """
    if before.empty:
        return alarms
    times = ["raised_at_utc", "closed_at_utc"]
    now = alarms if len(alarms) else pd.DataFrame(columns=[*CHART, *times])
    both = before.reset_index().merge(now[[*CHART, *times]], on=CHART, suffixes=("", "_now"))
    until, then = pd.to_datetime(both["closed_at_utc_now"]), pd.to_datetime(both["closed_at_utc"])
    again = until.isna() | (until >= both["raised_at_utc"])
    again &= then.isna() | (pd.to_datetime(both["raised_at_utc_now"]) <= then)
    found = both.loc[again.to_numpy(dtype=bool), "index"]
    gone = before[~before.index.isin(found)]
    fresh = gone["closed_at_utc"].isna()
    for row in gone[fresh].itertuples():
        said = "the alarm %s is not raised again by what is known now: closed as recomputed"
        logging.getLogger("turnout.trend").warning(said, row.alarm_id)
    closed = np.fmax(timestamps(np.full(len(gone), newest)), gone["raised_at_utc"].to_numpy("datetime64[us]"))
    gone = gone.assign(
        closed_at_utc=np.where(fresh, closed, gone["closed_at_utc"].to_numpy("datetime64[us]")), closed_by="recomputed"
    )
    return gone.reset_index(drop=True) if alarms.empty else pd.concat([alarms, gone], ignore_index=True)
