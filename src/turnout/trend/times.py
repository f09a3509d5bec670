"""Convert times to days and back, and tell plausible times from mistyped ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout.config.settings.trend import TrendSettings

SECONDS_PER_DAY = 86400.0  # s


def days(times: Any) -> np.ndarray:
    """Naive UTC times as days since 1970-01-01; nan for a missing time.

    Parameters
    ----------
    times : sequence of times
        Times as pandas reads them.

    Returns
    -------
    (n,) array of float
        Days since 1970-01-01. [d]

    Examples
    --------
    >>> days(pd.Series(pd.to_datetime(["1970-01-02 12:00"])))
    array([1.5])
    """
    stamps = pd.to_datetime(pd.Series(times)).to_numpy().astype("datetime64[us]")
    return np.where(np.isnat(stamps), np.nan, stamps.astype("int64") / (SECONDS_PER_DAY * 1e6))


def timestamps(day: ArrayLike) -> np.ndarray:
    """Days since 1970-01-01 as datetime64[us], NaT for nan; the inverse of ``days``.

    Parameters
    ----------
    day : (n,) array of float
        Days since 1970-01-01. [d]

    Returns
    -------
    (n,) array of datetime64[us]
        Times, rounded to seconds.

    Examples
    --------
    >>> str(timestamps(np.array([1.5]))[0])
    '1970-01-02T12:00:00.000000'
    """
    day = np.asarray(day, dtype=float)
    micro = np.round(np.nan_to_num(day) * SECONDS_PER_DAY).astype("int64") * 1_000_000
    return np.where(np.isfinite(day), micro.view("datetime64[us]"), np.datetime64("NaT", "us"))


def believable_times(time: np.ndarray, settings: TrendSettings, until: float = np.inf) -> tuple[np.ndarray, float]:
    """Which times of a fleet are plausible, and the newest of them.

    A time before ``earliest_year`` or after ``until`` is implausible. So is a single last day of measurement more
    than ``clock_gap_days`` after all others of the fleet.

    Parameters
    ----------
    time : (n,) array of float
        Times. [d]
    settings : TrendSettings
        Settings of the charts.
    until : float
        Newest time that may be. [d]

    Returns
    -------
    ((n,) array of bool, float)
        Whether each time is plausible, and the newest one [d], -inf if none is.

    Examples
    --------
    >>> from turnout.config.settings.trend import TrendSettings
    >>> believable_times(np.array([-3.0, 15000.0, 15007.0, 26000.0]), TrendSettings())
    (array([False,  True,  True, False]), 15007.0)
    """
    earliest = days([pd.Timestamp(settings.earliest_year, 1, 1)])[0]
    is_believable = np.isfinite(time) & (time >= earliest) & (time <= until)
    dates = np.unique(np.floor(time[is_believable]))
    if dates.size >= 3 and dates[-1] - dates[-2] > settings.clock_gap_days:
        is_believable &= time < dates[-1]
    return is_believable, float(np.max(time, where=is_believable, initial=-np.inf))
