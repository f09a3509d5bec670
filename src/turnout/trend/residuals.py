"""Residuals of all charts: level of the epoch out, median of the siblings out, and the spread that is left."""

from dataclasses import dataclass

import numpy as np

from turnout.trend.epochs import by_epoch, spread_out
from turnout.trend.prepared import Prepared, first_epoch
from turnout.trend.siblings import median_of_group, median_of_others

RESOLUTION = 0.001


@dataclass
class Residuals:
    """(n_chart, n_campaign) ``values``, ``residual`` and its ``sigma`` [%]; (n_chart, n_epoch) ``level`` and
    ``shift`` against the siblings [%]; ``centred`` are the values with their own level out."""

    values: np.ndarray
    residual: np.ndarray
    sigma: np.ndarray
    level: np.ndarray
    shift: np.ndarray
    centred: np.ndarray


def _usable(p, n_section):
    usable = np.isfinite(p.values)
    return np.vstack([usable, np.zeros((len(p.epoch) - n_section, usable.shape[1]), dtype=bool)])


def learning(p, learn, n_section, need):
    """Campaigns that learn a level: the baseline and the first of every later epoch; and settled campaigns.

    A settled campaign lies in the first epoch's finished baseline or behind the learning of its epoch: only
    such campaigns serve as siblings of settled ones.
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
    window = usable & (p.baseline.inside | (later & (rank <= learn[:, None])))
    settled = usable & p.baseline.complete[:, None] & ~(window & later)
    return window, settled


def of_sections(p: Prepared, window, settled, serving, settings) -> Residuals:
    """Residuals of the sections. ``window`` and ``settled`` are those of ``learning``.

    (n_chart, n_campaign) ``serving`` says which settled campaigns are siblings of others: not those in alarm, for
    one section that has fallen far would pull the median of a few with it and raise an alarm in sound ones.
    """
    n = len(p.panel.charts)
    group, epoch = p.panel.charts["group"].to_numpy(), p.epoch[:n]
    level, e = _centred(p.values, window[:n], epoch)
    median, others = median_of_others(e, serving, group)
    enough = np.isfinite(e) & (others >= settings.siblings_minimum)
    young = np.isfinite(e) & ~settled[:n] & ~enough
    if young.any():
        rest, rest_others = median_of_others(e, np.isfinite(e), group)
        use = young & (rest_others >= settings.siblings_minimum)
        median, enough = np.where(use, rest, median), enough | use
    enough &= p.with_siblings[:n, None]
    enough &= _compared(window[:n], enough, epoch, first_epoch(p)[:n], settings.siblings_share)
    shift, beside = _centred(np.where(enough, e - median, np.nan), window[:n] & enough, epoch)
    sigma = _sigma(p, enough, slope_variance(p, window[:n]))
    return Residuals(p.values, np.where(enough, beside, e), sigma, level, shift, e)


def _compared(window, beside, epoch, first, share) -> np.ndarray:
    """Campaigns of epochs in which the usual difference to the siblings is known, (n_chart, n_campaign).

    After work it is if siblings stood ``beside`` so large a ``share`` of the campaigns that learned the level: who
    followed one section alone knows its level, and not how it differs from the others.
    """
    n_epoch = int(epoch.max(initial=0)) + 1
    learned, together = (by_epoch(epoch, mask, epoch, n_epoch)[1] for mask in (window, window & beside))
    later = np.arange(n_epoch) > first[:, None]
    return spread_out((together > 0) & (together >= share * learned * later), epoch)


def of_turnouts(p: Prepared, sections: Residuals, window, settled, alarmed, settings) -> Residuals:
    """Residuals of the medians of the turnouts, which a change of all sections moves.

    Sections in ``alarmed``, whose own alarm is open, do not count: one section that has fallen far would pull the
    median of a few with it.
    """
    n, need = len(p.panel.charts), settings.siblings_minimum + 1
    group, epoch = p.panel.charts["group"].to_numpy(), p.epoch[n:]
    median, count = median_of_group(sections.centred, settled[:n] & ~alarmed, group)
    young, young_count = median_of_group(sections.centred, np.isfinite(sections.centred), group)
    whole = np.where(count >= need, median, np.where((young_count >= need) & window[n:], young, np.nan))
    level, residual = _centred(whole, window[n:] & np.isfinite(whole), epoch)
    common, _ = median_of_group(slope_variance(p, window[:n]), settled[:n] & ~alarmed, group)
    sigma = np.sqrt(p.spread[n:, None] ** 2 + np.nan_to_num(common))
    return Residuals(whole, residual, np.where(sigma > 0.0, sigma, np.nan), level, np.zeros_like(level), residual)


def _centred(values, window, epoch):
    """Take the level of each epoch out; it is learned from the campaigns of ``window``."""
    n_epoch = int(epoch.max(initial=0)) + 1
    level, _ = by_epoch(np.where(window, values, 0.0), window, epoch, n_epoch)
    return level, values - spread_out(level, epoch)


def slope_variance(p, window):
    """What the error of the temperature slope adds to each value beyond the temperatures of its baseline. [%²]

    (n_section, n_campaign). Within them the guard allows for it; a summer after a baseline in which the thermometer
    stood still is judged by a slope that nobody measured.
    """
    n, base = len(window), p.baseline
    _, away = _centred(p.panel.temperature, window & np.isfinite(p.panel.temperature), p.epoch[:n])
    inside = base.inside[:n]
    known = np.max(np.where(inside, away, 0.0) ** 2, axis=1, initial=0.0)
    beyond = np.maximum(np.nan_to_num(away) ** 2 - known[:, None], 0.0)
    return np.nan_to_num(base.slope_se[:n, None]) ** 2 * beyond


def _sigma(p, enough, beyond):
    """Spread of each value [%]: the baseline's, with or without siblings, and more where its own error is larger.

    ``beyond`` (n_section, n_campaign) is the variance of what temperatures make of it that the baseline never saw. [%²]
    """
    n = len(enough)
    sigma = np.where(enough, p.spread[:n, None], p.spread_alone[:n, None])
    f0, inside = p.baseline.frequency[:n, None], p.baseline.inside[:n]
    error = np.nan_to_num(100.0 * p.panel.error / f0)
    usual = np.sum(np.where(inside, error**2, 0.0), axis=1) / np.maximum(inside.sum(axis=1), 1)
    sigma = np.sqrt(sigma**2 + np.maximum(error**2 - usual[:, None], 0.0) + beyond)
    return np.where(sigma > 100.0 * RESOLUTION / f0, sigma, np.nan)
