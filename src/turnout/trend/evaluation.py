"""Evaluate all charts of a fleet: baselines, then the shared autocorrelation, then the CUSUM charts."""

import numpy as np

from turnout.trend.baseline import pooled_memory
from turnout.trend.cusum import finish
from turnout.trend.panel import WHOLE, panel_of
from turnout.trend.residuals import prepare


def memory_classes(prepared) -> list[np.ndarray]:
    """Class number of every chart; charts of a class share one autocorrelation.

    A class has the same band and source, section or whole turnout, and similar spacing. Spacing is classed in octaves
    of a week, so weekly and two-monthly measurements are separate classes.
    """
    names: dict[tuple, int] = {}
    classes = []
    for p in prepared:
        octave = np.nan_to_num(np.round(np.log2(np.maximum(p.interval, 1.0) / 7.0)), nan=-99.0).astype(int)
        keys = zip(p.charts["band"], p.charts["source"], p.charts["section_id"] == WHOLE, octave)
        classes.append(np.array([names.setdefault(key, len(names)) for key in keys], dtype=np.int64))
    return classes


def evaluate_panels(panels, events, settings):
    """Yield the finished ``Charts`` of each panel; the panels are parts of one fleet and share its autocorrelation."""
    prepared = [prepare(panel, events, settings) for panel in panels]
    for p, own in zip(prepared, shared_memory(prepared)):
        yield finish(p, own, settings)


def shared_memory(prepared) -> list[np.ndarray]:
    """Autocorrelation of every chart of each panel: the mean over its class in the whole fleet.

    Only charts with a complete baseline count, unless their class has none. So the value changes when a baseline is
    completed, and not with every campaign.
    """
    if not prepared:
        return []
    classes = np.concatenate(memory_classes(prepared))
    memory = np.concatenate([p.memory for p in prepared])
    complete = np.concatenate([p.baseline.complete for p in prepared])
    settled = pooled_memory(np.where(complete, memory, np.nan), classes)
    known = np.zeros(int(classes.max(initial=-1)) + 1, dtype=bool)
    known[classes[complete & np.isfinite(memory)]] = True
    shared = np.where(known[classes], settled, pooled_memory(memory, classes))
    return np.split(shared, np.cumsum([len(p.charts) for p in prepared])[:-1])


def evaluate(modes, events, settings, as_of=None):
    """Charts of a fleet from rows of the tables ``modes`` and ``events``.

    Parameters
    ----------
    modes : DataFrame
        ``turnout_id, section_id, band, source, measured_at_utc, frequency_hz, frequency_se_hz,
        rail_temperature_c``.
    events : DataFrame or None
        ``turnout_id, section_id, event_at_utc, kind, resets_ballast, resets_railpad``.
    settings : TrendSettings
    as_of : time or None
        Evaluate the fleet as it was then; None: at its newest campaign with a plausible time.

    Returns
    -------
    Charts
    """
    return next(evaluate_panels([panel_of(modes, settings, as_of, events)], events, settings))
