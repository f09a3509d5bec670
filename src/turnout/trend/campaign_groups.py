"""Decide which values of a turnout form one campaign."""

from __future__ import annotations

import numpy as np
import pandas as pd

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.times import SECONDS_PER_DAY

# [d] A first campaign isolated by more than this from the next is left out: a mistyped year or a clock that was reset.
# A true one, such as an acceptance test, must not start the baseline either.
ISOLATED_FIRST_GAP = 5 * DAYS_PER_YEAR


def keys_of(calendar: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Number of the calendar and time combined in one sortable integer.

    Parameters
    ----------
    calendar : (n,) array of int
        Number of the calendar, the row of ``Panel.time``.
    time : (n,) array of float
        Time. [d]

    Returns
    -------
    (n,) array of int
        Sorts by calendar, then by time.
    """
    return calendar * 2**40 + np.round((time + 2e6) * SECONDS_PER_DAY).astype(np.int64)


def unique_of(key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``np.unique(key, return_inverse=True)`` by hashing, which is faster for many rows and few charts.

    Parameters
    ----------
    key : (n,) array of float
        Keys.

    Returns
    -------
    distinct, index : (n_distinct,) array of float, (n,) array of int
        Sorted distinct keys, and the index of each key among them.
    """
    code, unique = pd.factorize(key)
    order = np.argsort(unique, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return np.asarray(unique)[order], rank[code]


def campaigns_of(
    calendar: np.ndarray, time: np.ndarray, gap: float, n_calendar: int, resets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Group values in campaigns.

    A campaign lasts ``gap`` from its first value on, and ends at an event that resets charts.

    Parameters
    ----------
    calendar : (n,) array of int
        Number of the calendar of each value, its row of ``Panel.time``.
    time : (n,) array of float
        Time of each value. [d]
    gap : float
        Longest duration of a campaign. [d]
    n_calendar : int
        Number of calendars, the rows of ``Panel.time``.
    resets : (n_reset,) array of int
        Sorted ``keys_of`` the events that reset charts.

    Returns
    -------
    (n,) array of int, (n_calendar, n_campaign) array of float
        Number of the campaign of each row within its turnout, and start times [d], nan where there are fewer.
    """
    if not time.size:  # one empty column, so that later steps need no special case
        return np.zeros(0, dtype=np.int64), np.full((n_calendar, 1), np.nan)
    stamp, row = unique_of(keys_of(calendar, time))
    of_calendar, moment = stamp >> 40, (stamp & (2**40 - 1)) / SECONDS_PER_DAY - 2e6
    new_turnout = np.diff(of_calendar, prepend=-1) != 0
    after_reset = np.diff(np.searchsorted(resets, stamp, side="right"), prepend=0) > 0
    new = split(new_turnout | after_reset | (np.diff(moment, prepend=0.0) > gap), moment, gap)
    running = np.cumsum(new) - 1
    first = np.zeros(n_calendar, dtype=np.int64)
    first[of_calendar[new_turnout]] = running[new_turnout]
    number = running - first[of_calendar]
    starts = np.full((n_calendar, int(number.max()) + 1), np.nan)
    starts[of_calendar[new], number[new]] = moment[new]
    return number[row], starts


def is_isolated_first(calendar: np.ndarray, time: np.ndarray, gap: float, n_calendar: int) -> np.ndarray:
    """Which rows belong to a first campaign more than ``ISOLATED_FIRST_GAP`` before the next, if at least two follow.

    A baseline that begins with it would last a year without a value in summer.

    Parameters
    ----------
    calendar : (n,) array of int
        Number of the calendar of each value, its row of ``Panel.time``.
    time : (n,) array of float
        Time of each value. [d]
    gap : float
        Longest duration of a campaign. [d]
    n_calendar : int
        Number of calendars, the rows of ``Panel.time``.

    Returns
    -------
    (n,) array of bool
        Whether each row belongs to such a campaign.

    Examples
    --------
    >>> is_isolated_first(np.zeros(4, int), np.array([0.0, 9000.0, 1.0, 9007.0]), 1.5, 1)
    array([ True, False,  True, False])
    """
    first, second = np.full((2, n_calendar), np.inf)
    last = np.full(n_calendar, -np.inf)
    np.minimum.at(first, calendar, time)
    early = time <= first[calendar] + gap
    np.minimum.at(second, calendar[~early], time[~early])
    np.maximum.at(last, calendar, time)
    lone = (second > first + ISOLATED_FIRST_GAP) & (last > second + gap)
    return early & lone[calendar]


def split(new: np.ndarray, moment: np.ndarray, gap: float) -> np.ndarray:
    """Start a new campaign after every ``gap`` within a long run of values, as with daily measurements.

    Parameters
    ----------
    new : (n,) array of bool
        Whether each value is the first of a campaign.
    moment : (n,) array of float
        Times, ascending within a campaign. [d]
    gap : float
        Longest duration of a campaign. [d]

    Returns
    -------
    (n,) array of bool
        First values, also those of the new campaigns.

    Examples
    --------
    >>> split(np.array([True, False, False, False, True]), np.array([0.0, 1.0, 2.0, 3.0, 9.0]), 1.5)
    array([ True, False,  True, False,  True])
    """
    new, begin = new.copy(), np.flatnonzero(new)
    end = np.append(begin[1:], new.size)
    long = moment[end - 1] - moment[begin] > gap
    for first, last in zip(begin[long], end[long]):
        while moment[last - 1] - moment[first] > gap:
            first += int(np.searchsorted(moment[first:last], moment[first] + gap, side="right"))
            new[first] = True
    return new
