"""Detect a known train at a crossing's nose or a deep dip, where each wheel makes an impact that all sensors record.

Sensors that record these impacts louder than the wheels beside them agree on no speed. But what they share is one
position that the whole train passes. The residual is each sensor's own wheels, metres before or behind it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.comb import LEAD, STEP, Comb, profiles_at, teeth_of
from turnout.passage.comb_search import at_all_speeds
from turnout.passage.envelope import Levels
from turnout.passage.second_train import without_train
from turnout.passage.sensor_stack import Listening
from turnout.passage.slowness import likeness_at, pair_likeness, stacked
from turnout.passage.template_match import known_train

LEAST = 3  # sensors: the median of two is the mean, which contains the wheels of both
# m: largest distance between a sensor and the nose, and of the nose outside the row of sensors. The sensors of a
# crossing panel stand around its nose; both numbers are judgements.
AWAY, BESIDE = 15.0, 3.0
# By how much the true direction must exceed the other, in standard deviations of one sensor's response. In 37 simulated
# passages of 13 crossings it exceeds by at least 2.2; in one the wrong direction exceeded by 0.7.
CLEARLY = 2.0
# Least share of the common envelope that the train explains, and largest residual of axle positions, in tolerances.
# True trains have at least 0.74 and at most 1.5; impacts of a flat wheel, taken for another train, have 0.57 and 2.6.
OF_ONE_PLACE, OFF = 2.0 / 3.0, 2.0
# s: smoothing of the levels, and least travel time between two sensors (twice that) to separate simultaneous from
# moving sources
SMOOTH, APART = 0.02, 0.04
# Least excess of the correlation along the train over the simultaneous one. Without impacts, 320 simulated passages of
# four sensors have at least 0.14, and one in twenty less than 0.2.
AT_ONCE = 0.15
LEFT = 0.5  # simultaneous correlation of the residual; 1 % of those 320 passages have 0.52


def at_a_nose(heard, patterns, settings):
    """(motion, AxleFinding, TypeFinding) of a train of ``patterns`` whose wheels make impacts at one position.

    None where no train or no direction is certain. ``envelopes``: SensorEnvelopes of at least three sensors. The
    position of the impacts is a result as well: it is the origin of the motion.
    """
    if len(heard.positions) < LEAST or not patterns:
        return None
    known = known_train(_together(heard), at_all_speeds(heard.begin, settings), patterns, settings)
    if known is None:
        return None
    motion, offer, found = known
    if offer.contrast < 1.0 / (1.0 - OF_ONE_PLACE) or found.residual > OFF * settings.type_tolerance:
        return None
    collected = _own_wheels(heard, motion, offer.offsets)
    (other, _, _), (most, nose, way) = sorted((*_best(collected, heard.positions, sign), sign) for sign in (-1, 1))
    if most - other < CLEARLY:
        return None
    return replace(motion.moved(-way * nose), direction=way), offer, found


def heard_at_once(heard, motion) -> float:
    """Excess of the sensors' correlation at the same moment over that along a train of this ``motion``.

    Above ``-MIN_MOTION_GAIN`` all sensors record the impacts at one position. -1 where they are too close to each
    other.
    """
    pairs = {
        (i, j): row
        for (i, j), row in pair_likeness(heard.levels.values, heard.levels.step, SMOOTH).items()
        if abs(heard.positions[i] - heard.positions[j]) >= APART * motion.speed
    }
    if not pairs:
        return -1.0
    slowness = np.array([0.0, motion.direction / motion.speed])
    at_once, along = stacked(pairs, heard.levels.step, heard.positions, slowness)
    return float(at_once - along)


def blows_at_one_place(heard, motion) -> tuple[float, float] | None:
    """(correlation, limit) where sensors record simultaneous impacts beside a train of this ``motion``, else None.

    Impacts as loud as wheels are counted as axles.
    """
    likeness = heard_at_once(heard, motion)
    if likeness > -AT_ONCE:
        return likeness, -AT_ONCE
    left = float(likeness_at([0.0], without_train(heard, motion), heard.levels.step, heard.positions)[0])
    return (left, LEFT) if left > LEFT else None


def _together(heard) -> Listening:
    """One sensor at position 0 that records what most of them record at the same moment."""
    levels = heard.levels
    values, amplitude = (np.median(rows, axis=0)[None] for rows in (levels.values, levels.amplitude))
    one = Levels(values, levels.step, levels.scatter[:1], levels.loud[:1], amplitude)
    return Listening(one, np.median(heard.slow, axis=0)[None], np.zeros(1), heard.begin, heard.end)


def _own_wheels(heard, motion, offsets):
    """(distances (n,) [m], (n_sensor, n) response of each sensor to the row of wheels at that distance from the nose).

    The impacts are subtracted. The unit is the response's own standard deviation.
    """
    there = replace(heard, positions=np.zeros(len(heard.positions)))
    profiles, behind = profiles_at(there, [motion]), offsets - offsets[0]
    start = float(offsets[0] - profiles.origin[0])
    _, rest = teeth_of(profiles, Comb.of(behind), start)
    grid = np.arange(rest.shape[1]) * STEP - LEAD
    distance = np.arange(-AWAY, AWAY + 0.5 * STEP, STEP)
    at = start + behind + distance[:, None]
    collected = np.array([np.interp(at, grid, row, left=0.0, right=0.0).sum(axis=1) for row in rest])
    return distance, collected / np.maximum(np.std(collected, axis=1, keepdims=True), 1e-12)


def _best(own, positions, sign) -> tuple[float, float]:
    """Largest sum of all sensors' response to their own wheels in one direction, and its nose position [m]."""
    distance, collected = own
    noses = np.arange(np.min(positions) - BESIDE, np.max(positions) + BESIDE, 0.5 * STEP)
    total = sum(np.interp(sign * (x - noses), distance, row) for x, row in zip(positions, collected))
    best = int(np.argmax(total))
    return float(total[best]), float(noses[best])
