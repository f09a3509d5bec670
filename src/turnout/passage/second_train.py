"""Detect a second train at the same time: a coherent source that passes the sensors at another speed or direction."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from turnout.passage.axle_features import GRID, along_train
from turnout.passage.kinematics import Motion
from turnout.passage.slowness import likeness_at, slowness_grid
from turnout.records import Rejection

ANOTHER = "another train at about"  # beginning of a finding's text
LIKE = 0.25  # least correlation of the residual between sensors
SHARE = 0.1  # least level of the second train along its own motion, in half of the sensors, over the first's


def second_train(heard, passage, settings):
    """Finding "two_trains" where the residual of the known motion moves coherently in another way.

    The common level of all sensors along the known train is subtracted from each: the lower median. A second train
    stays in the residual, since at every sensor it is elsewhere along the first. An impact at a fixed position, as at
    the crossing's nose, stays too, at the sensors beside it or at all at one moment. So half of the sensors must
    record the second train at a tenth of the first one's level, each at its own time. Needs three sensors, else there
    is no finding.
    """
    if len(heard.positions) < 3:
        return []
    rest = without_train(heard, passage.motion)
    slowness = slowness_grid(settings)
    every = likeness_at(np.append(slowness, 0.0), rest, heard.levels.step, heard.positions)
    likeness, at_once = every[:-1], float(every[-1])
    own = passage.motion.direction / passage.motion.speed
    other = np.abs(slowness - own) > 0.15 * abs(own)
    same = likeness[~other].max(initial=0.0)
    best = int(np.argmax(np.where(other, likeness, -np.inf)))
    strength = float(likeness[best])
    if strength < LIKE or strength < 1.2 * same or strength < at_once:
        return []
    way = 1 if slowness[best] > 0 else -1
    second = Motion(1.0 / abs(slowness[best]), 0.0, 0.0, way)
    first = _shared_level(heard, np.clip(_smooth(heard), 0.0, None), passage.motion)
    if _shared_level(heard, rest, second) < SHARE * first:
        return []
    speed = 3.6 / slowness[best]
    way = "facing" if speed > 0 else "trailing"
    return [Rejection("two_trains", strength, LIKE, f"{ANOTHER} {abs(speed):.0f} km/h, {way}")]


def _smooth(heard):
    """Levels, smoothed over 20 ms."""
    return ndimage.uniform_filter1d(heard.levels.values, max(round(0.02 / heard.levels.step), 1), axis=1)


def _shared_level(heard, values, motion) -> float:
    """Sum over the time of the lower median over the sensors, each shifted by the motion. [s]"""
    step, end = heard.levels.step, values.shape[1] * heard.levels.step
    ways = [motion.way(t) - motion.direction * x for t in (0.0, end) for x in heard.positions]
    rows = np.sort(along_train(values, step, heard.positions, motion, min(ways), max(ways)), axis=0)
    return float(rows[(len(rows) - 1) // 2].sum() * GRID / motion.speed)


def without_train(heard, motion) -> np.ndarray:
    """(n_sensor, n_bin) levels above the sensors' common level along the train, smoothed over 20 ms, at least 0."""
    step, positions = heard.levels.step, heard.positions
    values = _smooth(heard)
    ways = [motion.way(t) - motion.direction * x for t in (heard.begin, heard.end) for x in positions]
    start, stop = min(ways) - 15.0, max(ways) + 15.0
    rows = np.sort(along_train(values, step, positions, motion, start, stop), axis=0)
    shared = rows[(len(rows) - 1) // 2]
    place = start + np.arange(shared.size) * GRID
    centres = (np.arange(values.shape[1]) + 0.5) * step
    rest = [
        row - np.interp(motion.way(centres) - motion.direction * x, place, shared, left=0.0, right=0.0)
        for row, x in zip(values, positions)
    ]
    return np.clip(rest, 0.0, None)
