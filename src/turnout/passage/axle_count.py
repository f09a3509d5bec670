"""Count the axles of a train.

The count whose positions fit a known train is taken, else the one with the largest contrast.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.axle_positions import fit_axle_positions
from turnout.passage.comb_search import KMH_PER_MS, SPEED_STEP, motions_at_all_speeds
from turnout.passage.kinematics import Motion
from turnout.passage.sensor_stack import axle_counts, template_counts
from turnout.passage.template_match import match_template
from turnout.passage.train_type import UNKNOWN, find_type, unknown_evidence

MAX_COMB_SENSORS, MIN_PEAK_SENSORS = 3, 3  # most sensors of a search by comb, least sensors of one by peaks
TYPICAL_SPEED = 25.0  # m/s, prior where only the bogies show the speed; sd is a factor of 1.8
ENVELOPE_MARGIN = 25.0  # m, audible before the first and behind the last axle together
SHORT_SPAN_ERROR = 0.3  # m, position error of a wheel at each of two sensors close together
POSITION_SE = 0.05  # m, error of a fitted axle position; from simulated passages


def best_count(envelopes, motion, span, patterns, settings):
    """(motion, axle finding, type): the count whose axles fit a template, else the one with the largest contrast.

    With few sensors a template is matched by its comb. With more sensors the cuts between peaks are tried first. Then
    the rows of vehicles that collect most of the profile are tried.
    """
    error = motion.speed * np.sqrt(2.0) * max(2 * settings.place_error, _position_error(span)) / max(span, 0.1)
    error = min(error, 0.25 * motion.speed)
    if len(envelopes.positions) <= MAX_COMB_SENSORS:
        match = match_template(envelopes, _motions_near(motion, envelopes, 3.0 * error), patterns, settings)
        if match is not None:
            return match
        # a cut between the peaks of one or two sensors may fit a template by chance
        patterns = patterns if len(envelopes.positions) >= MIN_PEAK_SENSORS else ()
    candidates = [o for o in axle_counts(envelopes, motion, settings)[:8] if len(o.offsets) >= 2]
    # a guess, reported as such, still leaves direction, track and speed
    candidates = [o for o in candidates if o.contrast >= 1.15] or candidates[:1]
    typed, first = _first_with_type(envelopes, motion, candidates, error, patterns, settings)
    if typed is None and patterns:
        typed, _ = _first_with_type(
            envelopes, motion, template_counts(envelopes, motion, patterns), error, patterns, settings
        )
    axles, train_type = typed or first or (None, None)
    return motion, axles, train_type


def _motions_near(motion, envelopes, reach):
    """Motions at speeds within ``reach`` [m/s] of a given one, with the train's middle at the same time."""
    middle = 0.5 * (envelopes.begin + envelopes.end)
    speed = float(motion.speed_at(middle))
    low, high = max(speed - reach, 0.75 * speed), min(speed + reach, 1.3 * speed)
    speeds = np.geomspace(low, high, max(int(np.log(high / low) / SPEED_STEP), 2))
    return [
        replace(motion, speed=v, start=middle - float(motion.distance(middle)) / v, acceleration=0.0) for v in speeds
    ]


def _position_error(span):
    """Position error of a wheel at one sensor [m]: a long row of sensors averages it out."""
    return SHORT_SPAN_ERROR if span < 10.0 else 0.1


def _first_with_type(envelopes, motion, candidates, error, patterns, settings):
    """First (axle finding, type) that fits a template, and the first one tried; None where there is none."""
    untyped, checked = None, set()
    for candidate in candidates:
        key = tuple(np.round(candidate.offsets, 1))
        if key in checked:
            continue
        checked.add(key)
        for axles in _position_variants(envelopes, motion, candidate):
            times = motion.time(axles.offsets)
            train_type = find_type(times, patterns, settings, float(motion.speed_at(times[0])), error, POSITION_SE)
            if train_type.type != UNKNOWN and _is_whole_train(envelopes, motion, axles.offsets):
                return (axles, train_type), untyped
            untyped = untyped or (axles, train_type)
    return None, untyped


def _is_whole_train(envelopes, motion, offsets) -> bool:
    """Whether the axles reach along the whole audible length.

    A few axles of a longer train would fit a shorter one by chance.
    """
    audible_length = motion.distance(envelopes.end) - motion.distance(envelopes.begin) - np.ptp(envelopes.positions)
    return bool(offsets[-1] - offsets[0] + ENVELOPE_MARGIN >= 0.9 * audible_length)


def _position_variants(envelopes, motion, axles):
    """The axles with positions fitted to the level around them, and then as given by the peaks."""
    yield replace(axles, offsets=fit_axle_positions(envelopes, motion, axles.offsets))
    yield axles


def count_without_distance(envelopes, patterns, settings):
    """(motion, axle finding, type) from one sensor.

    A known train is sought at any speed. Else the speed is taken that makes the most plausible bogies.
    """
    match = match_template(envelopes, motions_at_all_speeds(envelopes.begin, settings), patterns, settings)
    if match is not None:
        return match
    slow, fast = settings.speed_minimum / KMH_PER_MS, settings.speed_maximum / KMH_PER_MS
    candidates = []
    for speed in np.geomspace(slow, fast, 32):
        motion = Motion(float(speed), envelopes.begin)
        for axles in axle_counts(envelopes, motion, settings)[:4]:
            if len(axles.offsets) >= 2 and axles.contrast >= 1.15:
                per_axle = unknown_evidence(np.diff(axles.offsets)) / (len(axles.offsets) - 1)
                log_prior = -0.5 * (np.log(speed / TYPICAL_SPEED) / 0.6) ** 2
                candidates.append((log_prior + per_axle + 0.5 * min(np.log(axles.contrast), 1.5), motion, axles))
    for _, motion, axles in sorted(candidates, key=lambda o: -o[0]):
        _, typed = _first_with_type(envelopes, motion, [axles], 0.12 * motion.speed, (), settings)
        if typed is not None:
            return motion, *typed
    return None, None, None
