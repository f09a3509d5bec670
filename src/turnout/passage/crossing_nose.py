"""A known train at a crossing's nose, or any deep dip: each wheel bangs there, and all sensors hear it at once.

Sensors that hear the bangs louder than the wheels beside them agree on no speed. But what they hear together is one
place that the whole train passes, and what is left then is each sensor's own wheels, metres before or behind.
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

LEAST = 3  # sensors: of two the median is the mean, with the wheels of both in it
# m between a sensor and the nose at most, and that a nose may lie outside the sensors: a crossing panel, whose row of
# sensors stands about its nose; both are judgements
AWAY, BESIDE = 15.0, 3.0
# By how much the true direction must collect more than the other, in standard deviations of one sensor's places: in 37
# simulated passages of 13 crossings it collects at least 2.2 more; in one the wrong direction had 0.7 more.
CLEARLY = 2.0
# Share of what all hear together that the train explains, and how far off its places axles may lie, in tolerances: true
# ones have 0.74 at least and 1.5 at most; the blows of a flat wheel, taken for another train, 0.57 and 2.6.
OF_ONE_PLACE, OFF = 2.0 / 3.0, 2.0
# s over which levels are taken, and that a train takes between two sensors for what they hear at once to be told from
# what follows it: two of them
SMOOTH, APART = 0.02, 0.04
# Of likeness: where nothing bangs, 320 simulated passages of four sensors are at least 0.14 more alike along the train
# than at the same moment, and a twentieth of them by less than 0.2.
AT_ONCE = 0.15
LEFT = 0.5  # likeness at the same moment of what the train leaves over; 0.52 in one of a hundred of those 320 passages


def at_a_nose(heard, patterns, settings):
    """(motion, AxleFinding, TypeFinding) of a train of ``patterns`` whose wheels bang at one place; None where none is
    sure, or its direction is not.

    ``heard``: Listening of at least three sensors. The place comes out with the train: it is in the motion.
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
    """How much more alike sensors are at the same moment than along a train of this ``motion``; above ``-AT_ONCE`` all
    of them hear the blows of one place. -1 where they are too close together to tell."""
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
    """(likeness, limit) where sensors hear at the same moment what does not run along with a train of this ``motion``,
    None where they do not: blows as loud as wheels are counted as axles."""
    likeness = heard_at_once(heard, motion)
    if likeness > -AT_ONCE:
        return likeness, -AT_ONCE
    left = float(likeness_at([0.0], without_train(heard, motion), heard.levels.step, heard.positions)[0])
    return (left, LEFT) if left > LEFT else None


def _together(heard) -> Listening:
    """One sensor that hears what most of them hear at the same moment, at place 0."""
    levels = heard.levels
    values, amplitude = (np.median(rows, axis=0)[None] for rows in (levels.values, levels.amplitude))
    one = Levels(values, levels.step, levels.scatter[:1], levels.loud[:1], amplitude)
    return Listening(one, np.median(heard.slow, axis=0)[None], np.zeros(1), heard.begin, heard.end)


def _own_wheels(heard, motion, offsets):
    """(distances (n,) [m], (n_sensor, n) what each sensor hears of the row of wheels so far from the nose, without the
    bangs and over its own standard deviation)."""
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
    """What all sensors collect of their own wheels in one direction, and the place of the nose [m] where it is most."""
    distance, collected = own
    noses = np.arange(np.min(positions) - BESIDE, np.max(positions) + BESIDE, 0.5 * STEP)
    total = sum(np.interp(sign * (x - noses), distance, row) for x, row in zip(positions, collected))
    best = int(np.argmax(total))
    return float(total[best]), float(noses[best])
