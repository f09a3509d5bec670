"""Compute the smallest change that each chart detects, and the spread that its temperature slope adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.baseline import mean_interval
from turnout.trend.detectability import detectable_shift
from turnout.trend.epochs import by_epoch
from turnout.trend.preparation import first_epoch
from turnout.trend.residuals import temperature_variance

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.charts import Charts
    from turnout.trend.preparation import Prepared


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
    """Mean number of campaigns a year of each chart, from the intervals of its baseline.

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
        rate = DAYS_PER_YEAR / mean_interval(p.time, p.baseline.inside)
        return np.clip(np.nan_to_num(np.round(rate)), 0, 366).astype(int)


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
    variance, n_epoch = _temperature_variances(charts), int(p.epoch.max(initial=0)) + 1
    unknown = variance > p.spread[:, None] ** 2
    rows = np.flatnonzero(unknown.any(axis=1))  # few charts, or none
    added = np.where(unknown[rows], variance[rows], 0.0)
    mean, _ = by_epoch(added, np.isfinite(charts.residual[rows]), p.epoch[rows], n_epoch)
    spread = np.zeros((len(unknown), n_epoch))
    spread[rows] = np.sqrt(np.nan_to_num(mean))
    return spread


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
    return _temperature_variances(charts) <= charts.prepared.spread[:, None] ** 2


def _temperature_variances(charts: Charts) -> np.ndarray:
    """Variance that the error of the temperature slope adds to each value, (n_chart, n_campaign). [%²]"""
    p, n = charts.prepared, len(charts.prepared.panel.charts)
    return np.vstack([temperature_variance(p, charts.learning[:n]), charts.sigma[n:] ** 2 - p.spread[n:, None] ** 2])
