"""Decide the state of each chart today, and the reason.

States are ok, alarm, confirm now, learning, cannot tell and not measured.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from turnout.trend.detectable_change import detectable_change, is_temperature_known
from turnout.trend.drift import slopes, span
from turnout.trend.panel import WHOLE_TURNOUT
from turnout.trend.preparation import first_epoch
from turnout.trend.quantities import targets
from turnout.trend.residuals import FREQUENCY_RESOLUTION
from turnout.trend.threshold import run_lengths
from turnout.trend.times import timestamps

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.charts import Charts
    from turnout.trend.preparation import Prepared


def chart_status(charts: Charts, settings: TrendSettings) -> pd.DataFrame:
    """One row per chart: its state today, the reason, the detectable change and the slope.

    States in the order of decision: ``alarm``, also if no longer measured; ``confirm_now`` (newest campaign far
    outside); ``not_measured`` (too long ago); ``cannot_tell`` (constant values, no temperature for as long, or too few
    temperatures); ``learning`` (baseline or level after an event not complete); ``cannot_tell`` (detectable change
    above the target); ``ok``.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    DataFrame
        Table of that name.
    """
    p = charts.prepared
    n_section = len(p.panel.charts)
    measured = np.isfinite(np.vstack([p.panel.frequency, charts.residual[n_section:]]))
    last = np.max(np.where(measured, p.time, -np.inf), axis=1, initial=-np.inf)
    detectable, campaigns = detectable_change(charts, settings)
    present = p.epoch == (p.epoch[:, -1:] if p.epoch.shape[1] else 0)
    mask = present & np.isfinite(charts.residual) & is_temperature_known(charts)
    slope, error, p_value = slopes(charts.residual, p.time, mask, charts.autocorrelation)
    is_too_short = span(p.time, mask) < settings.drift_days
    status = p.charts.drop(columns=["group", "calendar"]).copy()
    status["last_measured_at_utc"] = timestamps(np.where(np.isfinite(last), last, np.nan))
    status["n_campaigns"] = measured.sum(axis=1)
    status["campaigns_per_year"] = campaigns
    status["n_baseline"] = p.baseline.count
    status["baseline_until_utc"] = timestamps(baseline_until(p, settings))
    status["n_learned"] = count_learned(charts, present)
    status["n_needed"] = charts.n_learning
    status["complete"] = p.baseline.complete
    for direction in ("down", "up"):
        status[f"run_length_{direction}"] = run_lengths(p.charts["band"], direction, settings)
    status["without_temperature"] = p.baseline.without_temperature
    status["detectable_pct"] = detectable
    status["stale_after_days"] = stale_after(p, settings)
    status["target_pct"] = targets(p.charts["band"], settings)
    status["worklist_rows"] = settings.worklist_rows
    status["drift_pct_per_year"] = np.where(is_too_short, np.nan, slope)
    status["drift_se_pct_per_year"] = np.where(is_too_short, np.nan, error)
    status["drift_p"] = np.where(is_too_short, np.nan, p_value)
    status["state"], status["reason"] = _states(charts, settings, status, last, present)
    return status


def count_learned(charts: Charts, present: np.ndarray) -> np.ndarray:
    """Number of campaigns from which the level of the present epoch is learned.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    present : (n_chart, n_campaign) array of bool
        Campaigns of the present epoch.

    Returns
    -------
    (n_chart,) array of int
        Number, 0 where an event is pending.
    """
    n_learned = np.sum(charts.learning & present & np.isfinite(charts.residual), axis=1)
    return np.where(charts.prepared.pending, 0, n_learned)


def baseline_until(p: Prepared, settings: TrendSettings) -> np.ndarray:
    """Time of the campaign that completed each baseline, nan where incomplete.

    That of a whole turnout is complete when it is long enough and those of enough sections are complete.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n_chart,) array of float
        Time. [d]
    """
    n_section = len(p.panel.charts)
    until = np.max(np.where(p.baseline.inside, p.time, -np.inf), axis=1, initial=-np.inf)
    until = np.where(p.baseline.complete, until, np.inf)
    for whole, members in enumerate(_members(p.panel.charts["group"].to_numpy()), start=n_section):
        ends = np.sort(until[members])
        enough = ends[settings.siblings_minimum] if len(ends) > settings.siblings_minimum else np.inf
        until[whole] = max(until[whole], enough)
    return np.where(np.isfinite(until), until, np.nan)


def _members(group: np.ndarray) -> list[np.ndarray]:
    """Arrays of the chart numbers of each group."""
    return np.split(np.arange(len(group)), np.flatnonzero(np.diff(group)) + 1) if len(group) else []


def stale_after(p: Prepared, settings: TrendSettings) -> np.ndarray:
    """Age at which a chart counts as not measured: the setting, or three of its own intervals.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n_chart,) array of float
        Age. [d]
    """
    return np.maximum(settings.not_measured_days, 3.0 * np.nan_to_num(p.interval))


def _newest_of_sections(p: Prepared, last: np.ndarray) -> np.ndarray:
    """Time of the last measurement; for the chart of a whole turnout that of any of its sections. [d]"""
    newest = last.copy()
    for whole, members in enumerate(_members(p.panel.charts["group"].to_numpy()), start=len(p.panel.charts)):
        newest[whole] = np.max(last[members])
    return newest


def _states(
    charts: Charts, settings: TrendSettings, status: pd.DataFrame, last: np.ndarray, present: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The state and the reason of every chart: the first rule that applies."""
    p = charts.prepared
    as_of = np.nan_to_num(p.panel.as_of, neginf=0.0)  # without any usable campaign in the fleet no chart is old
    stale = stale_after(p, settings)
    is_old = as_of - last > stale
    whole = status["section_id"].to_numpy() == WHOLE_TURNOUT
    # sections are measured, but too few of them are without an alarm for a median
    too_few = whole & is_old & (as_of - _newest_of_sections(p, last) <= stale)
    open_now = _last(charts.down_open) | _last(charts.up_open)
    constant = ~np.isfinite(charts.sigma).any(axis=1) | ~(p.spread > 0.0)
    constant[: len(p.panel.charts)] |= is_constant(p.panel.frequency)
    last_judged = np.max(np.where(np.isfinite(charts.z), p.time, -np.inf), axis=1, initial=-np.inf)
    no_temperature = p.baseline.complete & ~whole & (as_of - last_judged > stale)
    mostly_no_temperature = p.baseline.without_temperature > 0.5 * status["n_campaigns"].to_numpy()
    n_learned = status["n_learned"].to_numpy()
    relearn = p.baseline.complete & (p.pending | ((p.epoch[:, -1] > first_epoch(p)) & (n_learned < charts.n_learning)))
    too_noisy = ~(status["detectable_pct"].to_numpy() <= status["target_pct"].to_numpy())
    rules = [
        (~np.isfinite(last) & whole, "cannot_tell", "too_few_sections"),
        (~np.isfinite(last), "not_measured", "never"),
        (open_now & ~p.pending & ~(p.baseline.complete & constant & ~whole), "alarm", "threshold_crossed"),
        (too_few, "cannot_tell", "too_few_sections"),
        (_is_to_confirm(charts, present) & ~p.pending, "confirm_now", "far_outside"),
        (is_old, "not_measured", "too_long_ago"),
        (p.baseline.complete & constant & ~whole, "cannot_tell", "constant"),
        (no_temperature, "cannot_tell", "no_temperature"),
        (~p.baseline.complete & mostly_no_temperature, "cannot_tell", "no_temperature"),
        (~p.baseline.complete & whole & (p.baseline.count == 0), "cannot_tell", "too_few_sections"),
        (~p.baseline.complete, "learning", "baseline"),
        (relearn, "learning", "after_event"),
        (too_noisy, "cannot_tell", "too_noisy"),
    ]
    conditions = [rule[0] for rule in rules]
    state = np.select(conditions, [np.full(len(last), rule[1], object) for rule in rules], "ok")
    reason = np.select(conditions, [np.full(len(last), rule[2], object) for rule in rules], "")
    return state, reason


def _is_to_confirm(charts: Charts, present: np.ndarray) -> np.ndarray:
    """Whether the newest campaign of each chart with a value is far outside its expected value, (n_chart,)."""
    n_section = len(charts.prepared.panel.charts)
    measured = np.isfinite(np.vstack([charts.prepared.panel.frequency, charts.residual[n_section:]]))
    newest = measured & (np.cumsum(measured[:, ::-1], axis=1)[:, ::-1] == 1)
    return np.any(newest & present & np.isfinite(charts.deviation), axis=1)


def is_constant(frequency: np.ndarray, least: int = 8) -> np.ndarray:
    """Whether the last ``least`` values of a chart are all equal; False with fewer values.

    Parameters
    ----------
    frequency : (n_chart, n_campaign) array of float
        Frequencies, nan without one. [Hz]
    least : int
        Number of values that are compared.

    Returns
    -------
    (n_chart,) array of bool
        Whether they are equal, to the resolution of the registry.

    Examples
    --------
    >>> is_constant(np.array([[1.0] * 8 + [np.nan], [1.0] * 8 + [2.0]]))
    array([ True, False])
    """
    is_valid = np.isfinite(frequency)
    behind = np.cumsum(is_valid[:, ::-1], axis=1)[:, ::-1]
    last = is_valid & (behind <= least)
    high = np.max(np.where(last, frequency, -np.inf), axis=1, initial=-np.inf)
    low = np.min(np.where(last, frequency, np.inf), axis=1, initial=np.inf)
    return (last.sum(axis=1) >= least) & (high - low < FREQUENCY_RESOLUTION)


def _last(values: np.ndarray) -> np.ndarray:
    return values[:, -1] if values.shape[1] else np.zeros(len(values), dtype=values.dtype)
