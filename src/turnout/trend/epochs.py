"""Number the epochs of each chart: the campaigns between two maintenance events that reset it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.trend.panel import is_true
from turnout.trend.quantities import resonances_of
from turnout.trend.times import days

if TYPE_CHECKING:
    import pandas as pd


def epochs_of(
    charts: pd.DataFrame, time: np.ndarray, events: pd.DataFrame | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Number the epochs of every chart from the maintenance events.

    An event resets the charts of its resonance and of its damping (``resets_ballast``, ``resets_railpad``) in its
    section, or in the whole turnout where ``section_id`` is empty. The flags alone decide, so a change of sensor or
    method resets as tamping does. Other bands are reset by either flag. A campaign at the time of the event belongs to
    the new epoch. An event before the first campaign changes nothing. Two events between the same two campaigns make
    one epoch. An event after the last campaign is pending.

    Parameters
    ----------
    charts : DataFrame
        ``turnout_id, band, section_id``; section "*" is the whole turnout, reset by events of the whole turnout only.
    time : (n_chart, n_campaign) array of float
        Campaign times, ascending, nan where there was none. [d]
    events : DataFrame or None
        Rows of the table ``events``.

    Returns
    -------
    epoch : (n_chart, n_campaign) array of int
        0 from the first campaign on.
    pending : (n_chart,) array of bool
        An event is later than the last campaign.
    started : (n_chart, n_epoch) array of float
        Time of the event that started each epoch; nan for the first. [d]
    """
    n_chart, n_campaign = time.shape
    reset = np.full((n_chart, n_campaign + 1), -np.inf)
    if events is not None and len(events):
        _mark(reset, charts, time, events)
    reset[:, 0] = -np.inf
    marked = np.isfinite(reset[:, :n_campaign])
    epoch = np.cumsum(marked, axis=1, dtype=np.int16)
    started = np.full((n_chart, int(epoch.max(initial=0)) + 1), np.nan)
    where = np.nonzero(marked)
    started[where[0], epoch[where]] = reset[where]
    return epoch, np.isfinite(reset[:, n_campaign]), started


def _mark(reset: np.ndarray, charts: pd.DataFrame, time: np.ndarray, events: pd.DataFrame) -> None:
    """Enter each event in ``reset`` at the first campaign at or after it; column n_campaign means none yet."""
    filled = np.where(np.isnan(time), np.inf, time)
    members = charts.groupby("turnout_id", sort=False, observed=True).indices
    band = resonances_of(charts["band"])
    section = charts["section_id"].to_numpy()
    chosen = {flag: (band == flag) | ~np.isin(band, ["ballast", "railpad"]) for flag in ("ballast", "railpad")}
    for event, at in zip(events.itertuples(index=False), days(events["event_at_utc"])):
        rows = members.get(event.turnout_id)
        if rows is None or np.isnan(at):
            continue
        affected = np.zeros(rows.size, dtype=bool)
        for flag in ("ballast", "railpad"):
            if is_true(getattr(event, f"resets_{flag}")):
                affected |= chosen[flag][rows]
        if isinstance(event.section_id, str) and event.section_id:
            affected &= section[rows] == event.section_id
        rows = rows[affected]
        last = np.sum(np.isfinite(filled[rows]), axis=1)
        column = np.sum(filled[rows] < at, axis=1)
        column = np.where(column >= last, reset.shape[1] - 1, column)
        reset[rows, column] = np.maximum(reset[rows, column], at)


def by_epoch(values: np.ndarray, mask: np.ndarray, epoch: np.ndarray, n_epoch: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean of ``values`` over the masked campaigns of each epoch, and how many there are.

    Parameters
    ----------
    values : (n_chart, n_campaign) array of float
        Values of which the masked ones are finite.
    mask : (n_chart, n_campaign) array of bool
        Campaigns that count.
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.
    n_epoch : int
        Number of epochs.

    Returns
    -------
    two (n_chart, n_epoch) arrays
        Mean, nan where the epoch has none, and number.

    Examples
    --------
    >>> mean, n = by_epoch(np.array([[1.0, 3.0, 8.0]]), np.array([[True, True, True]]), np.array([[0, 0, 1]]), 2)
    >>> mean, n
    (array([[2., 8.]]), array([[2, 1]]))
    """
    n_chart = len(values)
    slot = (np.arange(n_chart)[:, None] * n_epoch + epoch)[mask]
    count = np.bincount(slot, minlength=n_chart * n_epoch).reshape(n_chart, n_epoch)
    total = np.bincount(slot, weights=values[mask], minlength=n_chart * n_epoch).reshape(n_chart, n_epoch)
    with np.errstate(invalid="ignore"):
        return np.where(count > 0, total / np.maximum(count, 1), np.nan), count


def expand_epochs(per_epoch: np.ndarray, epoch: np.ndarray) -> np.ndarray:
    """Expand values of epochs to their campaigns.

    Parameters
    ----------
    per_epoch : (n_chart, n_epoch) array of float
        Value of each epoch.
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.

    Returns
    -------
    (n_chart, n_campaign) array of float
        Value of the epoch of each campaign.
    """
    return np.take_along_axis(per_epoch, epoch.astype(np.intp), axis=1)
