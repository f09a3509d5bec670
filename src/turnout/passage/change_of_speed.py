"""A train that brakes or gains speed: by how much, from where the sensors hear its first and its second half."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from turnout.passage.motion import Motion
from turnout.passage.order import half_shifts

STEADY = 0.15  # m: halves of a steady train lie no further apart from sensor to sensor, in the mean
PASSES, SETTLED = 6, 2e-3


def with_change(heard, motion: Motion, limit: float) -> Motion:
    r"""The motion with the change of speed that brings all sensors together in both halves of the train.

    Where the train runs at v and is taken to run at v', a sensor x metres on hears it :math:`x (v'/v - 1)` metres too
    far back: the slope over the sensors gives the speed of each half. Kept where it more than halves what lies apart;
    what a single clock does is none of the train's. Wagons all alike may hide a change of speed by a fifth and more.

    Parameters
    ----------
    heard : Listening
        Of three sensors or more, else the motion stays as it is.
    motion : Motion
        At a steady speed.
    limit : float
        Of accelerations. [m/s²]
    """
    if len(heard.positions) < 3:
        return motion
    shifts = half_shifts(heard, motion)
    apart, found = _apart(shifts), motion
    if apart < STEADY:
        return motion
    for _ in range(PASSES):
        slopes = [_slope(motion.direction * heard.positions, row) for row in shifts.T]
        found = _bent(found, heard, np.clip(slopes, -0.3, 0.3))
        if abs(found.acceleration) > limit:
            return motion
        shifts = half_shifts(heard, found)
        if np.max(np.abs(slopes)) < SETTLED:
            break
    return found if _apart(shifts) < 0.5 * apart else motion


def _apart(shifts) -> float:
    """Mean over the sensors of how far the halves lie apart, against the usual sensor. [m]"""
    change = shifts[:, 1] - shifts[:, 0]
    return float(np.mean(np.abs(change - np.median(change))))


def _slope(along, shift) -> float:
    """Median slope over all pairs of sensors (Theil and Sen), those at one place aside."""
    pairs = [(i, j) for i, j in combinations(range(len(along)), 2) if abs(along[j] - along[i]) > 0.5]
    return float(np.median([(shift[j] - shift[i]) / (along[j] - along[i]) for i, j in pairs])) if pairs else 0.0


def _bent(motion, heard, slopes) -> Motion:
    """The motion with speeds in the middles of both halves that are by ``slopes`` too high."""
    begin, end = motion.way(heard.begin), motion.way(heard.end)
    times = motion.time(begin + np.array([0.25, 0.75]) * (end - begin))
    speeds = motion.speed_at(times) / (1.0 + slopes)
    middle, change = float(times.mean()), float(np.diff(speeds)[0] / np.diff(times)[0])
    told = Motion(float(speeds.mean()), middle, change, motion.direction)
    return told.moved(-float(motion.way(middle)))
