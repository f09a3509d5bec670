"""Compute the CUSUM charts of all sections and turnouts at once.

Residuals are corrected for temperature and for the median of the sibling sections, then standardised and summed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.trend.charts import Charts
from turnout.trend.confirmation import far_deviations
from turnout.trend.epochs import by_epoch, expand_epochs
from turnout.trend.preparation import Prepared, first_epoch, stack_padded
from turnout.trend.quantities import targets
from turnout.trend.residuals import (
    Residuals,
    learning_campaigns,
    nearer_residuals,
    section_residuals,
    turnout_residuals,
)
from turnout.trend.threshold import run_lengths, threshold_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.config.settings.trend import TrendSettings


def cusum(
    z: np.ndarray,
    allowance: np.ndarray,
    threshold: np.ndarray,
    outlier: np.ndarray,
    confirmed: np.ndarray,
    active: np.ndarray,
    fresh: np.ndarray,
    closes_on_return: bool = True,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""One-sided CUSUM for a falling mean, in which one campaign alone cannot raise an alarm.

    .. math:: S_i = \max(0, S_{i-1} - z_i - k)

    A campaign with |z| beyond ``outlier`` is held: it does not count until the next campaign is beyond it on the same
    side. Then each of them, and every further one, adds ``confirmed``. A confirmed rise counts in full.

    The sum starts at 0 with every epoch. It keeps its value over campaigns that are not ``active`` (learning, no value,
    no temperature). An alarm opens when S > h. It closes when the epoch ends, when S is back at 0, or when S has fallen
    by h from its highest value of this alarm: a return needs the evidence of a change, however long the change lasted.
    S is 0 then. For a rising mean pass ``-z``.

    Parameters
    ----------
    z : (n_chart, n_campaign) array of float
        Standardised residuals.
    allowance : (n_chart, n_campaign) array of float
        k, in the same unit.
    threshold : (n_chart,) array of float
        H, in the same unit.
    outlier : (n_chart, n_campaign) array of float
        Limit of \|z\| beyond which a campaign must be confirmed, in the same unit.
    confirmed : (n_chart,) array of float
        What a confirmed outlier adds to the sum, in the same unit; above h / 2 two of them raise the alarm.
    active, fresh : (n_chart, n_campaign) arrays of bool
        Campaigns that count; campaigns that start an epoch.
    closes_on_return : bool
        Whether a fall by h closes an alarm. Without it, the alarm lasts until S is back at 0.

    Returns
    -------
    statistic : (n_chart, n_campaign) array of float
    open_alarm : (n_chart, n_campaign) array of bool
    began : (n_chart, n_campaign) array of int
        Last campaign with a value at which the sum was 0, -1 before the first. The change came after it.

    References
    ----------
    Page, Continuous inspection schemes, Biometrika 41, 1954. Lucas and Crosier, Robust CUSUM: a robustness study for
    CUSUM quality control schemes, Communications in Statistics 11, 1982, for the rule of two outliers in a row.

    Examples
    --------
    The fourth campaign alone is an outlier; the sixth confirms the fifth.

    >>> z, on = np.array([[0.0, -3.0, 1.0, -9.0, 0.0, -9.0, -9.0]]), np.ones((1, 7), bool)
    >>> s, alarm, began = cusum(z, np.ones((1, 7)), np.array([3.5]), np.full((1, 7), 4.0), np.array([3.0]), on, ~on)
    >>> print(s[0], alarm[0].astype(int), began[0])
    [0. 2. 0. 0. 0. 0. 6.] [0 0 0 0 0 0 1] [0 0 2 2 4 4 4]
    """
    n_chart, n_campaign = z.shape
    use = active & np.isfinite(z)
    value = np.where(use, z, 0.0)
    side = np.where(value < -outlier, -1, np.where(value > outlier, 1, 0)).astype(np.int8)
    gain = np.where(use, np.where(side < 0, confirmed[:, None], -value - allowance), 0.0).T.copy()
    counts = np.isfinite(z).T.copy()
    fresh, use, side = fresh.T.copy(), use.T.copy(), side.T.copy()
    statistic = np.zeros((n_campaign, n_chart))
    alarm_open = np.zeros((n_campaign, n_chart), dtype=bool)
    began = np.full((n_campaign, n_chart), -1, dtype=np.int32)
    total, alarm, since = np.zeros(n_chart), np.zeros(n_chart, dtype=bool), np.full(n_chart, -1, dtype=np.int32)
    highest = np.zeros(n_chart)
    last_side, held_gain = np.zeros(n_chart, dtype=np.int8), np.zeros(n_chart)
    for i in range(n_campaign):
        last_side, held_gain = np.where(fresh[i], 0, last_side), np.where(fresh[i], 0.0, held_gain)
        held = (side[i] != 0) & (side[i] != last_side)
        step = np.where(held, 0.0, gain[i] + np.where(use[i] & (side[i] == last_side), held_gain, 0.0))
        total, highest = np.where(fresh[i], 0.0, total), np.where(fresh[i], 0.0, highest)
        total = np.maximum(total + step, 0.0)
        held_gain = np.where(held, gain[i], np.where(use[i], 0.0, held_gain))
        last_side = np.where(use[i], side[i], last_side)
        if closes_on_return:
            total = np.where(total > highest - threshold, total, 0.0)
        resting = total == 0.0
        highest = np.where(resting, 0.0, np.maximum(highest, total))
        since = np.where(resting & (fresh[i] | (counts[i] & ~(held & (side[i] < 0)))), i, since)
        alarm = (alarm & ~resting & ~fresh[i]) | (total > threshold)
        statistic[i], alarm_open[i], began[i] = total, alarm, since
    return np.ascontiguousarray(statistic.T), np.ascontiguousarray(alarm_open.T), np.ascontiguousarray(began.T)


MAX_SIBLING_ROUNDS = 3  # iterations of section residuals and alarms, each of which decides which sections are siblings


def guard_factor(count: np.ndarray, small: np.ndarray, settings: TrendSettings) -> np.ndarray:
    """Factor on sigma for the error of a baseline; see docs/decisions/guard-factor.md.

    Parameters
    ----------
    count : (n_chart,) array of int
        Campaigns of the baseline.
    small : (n_chart,) array of bool
        Charts with the small allowance.
    settings : TrendSettings
        The factors at 52 campaigns.

    Returns
    -------
    (n_chart,) array of float
        Factor, above 1.

    Examples
    --------
    >>> from turnout.config.settings.trend import TrendSettings
    >>> guard_factor(np.array([52, 13]), np.array([False, False]), TrendSettings()).round(2)
    array([1.12, 1.63])
    """
    excess = np.where(small, settings.guard_small, settings.guard_large) - 1.0
    return 1.0 + excess * (52.0 / np.maximum(count, 1)) ** np.where(small, 1.0, 1.2)


def finish(p: Prepared, phi: np.ndarray, settings: TrendSettings) -> Charts:
    """Residuals, CUSUM and alarms of prepared charts.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    phi : (n_chart,) array of float
        Pooled autocorrelation of each chart.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    Charts
        Finished charts of the sections and turnouts.
    """
    n = len(p.panel.charts)
    widening = np.sqrt((1.0 + phi) / (1.0 - phi))
    with np.errstate(invalid="ignore"):
        visible = (
            targets(p.charts["band"], settings)
            >= settings.allowance_switch * p.spread * widening * settings.guard_large
        )
    allowance = np.where(visible, settings.allowance_large, settings.allowance_small)
    guard = guard_factor(p.baseline.count, ~visible, settings)
    n_learning = np.where(visible, settings.learning_large, settings.learning_small)
    window, settled = learning_campaigns(p, n_learning, n, settings.siblings_minimum + 1)
    chart_sums = _ChartSums(p, allowance, window, guard * widening, settings)
    sections, first, is_sibling = _siblings_without_alarm(p, window, settled, chart_sums, settings)
    alarmed = first["down_open"] | first["up_open"]
    turnouts = turnout_residuals(p, sections, window, settled, alarmed, settings)
    second = chart_sums(slice(n, None), turnouts)
    sections = _published_sums(p, sections, first, alarm_campaigns(second), chart_sums)
    sums = {name: np.concatenate([first[name], second[name]]) for name in first}
    joint = {k: np.vstack([getattr(sections, k), getattr(turnouts, k)]) for k in ("values", "residual", "sigma")}
    level, shift = (stack_padded(getattr(sections, k), getattr(turnouts, k)) for k in ("level", "shift"))
    n_learned = by_epoch(joint["values"], window & np.isfinite(joint["values"]), p.epoch, level.shape[1])[1]
    charts = Charts(
        p, allowance, n_learning, guard, phi, widening, level, shift, n_learned, joint["residual"], joint["sigma"],
        fitted=joint["values"] - joint["residual"], learning=window, is_sibling=is_sibling, **sums,
    )  # fmt: skip
    charts.deviation = far_deviations(charts, settings)
    return charts


def alarm_campaigns(sums: Mapping[str, np.ndarray]) -> np.ndarray:
    """Campaigns from the onset of each alarm, not included, to its last one.

    Parameters
    ----------
    sums : mapping
        ``down_open``, ``up_open``, ``down_began`` and ``up_began``, as ``cusum`` gives them.

    Returns
    -------
    (n_chart, n_campaign) array of bool

    Examples
    --------
    >>> never, began = np.zeros((1, 5), bool), np.array([[0, 1, 1, 1, 4]])
    >>> is_open = np.array([[False, False, False, True, False]])
    >>> alarm_campaigns({"down_open": is_open, "down_began": began, "up_open": never, "up_began": began})
    array([[False, False,  True,  True, False]])
    """
    n_chart, n_campaign = sums["down_open"].shape
    change = np.zeros((n_chart, n_campaign + 1), dtype=np.int64)
    for direction in ("down", "up"):
        chart, campaign = np.nonzero(sums[f"{direction}_open"])
        np.add.at(change, (chart, sums[f"{direction}_began"][chart, campaign] + 1), 1)
        np.add.at(change, (chart, campaign + 1), -1)
    return np.cumsum(change, axis=1)[:, :-1] > 0


def _published_sums(
    p: Prepared, sections: Residuals, sums: dict[str, np.ndarray], alarms: np.ndarray, chart_sums: _ChartSums
) -> Residuals:
    """Residuals of the sections, ``nearer_residuals`` in the ``alarms`` of their turnouts; ``sums`` are made again.

    Of sections with an alarm they are made again as well: now a return closes it.
    """
    common = alarms[p.panel.charts["group"].to_numpy()]
    row = np.flatnonzero(common.any(axis=1) | (sums["down_open"] | sums["up_open"]).any(axis=1))
    if not len(row):
        return sections
    if common.any():
        sections = nearer_residuals(p, sections, common)
    for name, values in chart_sums(row, Residuals(*(array[row] for array in vars(sections).values()))).items():
        sums[name][row] = values
    return sections


def _siblings_without_alarm(
    p: Prepared, window: np.ndarray, settled: np.ndarray, chart_sums: _ChartSums, settings: TrendSettings
) -> tuple[Residuals, dict[str, np.ndarray], np.ndarray]:
    """Residuals and sums of the sections, and which of their campaigns serve as siblings: none that is in alarm.

    Sections with a large change may first raise a false alarm in an unchanged one. Without them its alarm closes, and
    it is a sibling again. No return closes an alarm here: where most siblings have changed as well, a changed section
    differs from them as little as one that has returned.
    """
    n = len(p.panel.charts)
    is_sibling = settled[:n]
    sections: Any = None
    sums: Any = None
    for _ in range(MAX_SIBLING_ROUNDS):
        sections = sums = None  # free the arrays of the last round before the next: they set the peak of memory
        sections = section_residuals(p, window, settled, is_sibling, settings)
        sums = chart_sums(slice(0, n), sections, closes_on_return=False)
        before, is_sibling = is_sibling, settled[:n] & ~(sums["down_open"] | sums["up_open"])
        if np.array_equal(before, is_sibling):
            break
    return sections, sums, before


def _thresholds(length: np.ndarray, allowance: np.ndarray) -> np.ndarray:
    """(n_chart,) thresholds for the mean run ``length`` and the ``allowance`` of each chart."""
    pairs, where = np.unique(np.column_stack([length, allowance]), axis=0, return_inverse=True)
    return np.array([threshold_for(float(n), float(k)) for n, k in pairs] or [0.0])[where.ravel()]


LAW_QUANTILE = 2.0  # standard deviations of the temperature law's error that the allowance of the sum covers


def _sigma_of_sum(residuals: Residuals, allowance: np.ndarray) -> np.ndarray:
    """Standard deviation for the sum, so wide that ``LAW_QUANTILE`` errors of the law stay within the allowance. [%]

    The error of the temperature law is the same at every campaign of a season, so a sum does not average it as it
    averages the error of a campaign. ``allowance`` (n_chart,) is k in standard deviations of the residual.
    """
    excess = np.maximum((LAW_QUANTILE / allowance) ** 2 - 1.0, 0.0)
    return np.sqrt(residuals.sigma**2 + excess[:, None] * residuals.temperature_variance)


class _ChartSums:
    """Standardise residuals and sum them, for the sections first and then for the turnouts."""

    def __init__(
        self, p: Prepared, allowance: np.ndarray, window: np.ndarray, factor: np.ndarray, settings: TrendSettings
    ) -> None:
        self.p, self.allowance, self.window, self.factor, self.settings = p, allowance, window, factor, settings

    def __call__(
        self, rows: slice | np.ndarray, residuals: Residuals, closes_on_return: bool = True
    ) -> dict[str, np.ndarray]:
        p, settings, window = self.p, self.settings, self.window[rows]
        epoch = p.epoch[rows]
        usable = window & np.isfinite(residuals.values)
        _, n_learned = by_epoch(residuals.values, usable, epoch, int(epoch.max(initial=0)) + 1)
        later = epoch > first_epoch(p)[rows, None]
        extra = np.where(later, 1.0 / np.sqrt(np.maximum(expand_epochs(n_learned, epoch), 1)), 0.0)
        k, factor = self.allowance[rows], self.factor[rows]
        with np.errstate(invalid="ignore", divide="ignore"):
            z = residuals.residual / (_sigma_of_sum(residuals, k * factor) * factor[:, None])
        active = np.isfinite(z) & ~window & ~p.aside[rows] & p.baseline.complete[rows, None]
        fresh = np.diff(epoch, axis=1, prepend=0) > 0
        sums = {"z": z, "extra": extra}
        bands = p.charts["band"].to_numpy()[rows]
        for name, sign in (("down", 1.0), ("up", -1.0)):
            h = _thresholds(run_lengths(bands, name, settings), k)
            single = settings.single_share * h
            outlier = np.minimum(single[:, None] + k[:, None] + extra, settings.outlier_limit)
            sums[f"threshold_{name}"] = h
            sums[name], sums[f"{name}_open"], sums[f"{name}_began"] = cusum(
                sign * z, k[:, None] + extra, h, outlier, single, active, fresh, closes_on_return
            )
        return sums
