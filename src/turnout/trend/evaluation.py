"""Evaluate all charts of a fleet: baselines, then the shared autocorrelation, then the CUSUM charts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.trend.baseline import pooled_autocorrelation
from turnout.trend.cusum import finish
from turnout.trend.panel import WHOLE_TURNOUT, panel_of
from turnout.trend.preparation import prepare

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from typing import Any

    import pandas as pd

    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.charts import Charts
    from turnout.trend.panel import Panel
    from turnout.trend.preparation import Prepared


def autocorrelation_classes(prepared: Iterable[Prepared]) -> list[np.ndarray]:
    """Class number of every chart; charts of a class share one autocorrelation.

    A class has the same band and source, section or whole turnout, and similar spacing. Spacing is classed in octaves
    of a week, so weekly and two-monthly measurements are separate classes.

    Parameters
    ----------
    prepared : iterable of Prepared
        Prepared charts of each panel of the fleet.

    Returns
    -------
    list of (n_chart,) arrays of int
        Classes of the charts of each panel.
    """
    names: dict[tuple, int] = {}
    classes = []
    for p in prepared:
        octave = np.nan_to_num(np.round(np.log2(np.maximum(p.interval, 1.0) / 7.0)), nan=-99.0).astype(int)
        keys = zip(p.charts["band"], p.charts["source"], p.charts["section_id"] == WHOLE_TURNOUT, octave)
        classes.append(np.array([names.setdefault(key, len(names)) for key in keys], dtype=np.int64))
    return classes


def evaluate_panels(panels: Iterable[Panel], events: pd.DataFrame | None, settings: TrendSettings) -> Iterator[Charts]:
    """Yield the finished charts of each panel; the panels are parts of one fleet and share its autocorrelation.

    Parameters
    ----------
    panels : iterable of Panel
        Panels of the fleet.
    events : DataFrame or None
        Rows of the table ``events``.
    settings : TrendSettings
        Settings of the charts.

    Yields
    ------
    Charts
        Finished charts of one panel.
    """
    prepared = [prepare(panel, events, settings) for panel in panels]
    for p, autocorrelation in zip(prepared, shared_autocorrelation(prepared)):
        yield finish(p, autocorrelation, settings)


def shared_autocorrelation(prepared: Sequence[Prepared]) -> list[np.ndarray]:
    """Autocorrelation of every chart of each panel: the mean over its class in the whole fleet.

    Only charts with a complete baseline count, unless their class has none. So the value changes when a baseline is
    completed, and not with every campaign.

    Parameters
    ----------
    prepared : sequence of Prepared
        Prepared charts of each panel of the fleet.

    Returns
    -------
    list of (n_chart,) arrays of float
        Autocorrelation of the charts of each panel.
    """
    if not prepared:
        return []
    classes = np.concatenate(autocorrelation_classes(prepared))
    autocorrelation = np.concatenate([p.autocorrelation for p in prepared])
    complete = np.concatenate([p.baseline.complete for p in prepared])
    from_complete = pooled_autocorrelation(np.where(complete, autocorrelation, np.nan), classes)
    has_complete = np.zeros(int(classes.max(initial=-1)) + 1, dtype=bool)
    has_complete[classes[complete & np.isfinite(autocorrelation)]] = True
    shared = np.where(has_complete[classes], from_complete, pooled_autocorrelation(autocorrelation, classes))
    return np.split(shared, np.cumsum([len(p.charts) for p in prepared])[:-1])


def evaluate(modes: pd.DataFrame, events: pd.DataFrame | None, settings: TrendSettings, as_of: Any = None) -> Charts:
    """Charts of a fleet from rows of the tables ``modes`` and ``events``.

    Parameters
    ----------
    modes : DataFrame
        ``turnout_id, section_id, band, source, measured_at_utc, frequency_hz, frequency_se_hz,
        rail_temperature_c``.
    events : DataFrame or None
        ``turnout_id, section_id, event_at_utc, kind, resets_ballast, resets_railpad``.
    settings : TrendSettings
        Settings of the charts.
    as_of : time or None
        Evaluate the fleet as it was then; None: at its newest campaign with a plausible time.

    Returns
    -------
    Charts
    """
    return next(evaluate_panels([panel_of(modes, settings, as_of, events)], events, settings))
