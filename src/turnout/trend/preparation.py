"""Prepare the charts of a panel: baselines, spreads and siblings of sections and whole turnouts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from turnout.trend.baseline import (
    Baseline,
    baseline_window,
    fit_baseline,
    lone_outliers,
    spread_and_autocorrelation,
    usual_interval,
)
from turnout.trend.curvature import with_curved_laws
from turnout.trend.epochs import by_epoch, epochs_of, expand_epochs
from turnout.trend.panel import WHOLE_TURNOUT, Panel
from turnout.trend.siblings import median_of_group, median_of_siblings

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings


MAX_ROUNDS = 2  # searches for outliers: those of other sections, and a slope bent by one, hide some at first


@dataclass
class Prepared:
    """A panel with its baselines, before the autocorrelation is pooled over the fleet.

    ``charts`` are those of the panel and, at the end, the medians of whole turnouts (``section_id`` "*"), one per
    turnout, band and source. ``values`` (sections alone) is the frequency in percent of f0, corrected for temperature,
    with the level still in it. ``aside`` marks campaigns that do not count: the ``lone_outliers`` of complete
    baselines of sections. ``spread`` [%] is that of the residual in the baseline,
    ``spread_alone`` that without siblings, ``autocorrelation`` the lag-one coefficient; each has one value per chart.
    """

    panel: Panel
    charts: pd.DataFrame
    time: np.ndarray
    baseline: Baseline
    values: np.ndarray
    aside: np.ndarray
    epoch: np.ndarray
    started: np.ndarray
    pending: np.ndarray
    interval: np.ndarray
    spread: np.ndarray
    spread_alone: np.ndarray
    autocorrelation: np.ndarray
    with_siblings: np.ndarray


def prepare(panel: Panel, events: pd.DataFrame | None, settings: TrendSettings) -> Prepared:
    """Baselines of all charts of a panel, with and without siblings, and of the turnouts' medians.

    Parameters
    ----------
    panel : Panel
        Values of charts x campaigns.
    events : DataFrame or None
        Rows of the table ``events``.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    Prepared
        Charts of the sections, then those of the turnouts.
    """
    time = panel.chart_time
    epoch, pending, started = epochs_of(panel.charts, time, events)
    aside = np.zeros(panel.frequency.shape, dtype=bool)
    fitted = _fit_sections(panel, time, epoch, settings, aside)
    for _ in range(MAX_ROUNDS):
        alone = _alone_in_baseline(fitted, epoch)
        if not alone.any():
            break
        aside |= alone
        fitted = _fit_sections(panel, time, epoch, settings, aside)
    with_siblings = fitted.with_siblings
    section = Prepared(
        panel, panel.charts, time, fitted.baseline, fitted.values, aside, epoch, started, pending,
        usual_interval(time, fitted.baseline.inside), np.where(with_siblings, fitted.spread, fitted.spread_alone),
        fitted.spread_alone, np.where(with_siblings, fitted.autocorrelation, fitted.autocorrelation_alone),
        with_siblings,
    )  # fmt: skip
    return _with_turnout_charts(section, events, settings)


@dataclass(frozen=True)
class _FittedSections:
    """Baselines of the sections. ``straight`` are the values with the straight law; ``residual``, with siblings, covers
    the columns of the baselines."""

    baseline: Baseline
    values: np.ndarray
    straight: np.ndarray
    residual: np.ndarray
    spread: np.ndarray
    spread_alone: np.ndarray
    autocorrelation: np.ndarray
    autocorrelation_alone: np.ndarray
    with_siblings: np.ndarray


def _fit_sections(
    panel: Panel, time: np.ndarray, epoch: np.ndarray, settings: TrendSettings, aside: np.ndarray
) -> _FittedSections:
    base, straight = fit_baseline(panel.frequency, panel.temperature, time, epoch, settings, aside)
    baseline_span = slice(0, int(np.max(np.flatnonzero(base.inside.any(axis=0)), initial=-1)) + 1)
    inside, epoch_base, time_base = base.inside[:, baseline_span], epoch[:, baseline_span], time[:, baseline_span]
    centred = np.where(inside, _centred_on_baseline(base, straight, epoch)[:, baseline_span], np.nan)
    group = panel.charts["group"].to_numpy()
    median, n_siblings = median_of_siblings(centred, inside, group)
    enough = inside & (n_siblings >= settings.siblings_minimum)
    with_siblings = enough.sum(axis=1) >= settings.siblings_share * np.maximum(inside.sum(axis=1), 1)
    residual = np.where(with_siblings[:, None] & enough, centred - median, np.nan)
    sd_alone, phi_alone = spread_and_autocorrelation(centred, inside, epoch_base, base.freedom, time_base)
    freedom_siblings = base.freedom - np.sum(inside & ~enough, axis=1)
    sd_sibling, phi = spread_and_autocorrelation(residual, enough, epoch_base, freedom_siblings, time_base)
    with_siblings &= _has_sibling_gain(sd_sibling, sd_alone, group)
    curved, values = with_curved_laws(base, straight, panel.temperature, time, epoch, phi_alone, ~with_siblings)
    if curved is not base:
        base, centred = curved, np.where(inside, _centred_on_baseline(curved, values, epoch)[:, baseline_span], np.nan)
        sd_alone, phi_alone = spread_and_autocorrelation(centred, inside, epoch_base, base.freedom, time_base)
    return _FittedSections(base, values, straight, residual, sd_sibling, sd_alone, phi, phi_alone, with_siblings)


def _alone_in_baseline(fitted: _FittedSections, epoch: np.ndarray) -> np.ndarray:
    """(n_section, n_campaign) mask of the ``lone_outliers`` of complete baselines, with and without siblings.

    One of them would widen a chart for good. Nothing outside the baseline is used, so that the mask does not change
    later. The temperature law is straight here: a curved one bends towards a campaign on a warm or cold day.
    """
    use = fitted.baseline.inside & fitted.baseline.complete[:, None]
    n_base = fitted.residual.shape[1]
    alone = np.zeros(use.shape, dtype=bool)
    for values in (fitted.straight[:, :n_base], fitted.residual):
        alone[:, :n_base] |= lone_outliers(np.where(use[:, :n_base], values, np.nan), epoch[:, :n_base])
    return alone


def _centred_on_baseline(base: Baseline, values: np.ndarray, epoch: np.ndarray) -> np.ndarray:
    """Values less the mean of the baseline in their epoch; nan in epochs without a campaign of the baseline."""
    n_epoch = int(epoch.max(initial=0)) + 1
    level, _ = by_epoch(np.where(base.inside, values, 0.0), base.inside, epoch, n_epoch)
    return values - expand_epochs(level, epoch)


def _has_sibling_gain(spread_siblings: np.ndarray, spread_alone: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Whether a turnout's sections scatter less about their median than alone; one answer for all of them."""
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.log(spread_alone / spread_siblings)
    is_valid = np.isfinite(gain)
    total = np.bincount(group, weights=np.where(is_valid, gain, 0.0))
    return (total > 0.0)[group]


def _with_turnout_charts(p: Prepared, events: pd.DataFrame | None, settings: TrendSettings) -> Prepared:
    """Append one chart per turnout, band and source: the median of its sections, to detect a change common to all.

    Its baseline follows the rule of the sections, over the campaigns in which enough of them have a value. Their own
    baselines may hardly overlap, for instance where some sections are measured later or in summer only.
    """
    group, need = p.charts["group"].to_numpy(), settings.siblings_minimum + 1
    first = np.flatnonzero(np.diff(group, prepend=-1))
    charts = p.charts.iloc[first].assign(section_id=WHOLE_TURNOUT)
    time = p.time[first]
    epoch, pending, started = epochs_of(charts, time, events)
    centred = np.where(p.aside, np.nan, _centred_on_baseline(p.baseline, p.values, p.epoch))
    enough, members = (
        np.add.reduceat(flags.astype(int), first) if len(first) else flags[:0].astype(int)
        for flags in (np.isfinite(centred), p.baseline.complete)
    )
    inside, is_long = baseline_window(enough >= need, time, settings.baseline_days, settings.baseline_campaigns)
    complete = is_long & (members >= need)
    span = slice(0, int(np.max(np.flatnonzero(inside.any(axis=0)), initial=-1)) + 1)
    median, _ = median_of_group(centred[:, span], np.isfinite(centred[:, span]), group)
    n_base = inside.sum(axis=1)
    freedom = n_base - 2
    spread, autocorrelation = spread_and_autocorrelation(
        np.where(inside[:, span], median, np.nan), inside[:, span], epoch[:, span], freedom, time[:, span]
    )
    nothing, no_campaign = np.full(len(first), np.nan), np.zeros(len(first), int)
    base = Baseline(
        nothing, nothing, nothing, nothing, nothing, nothing, n_base, freedom, complete, no_campaign, inside
    )  # fmt: skip
    joined = Baseline(*(np.concatenate([a, b]) for a, b in zip(vars(p.baseline).values(), vars(base).values())))
    return Prepared(
        p.panel, pd.concat([p.charts, charts], ignore_index=True), np.vstack([p.time, time]), joined, p.values,
        np.vstack([p.aside, np.zeros(time.shape, bool)]), np.vstack([p.epoch, epoch]),
        stack_padded(p.started, started), np.append(p.pending, pending),
        np.append(p.interval, usual_interval(time, inside)), np.append(p.spread, spread),
        np.append(p.spread_alone, spread), np.append(p.autocorrelation, autocorrelation),
        np.append(p.with_siblings, np.zeros(len(first), bool)),
    )  # fmt: skip


def stack_padded(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Stack two arrays vertically; the narrower one is filled with nan on the right.

    Parameters
    ----------
    a : (n, m) array of float
        First array.
    b : (k, l) array of float
        Second array.

    Returns
    -------
    (n + k, max(m, l)) array of float
        Rows of ``a``, then those of ``b``.
    """
    width = max(a.shape[1], b.shape[1])
    return np.vstack([np.pad(x, ((0, 0), (0, width - x.shape[1])), constant_values=np.nan) for x in (a, b)])


def first_epoch(p: Prepared) -> np.ndarray:
    """Epoch in which each chart's baseline begins. Its level needs no extra allowance: the guard factor covers it.

    Parameters
    ----------
    p : Prepared
        Prepared charts.

    Returns
    -------
    (n_chart,) array of int
        Number of the epoch.
    """
    column = np.argmax(p.baseline.inside, axis=1)
    return p.epoch[np.arange(len(p.epoch)), column]
