"""Compute residuals of all charts of a panel, sections and whole turnouts.

The residual of a section is its value less the level of the epoch and less the median of its sibling sections.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.trend.curvature import covers_the_year, fit_curved_law
from turnout.trend.epochs import by_epoch, expand_epochs
from turnout.trend.preparation import first_epoch
from turnout.trend.siblings import median_of_group, median_of_siblings

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.preparation import Prepared

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
    usable = np.isfinite(p.values) & ~p.aside[:n_section]
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
