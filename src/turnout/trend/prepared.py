"""Baselines of all charts of a panel, sections and whole turnouts, before the fleet's memory is known."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from turnout.trend.baseline import Baseline, fit_baseline, spread_and_memory, usual_interval
from turnout.trend.epochs import by_epoch, epochs_of, spread_out
from turnout.trend.panel import WHOLE, Panel
from turnout.trend.siblings import median_of_group, median_of_others


@dataclass
class Prepared:
    """A panel with its baselines, before the fleet's autocorrelation is known. Charts include the whole turnouts.

    The last charts (``section_id`` "*") are the medians of their turnout, one per turnout, band and source.
    ``values`` is the frequency in percent of f0 with the temperature taken out, levels not yet; the arrays
    ``spread, spread_alone, memory`` hold one value per chart.
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
    memory: np.ndarray
    with_siblings: np.ndarray


def prepare(panel: Panel, events, settings) -> Prepared:
    """Baselines of all charts of a panel, with and without siblings, and of the turnouts' medians."""
    time = panel.chart_time
    epoch, pending, started = epochs_of(panel.charts, time, events)
    base, values = fit_baseline(panel.frequency, panel.temperature, time, epoch, settings)
    stretch = slice(0, int(np.max(np.flatnonzero(base.inside.any(axis=0)), initial=-1)) + 1)
    inside, part = base.inside[:, stretch], epoch[:, stretch]
    level, _ = by_epoch(np.where(inside, values[:, stretch], 0.0), inside, part, int(part.max(initial=0)) + 1)
    centred = np.where(inside, values[:, stretch] - spread_out(level, part), np.nan)
    group = panel.charts["group"].to_numpy()
    median, others = median_of_others(centred, inside, group)
    enough = inside & (others >= settings.siblings_minimum)
    with_siblings = enough.sum(axis=1) >= settings.siblings_share * np.maximum(inside.sum(axis=1), 1)
    residual = np.where(with_siblings[:, None] & enough, centred - median, np.nan)
    alone, memory_alone = spread_and_memory(centred, inside, part, base.freedom, time[:, stretch])
    fewer = base.freedom - np.sum(inside & ~enough, axis=1)
    beside, memory = spread_and_memory(residual, enough, part, fewer, time[:, stretch])
    with_siblings &= _siblings_pay(beside, alone, group)
    section = Prepared(
        panel, panel.charts, time, base, values, epoch, started, pending, usual_interval(time, base.inside),
        np.where(with_siblings, beside, alone), alone, np.where(with_siblings, memory, memory_alone), with_siblings,
    )  # fmt: skip
    return _with_whole(section, centred, inside, stretch, events, settings)


def _siblings_pay(beside, alone, group):
    """Whether a turnout's sections scatter less about their median than alone: decided for all of them together."""
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.log(alone / beside)
    known = np.isfinite(gain)
    total = np.bincount(group, weights=np.where(known, gain, 0.0))
    return (total > 0.0)[group]


def _with_whole(p: Prepared, centred, inside, stretch, events, settings) -> Prepared:
    """Append one chart per turnout, band and source: the median of its sections, which siblings cannot hide."""
    group = p.charts["group"].to_numpy()
    median, count = median_of_group(centred, inside, group)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    charts = p.charts.iloc[first].assign(section_id=WHOLE)
    time = p.time[first]
    epoch, pending, started = epochs_of(charts, time, events)
    window = count >= settings.siblings_minimum + 1
    members = np.add.reduceat(p.baseline.complete.astype(int), first) if len(first) else np.zeros(0, int)
    complete = members >= settings.siblings_minimum + 1
    whole = np.zeros((len(first), p.time.shape[1]), dtype=bool)
    whole[:, stretch] = window
    n_base = window.sum(axis=1)
    freedom = n_base - 2
    spread, memory = spread_and_memory(
        np.where(window, median, np.nan), window, epoch[:, stretch], freedom, time[:, stretch]
    )
    nothing = np.full(len(first), np.nan)
    base = Baseline(nothing, nothing, nothing, nothing, n_base, freedom, complete, np.zeros(len(first), int), whole)
    joined = Baseline(*(np.concatenate([a, b]) for a, b in zip(vars(p.baseline).values(), vars(base).values())))
    return Prepared(
        p.panel, pd.concat([p.charts, charts], ignore_index=True), np.vstack([p.time, time]), joined, p.values,
        np.vstack([p.epoch, epoch]), stacked(p.started, started), np.append(p.pending, pending),
        np.append(p.interval, usual_interval(time, whole)), np.append(p.spread, spread),
        np.append(p.spread_alone, spread), np.append(p.memory, memory),
        np.append(p.with_siblings, np.zeros(len(first), bool)),
    )  # fmt: skip


def stacked(a, b):
    """One array below the other, the narrower filled with nan on the right."""
    width = max(a.shape[1], b.shape[1])
    return np.vstack([np.pad(x, ((0, 0), (0, width - x.shape[1])), constant_values=np.nan) for x in (a, b)])


def first_epoch(p):
    """Epoch in which each chart's baseline begins: its level needs no allowance, the guard covers it."""
    column = np.argmax(p.baseline.inside, axis=1)
    return p.epoch[np.arange(len(p.epoch)), column]
