"""Detect a known train at a crossing's nose or a deep dip, where each wheel makes an impact that all sensors record.

Sensors that record these impacts louder than the wheels beside them agree on no speed. But what they share is one
position that the whole train passes. The residual is each sensor's own wheels, metres before or behind it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.passage.axle_count import match_template
from turnout.passage.comb import COMB_STEP, LEAD_LENGTH, Comb, profiles_at, teeth_of
from turnout.passage.comb_search import motions_at_all_speeds
from turnout.passage.sensor_envelopes import Levels, SensorEnvelopes
from turnout.passage.sensor_stack import without_train
from turnout.passage.slowness_scan import correlation_at, pair_correlations, stack_correlations

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_patterns import Pattern
    from turnout.passage.axles import AxleFinding
    from turnout.passage.kinematics import Motion
    from turnout.passage.train_type import TypeFinding

MIN_SENSORS = 3  # sensors: the median of two is the mean, which contains the wheels of both
# m: largest distance between a sensor and the nose, and of the nose outside the row of sensors. The sensors of a
# crossing panel stand around its nose; both numbers are judgements.
MAX_NOSE_DISTANCE, MAX_NOSE_OVERHANG = 15.0, 3.0
# By how much the true direction must exceed the other, in standard deviations of one sensor's response. In 37 simulated
# passages of 13 crossings it exceeds by at least 2.2; in one the wrong direction exceeded by 0.7.
MIN_DIRECTION_GAIN = 2.0
# Least share of the common envelope that the train explains, and largest residual of axle positions, in tolerances.
# True trains have at least 0.74 and at most 1.5; impacts of a flat wheel, taken for another train, have 0.57 and 2.6.
MIN_NOSE_SHARE, MAX_RESIDUAL = 2.0 / 3.0, 2.0
# s: smoothing of the levels, and least travel time between two sensors (twice that) to separate simultaneous from
# moving sources
SMOOTHING_TIME, MIN_TRAVEL_TIME = 0.02, 0.04
# Least excess of the correlation along the train over the simultaneous one. Without impacts, 320 simulated passages of
# four sensors have at least 0.14, and one in twenty less than 0.2.
MIN_MOTION_GAIN = 0.15
MAX_RESIDUAL_CORRELATION = 0.5  # simultaneous correlation of the residual; 1 % of those 320 passages have 0.52


def detect_at_nose(
    envelopes: SensorEnvelopes, patterns: Sequence[Pattern], settings: PassageSettings
) -> tuple[Motion, AxleFinding, TypeFinding] | None:
    """(motion, AxleFinding, TypeFinding) of a train of ``patterns`` whose wheels make impacts at one position.

    None where no train or no direction is certain. ``envelopes``: SensorEnvelopes of at least three sensors. The
    position of the impacts is a result as well: it is the origin of the motion.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of at least three sensors.
    patterns : sequence of Pattern
        Axle patterns of known trains.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    (Motion, AxleFinding, TypeFinding) or None
        Motion relative to the position of the impacts.
    """
    if len(envelopes.positions) < MIN_SENSORS or not patterns:
        return None
    match = match_template(
        _common_envelopes(envelopes), motions_at_all_speeds(envelopes.begin, settings), patterns, settings
    )
    if match is None:
        return None
    motion, axles, train_type = match
    residual = train_type.residual if train_type.residual is not None else np.inf
    if axles.contrast < 1.0 / (1.0 - MIN_NOSE_SHARE) or residual > MAX_RESIDUAL * settings.type_tolerance:
        return None
    response = _wheel_response(envelopes, motion, axles.offsets)
    (weaker, _, _), (stronger, nose, direction) = sorted(
        (*_nose_position(response, envelopes.positions, sign), sign) for sign in (-1, 1)
    )
    if stronger - weaker < MIN_DIRECTION_GAIN:
        return None
    return replace(motion.relative_to_axle(-direction * nose), direction=direction), axles, train_type


def simultaneity(envelopes: SensorEnvelopes, motion: Motion) -> float:
    """Excess of the sensors' correlation at the same moment over that along a train of this ``motion``.

    Above ``-MIN_MOTION_GAIN`` all sensors record the impacts at one position. -1 where they are too close to each
    other.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.

    Returns
    -------
    float
        Difference of two correlation coefficients. [-]
    """
    correlations = {
        (i, j): row
        for (i, j), row in pair_correlations(envelopes.levels.values, envelopes.levels.step, SMOOTHING_TIME).items()
        if abs(envelopes.positions[i] - envelopes.positions[j]) >= MIN_TRAVEL_TIME * motion.speed
    }
    if not correlations:
        return -1.0
    slowness = np.array([0.0, motion.direction / motion.speed])
    simultaneous, moving = stack_correlations(correlations, envelopes.levels.step, envelopes.positions, slowness)
    return float(simultaneous - moving)


def fixed_impact_correlation(envelopes: SensorEnvelopes, motion: Motion) -> tuple[float, float] | None:
    """(correlation, limit) where sensors record simultaneous impacts beside a train of this ``motion``, else None.

    Impacts as loud as wheels are counted as axles.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.

    Returns
    -------
    (correlation, limit) or None
        Correlation that reveals the impacts, and the limit that it exceeds. [-]
    """
    excess = simultaneity(envelopes, motion)
    if excess > -MIN_MOTION_GAIN:
        return excess, -MIN_MOTION_GAIN
    residual_correlation = float(
        correlation_at(np.zeros(1), without_train(envelopes, motion), envelopes.levels.step, envelopes.positions)[0]
    )
    return (residual_correlation, MAX_RESIDUAL_CORRELATION) if residual_correlation > MAX_RESIDUAL_CORRELATION else None


def _common_envelopes(envelopes: SensorEnvelopes) -> SensorEnvelopes:
    """One sensor at position 0 that records what most of them record at the same moment."""
    levels = envelopes.levels
    values, amplitude = (np.median(rows, axis=0)[None] for rows in (levels.values, levels.amplitude))
    common = Levels(values, levels.step, levels.scatter[:1], levels.loud_power[:1], amplitude)
    return SensorEnvelopes(common, np.median(envelopes.slow, axis=0)[None], np.zeros(1), envelopes.begin, envelopes.end)


def _wheel_response(envelopes: SensorEnvelopes, motion: Motion, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(distances (n,) [m], (n_sensor, n) response of each sensor to the row of wheels at that distance from the nose).

    The impacts are subtracted. The unit is the response's own standard deviation.
    """
    at_nose = replace(envelopes, positions=np.zeros(len(envelopes.positions)))
    profiles, behind = profiles_at(at_nose, [motion]), offsets - offsets[0]
    start = float(offsets[0] - profiles.origin[0])
    _, residuals = teeth_of(profiles, Comb.of(behind), start)
    grid = np.arange(residuals.shape[1]) * COMB_STEP - LEAD_LENGTH
    distance = np.arange(-MAX_NOSE_DISTANCE, MAX_NOSE_DISTANCE + 0.5 * COMB_STEP, COMB_STEP)
    grid_positions = start + behind + distance[:, None]
    collected = np.array([np.interp(grid_positions, grid, row, left=0.0, right=0.0).sum(axis=1) for row in residuals])
    return distance, collected / np.maximum(np.std(collected, axis=1, keepdims=True), 1e-12)


def _nose_position(response: tuple[np.ndarray, np.ndarray], positions: np.ndarray, sign: int) -> tuple[float, float]:
    """Largest sum of all sensors' response to their own wheels in one direction, and its nose position [m]."""
    distance, collected = response
    noses = np.arange(np.min(positions) - MAX_NOSE_OVERHANG, np.max(positions) + MAX_NOSE_OVERHANG, 0.5 * COMB_STEP)
    total = sum(np.interp(sign * (x - noses), distance, row) for x, row in zip(positions, collected))
    peak = int(np.argmax(total))
    return float(total[peak]), float(noses[peak])
