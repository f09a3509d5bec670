"""Compute baselines and residuals of all charts of a panel, sections and whole turnouts.

The residual of a section is its value less the level of the epoch and less the median of its sibling sections.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from turnout.trend.baseline import Baseline, baseline_window, fit_baseline, spread_and_autocorrelation, usual_interval
from turnout.trend.curvature import covers_the_year, fit_curved_law, with_curved_laws
from turnout.trend.epochs import by_epoch, epochs_of, expand_epochs
from turnout.trend.panel import WHOLE_TURNOUT, Panel
from turnout.trend.siblings import median_of_group, median_of_siblings

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings


@dataclass
class Prepared:
    """A panel with its baselines, before the autocorrelation is pooled over the fleet.

    ``charts`` are those of the panel and, at the end, the medians of whole turnouts (``section_id`` "*"), one per
    turnout, band and source. ``values`` (sections alone) is the frequency in percent of f0, corrected for temperature,
    with the level still in it. ``spread`` [%] is that of the residual in the baseline, ``spread_alone`` that without
    siblings, ``autocorrelation`` the lag-one coefficient; each has one value per chart.
    """

    panel: Panel
    charts: pd.DataFrame
    time: np.ndarray
    baseline: Baseline
    values: np.ndarray
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
    base, values = fit_baseline(panel.frequency, panel.temperature, time, epoch, settings)
    baseline_span = slice(0, int(np.max(np.flatnonzero(base.inside.any(axis=0)), initial=-1)) + 1)
    inside, epoch_base, time_base = base.inside[:, baseline_span], epoch[:, baseline_span], time[:, baseline_span]
    centred = np.where(inside, _centred_on_baseline(base, values, epoch)[:, baseline_span], np.nan)
    group = panel.charts["group"].to_numpy()
    median, n_siblings = median_of_siblings(centred, inside, group)
    enough = inside & (n_siblings >= settings.siblings_minimum)
    with_siblings = enough.sum(axis=1) >= settings.siblings_share * np.maximum(inside.sum(axis=1), 1)
    residual = np.where(with_siblings[:, None] & enough, centred - median, np.nan)
    sd_alone, phi_alone = spread_and_autocorrelation(centred, inside, epoch_base, base.freedom, time_base)
    freedom_siblings = base.freedom - np.sum(inside & ~enough, axis=1)
    sd_sibling, phi = spread_and_autocorrelation(residual, enough, epoch_base, freedom_siblings, time_base)
    with_siblings &= _has_sibling_gain(sd_sibling, sd_alone, group)
    curved, values = with_curved_laws(base, values, panel.temperature, time, epoch, phi_alone, ~with_siblings)
    if curved is not base:
        base, centred = curved, np.where(inside, _centred_on_baseline(curved, values, epoch)[:, baseline_span], np.nan)
        sd_alone, phi_alone = spread_and_autocorrelation(centred, inside, epoch_base, base.freedom, time_base)
    section = Prepared(
        panel, panel.charts, time, base, values, epoch, started, pending, usual_interval(time, base.inside),
        np.where(with_siblings, sd_sibling, sd_alone), sd_alone, np.where(with_siblings, phi, phi_alone), with_siblings,
    )  # fmt: skip
    return _with_turnout_charts(section, events, settings)


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
    centred = _centred_on_baseline(p.baseline, p.values, p.epoch)
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
        np.vstack([p.epoch, epoch]), stack_padded(p.started, started), np.append(p.pending, pending),
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


FREQUENCY_RESOLUTION = 0.001  # Hz, of frequencies in the registry; values that differ by less are equal


@dataclass
class Residuals:
    """Residuals of charts, all in percent of f0.

    (n_chart, n_campaign): ``values``, ``residual``, its ``sigma``, ``temperature_variance`` (the part of sigma² from
    the errors of the temperature law), and ``centred``, the values less their own level. (n_chart, n_epoch): ``level``
    and ``shift``, the mean difference to the siblings.
    """

    values: np.ndarray
    residual: np.ndarray
    sigma: np.ndarray
    temperature_variance: np.ndarray
    level: np.ndarray
    shift: np.ndarray
    centred: np.ndarray


def _usable(p: Prepared, n_section: int) -> np.ndarray:
    usable = np.isfinite(p.values)
    return np.vstack([usable, np.zeros((len(p.epoch) - n_section, usable.shape[1]), dtype=bool)])


def learning_campaigns(p: Prepared, n_learning: np.ndarray, n_section: int, need: int) -> tuple[np.ndarray, np.ndarray]:
    """Masks of campaigns from which a level is learned, and of settled campaigns.

    A level is learned from the baseline and from the first ``n_learning`` campaigns of every later epoch. A settled
    campaign has a complete baseline and is not one from which a later level is learned. Only settled campaigns serve
    as siblings of settled ones.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    n_learning : (n_chart,) array of int
        Campaigns from which the level of a later epoch is learned.
    n_section : int
        Number of charts of sections; those of turnouts follow.
    need : int
        Sections that the median of a turnout needs.

    Returns
    -------
    two (n_chart, n_campaign) arrays of bool
        Campaigns from which a level is learned, and settled campaigns.
    """
    usable = _usable(p, n_section)
    group = p.panel.charts["group"].to_numpy()
    _, members = median_of_group(p.values, usable[:n_section], group)
    usable[n_section:] = p.baseline.inside[n_section:] | (members >= need)
    later = p.epoch > first_epoch(p)[:, None]
    running = np.cumsum(usable, axis=1)
    fresh = np.diff(p.epoch, axis=1, prepend=0) > 0
    before = np.maximum.accumulate(np.where(fresh, running - usable, 0), axis=1)
    rank = running - before
    window = usable & (p.baseline.inside | (later & (rank <= n_learning[:, None])))
    settled = usable & p.baseline.complete[:, None] & ~(window & later)
    return window, settled


def section_residuals(
    p: Prepared, window: np.ndarray, settled: np.ndarray, is_sibling: np.ndarray, settings: TrendSettings
) -> Residuals:
    """Residuals of the sections.

    Sections in alarm do not serve as siblings: a large change of one section would shift the median of a few and raise
    false alarms in the others.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    window : (n_chart, n_campaign) array of bool
        Campaigns from which a level is learned, from ``learning_campaigns``.
    settled : (n_chart, n_campaign) array of bool
        Settled campaigns, from ``learning_campaigns``.
    is_sibling : (n_section, n_campaign) array of bool
        Settled campaigns that serve as siblings of others.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    Residuals
        Residuals of the sections alone.
    """
    n = len(p.panel.charts)
    group, epoch = p.panel.charts["group"].to_numpy(), p.epoch[:n]
    level, e = _centre(p.values, window[:n], epoch)
    median, n_siblings = median_of_siblings(e, is_sibling, group)
    enough = np.isfinite(e) & (n_siblings >= settings.siblings_minimum)
    is_unsettled = np.isfinite(e) & ~settled[:n] & ~enough
    if is_unsettled.any():
        median_any, n_any = median_of_siblings(e, np.isfinite(e), group)
        use = is_unsettled & (n_any >= settings.siblings_minimum)
        median, enough = np.where(use, median_any, median), enough | use
    enough &= p.with_siblings[:n, None]
    enough &= _has_sibling_level(window[:n], enough, epoch, first_epoch(p)[:n], settings.siblings_share)
    shift, residual_siblings = _centre(np.where(enough, e - median, np.nan), window[:n] & enough, epoch)
    variance = temperature_variance(p, window[:n])
    sigma = _sigma(p, enough, variance)
    return Residuals(p.values, np.where(enough, residual_siblings, e), sigma, variance, level, shift, e)


def _has_sibling_level(
    window: np.ndarray, with_siblings: np.ndarray, epoch: np.ndarray, first: np.ndarray, share: float
) -> np.ndarray:
    """Campaigns of epochs in which the usual difference to the siblings is known, (n_chart, n_campaign).

    In a later epoch it is known if a ``share`` of the campaigns that learned the level were ``with_siblings``. A
    section measured alone gives its level, but not its difference to the others.
    """
    n_epoch = int(epoch.max(initial=0)) + 1
    n_learned, n_with_siblings = (by_epoch(epoch, mask, epoch, n_epoch)[1] for mask in (window, window & with_siblings))
    later = np.arange(n_epoch) > first[:, None]
    return expand_epochs((n_with_siblings > 0) & (n_with_siblings >= share * n_learned * later), epoch)


def turnout_residuals(
    p: Prepared,
    sections: Residuals,
    window: np.ndarray,
    settled: np.ndarray,
    alarmed: np.ndarray,
    settings: TrendSettings,
) -> Residuals:
    """Residuals of the medians of the turnouts, which show a change common to all sections.

    Sections in ``alarmed``, whose own alarm is open, do not count: a large change of one section would shift the median
    of a few. A curvature of the temperature law that the sections share, and their siblings remove, is fitted here.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    sections : Residuals
        Residuals of the sections.
    window : (n_chart, n_campaign) array of bool
        Campaigns from which a level is learned, from ``learning_campaigns``.
    settled : (n_chart, n_campaign) array of bool
        Settled campaigns, from ``learning_campaigns``.
    alarmed : (n_section, n_campaign) array of bool
        Campaigns of sections whose own alarm is open.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    Residuals
        Residuals of the turnouts alone.
    """
    n, need = len(p.panel.charts), settings.siblings_minimum + 1
    group, epoch = p.panel.charts["group"].to_numpy(), p.epoch[n:]
    median, count = median_of_group(sections.centred, settled[:n] & ~alarmed, group)
    young, young_count = median_of_group(sections.centred, np.isfinite(sections.centred), group)
    whole = np.where(count >= need, median, np.where((young_count >= need) & window[n:], young, np.nan))
    temperature, _ = median_of_group(p.panel.temperature, np.isfinite(p.panel.temperature), group)
    inside = p.baseline.inside[n:]
    seasons = covers_the_year(p.time[n:], inside)
    law = fit_curved_law(whole, temperature, inside, epoch, p.autocorrelation[n:], in_every_season=seasons)
    whole = whole - law.term(temperature)
    level, residual = _centre(whole, window[n:] & np.isfinite(whole), epoch)
    common, _ = median_of_group(temperature_variance(p, window[:n]), settled[:n] & ~alarmed, group)
    excess = _excess(temperature, window[n:], inside, epoch)
    common = np.nan_to_num(common) + law.error[:, None] ** 2 * excess**2
    sigma = np.sqrt((law.spread_ratio * p.spread[n:])[:, None] ** 2 + common)
    sigma = np.where(sigma > 0.0, sigma, np.nan)
    return Residuals(whole, residual, sigma, common, level, np.zeros_like(level), residual)


def nearer_residuals(p: Prepared, sections: Residuals, common: np.ndarray) -> Residuals:
    """Residuals of the sections, without siblings where their own level explains the value better.

    Where a whole turnout is in alarm, most of its sections have changed, and the median follows them. A section that
    has kept its level then differs from it as if it had changed the other way. One that follows the others, or its own
    level, has no change that the chart of the turnout does not show.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    sections : Residuals
        Residuals of the sections.
    common : (n_section, n_campaign) array of bool
        Campaigns in which the whole turnout is in alarm.

    Returns
    -------
    Residuals
        Of the same sections.
    """
    n = len(common)
    with np.errstate(invalid="ignore", divide="ignore"):
        from_level = np.abs(sections.centred) / p.spread_alone[:n, None]
        from_siblings = np.abs(sections.residual) / p.spread[:n, None]
        own_is_nearer = common & p.with_siblings[:n, None] & (from_level < from_siblings)
    alone = _sigma(p, np.zeros(common.shape, dtype=bool), sections.temperature_variance)
    return replace(
        sections,
        residual=np.where(own_is_nearer, sections.centred, sections.residual),
        sigma=np.where(own_is_nearer, alone, sections.sigma),
    )


def _centre(values: np.ndarray, window: np.ndarray, epoch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Level of each epoch, learned from the campaigns of ``window``, and the values less that level."""
    n_epoch = int(epoch.max(initial=0)) + 1
    level, _ = by_epoch(np.where(window, values, 0.0), window, epoch, n_epoch)
    return level, values - expand_epochs(level, epoch)


def temperature_variance(p: Prepared, window: np.ndarray) -> np.ndarray:
    r"""Variance that the errors of the temperature law, of its slope b and its curvature c, add to each value.

    .. math:: V = s_b^2 X + s_c^2 X^2, \quad X = \max(0, d^2 - \max_B d^2)

    with the deviation d of a temperature from the mean of its epoch. Only temperatures outside the range of the
    baseline B add to it; within that range the guard factor covers the errors. It matters, for instance, in the first
    summer after a baseline with nearly constant temperature, or of winters alone.

    Parameters
    ----------
    p : Prepared
        Prepared charts.
    window : (n_section, n_campaign) array of bool
        Campaigns from which a level is learned.

    Returns
    -------
    (n_section, n_campaign) array of float
        Variance. [%²]
    """
    n, base = len(window), p.baseline
    excess = _excess(p.panel.temperature, window, base.inside[:n], p.epoch[:n])
    slope_se, curvature_error = np.nan_to_num(base.slope_se[:n, None]), base.curvature_error[:n, None]
    return slope_se**2 * excess + curvature_error**2 * excess**2


def _excess(temperature: np.ndarray, window: np.ndarray, inside: np.ndarray, epoch: np.ndarray) -> np.ndarray:
    """Square of the deviation of each temperature from the mean of its epoch, beyond that of the baseline. [°C²]"""
    _, deviation = _centre(temperature, window & np.isfinite(temperature), epoch)
    in_baseline = np.max(np.nan_to_num(np.where(inside, deviation, 0.0)) ** 2, axis=1, initial=0.0)
    return np.maximum(np.nan_to_num(deviation) ** 2 - in_baseline[:, None], 0.0)


def _sigma(p: Prepared, enough: np.ndarray, added_variance: np.ndarray) -> np.ndarray:
    """Spread of each value [%]: that of the baseline, with or without siblings, and more where its own error is larger.

    ``added_variance`` is the (n_section, n_campaign) variance from ``temperature_variance``. [%²]
    """
    n = len(enough)
    sigma = np.where(enough, p.spread[:n, None], p.spread_alone[:n, None])
    f0, inside = p.baseline.frequency[:n, None], p.baseline.inside[:n]
    error = np.nan_to_num(100.0 * p.panel.error / f0)
    usual = np.sum(np.where(inside, error**2, 0.0), axis=1) / np.maximum(inside.sum(axis=1), 1)
    sigma = np.sqrt(sigma**2 + np.maximum(error**2 - usual[:, None], 0.0) + added_variance)
    return np.where(sigma > 100.0 * FREQUENCY_RESOLUTION / f0, sigma, np.nan)
