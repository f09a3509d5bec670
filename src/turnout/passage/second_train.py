"""Detect a second train at the same time: a coherent source that passes the sensors at another speed or direction."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from turnout.passage.axle_features import GRID_STEP, along_train
from turnout.passage.kinematics import Motion
from turnout.passage.slowness import correlation_at, slowness_grid
from turnout.records import Rejection

SECOND_TRAIN_TEXT = "another train at about"  # beginning of a finding's text
MIN_CORRELATION = 0.25  # least correlation of the residual between sensors
MIN_LEVEL_SHARE = 0.1  # least level of the second train along its own motion, in half of the sensors, over the first's


def second_train(envelopes, passage, settings):
    """Finding "two_trains" where the residual of the known motion moves coherently in another way.

    The common level of all sensors along the known train is subtracted from each: the lower median. A second train
    stays in the residual, since at every sensor it is elsewhere along the first. An impact at a fixed position, as at
    the crossing's nose, stays too, at the sensors beside it or at all at one moment. So half of the sensors must
    record the second train at a tenth of the first one's level, each at its own time. Needs three sensors, else there
    is no finding.
    """
    if len(envelopes.positions) < 3:
        return []
    residual = without_train(envelopes, passage.motion)
    slowness = slowness_grid(settings)
    correlations = correlation_at(np.append(slowness, 0.0), residual, envelopes.levels.step, envelopes.positions)
    correlation, simultaneous = correlations[:-1], float(correlations[-1])
    own_slowness = passage.motion.direction / passage.motion.speed
    is_other = np.abs(slowness - own_slowness) > 0.15 * abs(own_slowness)
    own_correlation = correlation[~is_other].max(initial=0.0)
    peak = int(np.argmax(np.where(is_other, correlation, -np.inf)))
    strength = float(correlation[peak])
    if strength < MIN_CORRELATION or strength < 1.2 * own_correlation or strength < simultaneous:
        return []
    direction = 1 if slowness[peak] > 0 else -1
    second = Motion(1.0 / abs(slowness[peak]), 0.0, 0.0, direction)
    first_level = _shared_level(envelopes, np.clip(_smooth_levels(envelopes), 0.0, None), passage.motion)
    if _shared_level(envelopes, residual, second) < MIN_LEVEL_SHARE * first_level:
        return []
    speed = 3.6 / slowness[peak]
    direction = "facing" if speed > 0 else "trailing"
    return [
        Rejection("two_trains", strength, MIN_CORRELATION, f"{SECOND_TRAIN_TEXT} {abs(speed):.0f} km/h, {direction}")
    ]


def _smooth_levels(envelopes):
    """Levels, smoothed over 20 ms."""
    return ndimage.uniform_filter1d(envelopes.levels.values, max(round(0.02 / envelopes.levels.step), 1), axis=1)


def _shared_level(envelopes, values, motion) -> float:
    """Sum over the time of the lower median over the sensors, each shifted by the motion. [s]"""
    step, end = envelopes.levels.step, values.shape[1] * envelopes.levels.step
    offsets = [motion.distance(t) - motion.direction * x for t in (0.0, end) for x in envelopes.positions]
    rows = np.sort(along_train(values, step, envelopes.positions, motion, min(offsets), max(offsets)), axis=0)
    return float(rows[(len(rows) - 1) // 2].sum() * GRID_STEP / motion.speed)


def without_train(envelopes, motion) -> np.ndarray:
    """(n_sensor, n_bin) levels above the sensors' common level along the train, smoothed over 20 ms, at least 0."""
    step, positions = envelopes.levels.step, envelopes.positions
    values = _smooth_levels(envelopes)
    extent = [motion.distance(t) - motion.direction * x for t in (envelopes.begin, envelopes.end) for x in positions]
    start, stop = min(extent) - 15.0, max(extent) + 15.0
    rows = np.sort(along_train(values, step, positions, motion, start, stop), axis=0)
    shared = rows[(len(rows) - 1) // 2]
    offsets = start + np.arange(shared.size) * GRID_STEP
    centres = (np.arange(values.shape[1]) + 0.5) * step
    residuals = [
        row - np.interp(motion.distance(centres) - motion.direction * x, offsets, shared, left=0.0, right=0.0)
        for row, x in zip(values, positions)
    ]
    return np.clip(residuals, 0.0, None)
