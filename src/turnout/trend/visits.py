"""Which values of a turnout are one campaign."""

import numpy as np
import pandas as pd

DAY = 86400.0
# A lone campaign so long before all others of its turnout [d]: a mistyped year or a clock that was reset; of one that
# was meant, an acceptance test, nobody needs to know more than that it begins no year of measurement.
LONG_BEFORE = 5 * 365.25


def truth(flag) -> bool:
    """A flag from a CSV or from the registry: true only when it says so."""
    return flag is True or str(flag).strip().lower() in ("true", "1", "yes")


def keys_of(visits, time):
    """Row of visits and time [d] in one number, in their order."""
    return visits * 2**40 + np.round((time + 2e6) * DAY).astype(np.int64)


def unique_of(key):
    """``np.unique(key, return_inverse=True)`` by hashing: the rows are many, the charts few."""
    code, unique = pd.factorize(key)
    order = np.argsort(unique, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return np.asarray(unique)[order], rank[code]


def campaigns_of(visits, time, gap, n_visits, works):
    """Number of the campaign of each row within its turnout, and (n_visits, n_campaign) times they started.

    A campaign lasts ``gap`` from its first value on and ends at work that resets: ``works`` are sorted ``keys_of``.
    """
    if not time.size:  # one column of none: what comes after needs no case of its own
        return np.zeros(0, dtype=np.int64), np.full((n_visits, 1), np.nan)
    stamp, row = unique_of(keys_of(visits, time))
    visit, moment = stamp >> 40, (stamp & (2**40 - 1)) / DAY - 2e6
    new_turnout = np.diff(visit, prepend=-1) != 0
    worked = np.diff(np.searchsorted(works, stamp, side="right"), prepend=0) > 0
    new = split(new_turnout | worked | (np.diff(moment, prepend=0.0) > gap), moment, gap)
    running = np.cumsum(new) - 1
    first = np.zeros(n_visits, dtype=np.int64)
    first[visit[new_turnout]] = running[new_turnout]
    number = running - first[visit]
    starts = np.full((n_visits, int(number.max()) + 1), np.nan)
    starts[visit[new], number[new]] = moment[new]
    return number[row], starts


def long_before(visits, time, gap, n_visits) -> np.ndarray:
    """Which rows are of a lone first campaign ``LONG_BEFORE`` the next, where at least two follow.

    A baseline that begins with it would have its year before it has seen a summer.

    >>> long_before(np.zeros(4, int), np.array([0.0, 9000.0, 1.0, 9007.0]), 1.5, 1)
    array([ True, False,  True, False])
    """
    first, second = np.full((2, n_visits), np.inf)
    last = np.full(n_visits, -np.inf)
    np.minimum.at(first, visits, time)
    early = time <= first[visits] + gap
    np.minimum.at(second, visits[~early], time[~early])
    np.maximum.at(last, visits, time)
    lone = (second > first + LONG_BEFORE) & (last > second + gap)
    return early & lone[visits]


def split(new, moment, gap):
    """``new`` with runs that last longer than ``gap`` begun anew so often: who measures daily has campaigns, too.

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
