"""Decide the state of each chart today, and the reason.

States are ok, alarm, confirm now, learning, cannot tell and not measured.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.detectability import detectable_shift
from turnout.trend.drift import slopes, span
from turnout.trend.epochs import by_epoch
from turnout.trend.panel import WHOLE_TURNOUT
from turnout.trend.quantities import targets
from turnout.trend.residuals import FREQUENCY_RESOLUTION, first_epoch, slope_variance
from turnout.trend.threshold import run_lengths
from turnout.trend.times import timestamps

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.charts import Charts
    from turnout.trend.residuals import Prepared


def detectable_change(charts: Charts, settings: TrendSettings) -> tuple[np.ndarray, np.ndarray]:
    """Smallest change that each chart detects within a year with the set probability, and its campaigns a year.

    It is simulated (``detectability``) for the number of campaigns of the baseline and of a year, the guard factor, the
    pooled autocorrelation and the allowance of the present epoch, and scaled by the spread of the baseline with the
    unknown part of the temperature slope.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n_chart,) arrays of float and int
        Detectable change [%] and campaigns a year.
    """
    campaigns = campaigns_a_year(charts.prepared)
    extra = charts.extra[:, -1] if charts.extra.shape[1] else np.zeros(len(charts.allowance))
    epoch = charts.prepared.epoch[:, -1] if charts.extra.shape[1] else np.zeros(len(extra), dtype=int)
    return detectable_in_epoch(
        charts, np.arange(len(extra)), epoch, charts.allowance + extra, campaigns, settings
    ), campaigns


def campaigns_a_year(p: Prepared) -> np.ndarray:
    """Usual number of campaigns a year of each chart.

    Parameters
    ----------
    p : Prepared
        Prepared charts.

    Returns
    -------
    (n_chart,) array of int
        Number, 0 to 366.
    """
    with np.errstate(invalid="ignore"):
        return np.clip(np.nan_to_num(np.round(DAYS_PER_YEAR / p.interval)), 0, 366).astype(int)


def spread_in(charts: Charts, chart: np.ndarray, epoch: np.ndarray) -> np.ndarray:
    """Spread of charts in an epoch: that without siblings where none was known.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    chart : (n,) array of int
        Numbers of charts.
    epoch : (n,) array of int
        Epoch of each of these charts.

    Returns
    -------
    (n,) array of float
        Spread. [%]
    """
    alone = (charts.n_learned[chart, epoch] > 0) & ~np.isfinite(charts.shift[chart, epoch])
    return np.where(alone, charts.prepared.spread_alone[chart], charts.prepared.spread[chart])


def detectable_in_epoch(
    charts: Charts,
    chart: np.ndarray,
    epoch: np.ndarray,
    allowance: np.ndarray,
    campaigns: np.ndarray,
    settings: TrendSettings,
) -> np.ndarray:
    """Detectable change of charts in an epoch.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    chart : (n,) array of int
        Numbers of charts.
    epoch : (n,) array of int
        Epoch of each of these charts.
    allowance : (n,) array of float
        Allowance of each. [sd]
    campaigns : (n,) array of int
        Campaigns a year of each.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n,) array of float
        Detectable change. [%]
    """
    p = charts.prepared
    harmful = np.minimum(charts.threshold_down, charts.threshold_up)[chart]
    learned = np.where(epoch > first_epoch(p)[chart], charts.n_learned[chart, epoch], 0)
    keys = np.column_stack(
        [
            harmful,
            np.round(allowance, 1),
            _similar(campaigns),
            _similar(p.baseline.count[chart]),
            _similar(learned),
            np.round(charts.guard[chart], 2),
            np.round(charts.autocorrelation[chart], 1),
        ]
    )
    unique, where = np.unique(keys, axis=0, return_inverse=True)
    rules = settings.single_share, settings.outlier_limit, settings.detectable_probability
    shift = [
        detectable_shift(h, k, int(year), int(n_base), int(n_level), guard, phi, *rules)
        for h, k, year, n_base, n_level, guard, phi in unique.tolist()
    ]
    spread = np.hypot(spread_in(charts, chart, epoch), temperature_spread(charts)[chart, epoch])
    return np.array(shift)[where.ravel()] * spread * (charts.guard * charts.widening)[chart]


def _similar(count: np.ndarray) -> np.ndarray:
    """Numbers of campaigns, those above 12 rounded to steps of a tenth, so that similar charts share a simulation.

    >>> _similar(np.array([0, 12, 51, 52, 53]))
    array([ 0, 12, 50, 50, 55])
    """
    steps = np.round(np.log(np.maximum(count, 12) / 12.0) / np.log(1.1))
    return np.where(count <= 12, count, np.round(12.0 * 1.1**steps)).astype(int)


def temperature_spread(charts: Charts) -> np.ndarray:
    """Spread that the unknown temperature slope adds in each epoch.

    It is the root mean square over the campaigns of the epoch. Only campaigns where this part exceeds the spread add to
    it.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.

    Returns
    -------
    (n_chart, n_epoch) array of float
        Spread. [%]
    """
    p = charts.prepared
    variance, n_epoch = _slope_variances(charts), int(p.epoch.max(initial=0)) + 1
    unknown = variance > p.spread[:, None] ** 2
    rows = np.flatnonzero(unknown.any(axis=1))  # few charts, or none
    added = np.where(unknown[rows], variance[rows], 0.0)
    mean, _ = by_epoch(added, np.isfinite(charts.residual[rows]), p.epoch[rows], n_epoch)
    spread = np.zeros((len(unknown), n_epoch))
    spread[rows] = np.sqrt(np.nan_to_num(mean))
    return spread


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
    status = p.charts.drop(columns=["group", "visits"]).copy()
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


def is_temperature_known(charts: Charts) -> np.ndarray:
    """Campaigns at which the error of the temperature slope is less than the spread.

    A drift of the other campaigns may be seasonal.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.

    Returns
    -------
    (n_chart, n_campaign) array of bool
        True where the error is smaller.
    """
    return _slope_variances(charts) <= charts.prepared.spread[:, None] ** 2


def _slope_variances(charts: Charts) -> np.ndarray:
    """Variance that the error of the temperature slope adds to each value, (n_chart, n_campaign). [%²]"""
    p, n = charts.prepared, len(charts.prepared.panel.charts)
    return np.vstack([slope_variance(p, charts.learning[:n]), charts.sigma[n:] ** 2 - p.spread[n:, None] ** 2])


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

    That of a whole turnout is complete when those of enough sections are.

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
        until[whole] = ends[settings.siblings_minimum] if len(ends) > settings.siblings_minimum else np.inf
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
        (_is_to_confirm(charts, present) & ~p.pending, "confirm_now", "far_outside"),
        (too_few, "cannot_tell", "too_few_sections"),
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
