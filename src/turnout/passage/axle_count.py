"""Count the axles of a train.

The count whose positions fit a known train is taken, else the one with the largest contrast.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.axle_positions import axle_places
from turnout.passage.comb_search import FINE, KMH, at_all_speeds
from turnout.passage.kinematics import Motion
from turnout.passage.sensor_stack import counts, template_counts
from turnout.passage.template_match import known_train
from turnout.passage.train_type import UNKNOWN, find_type, unknown_evidence

COMBS, PEAKS = 3, 3  # most sensors of a search by comb, least sensors of one by peaks
USUAL_SPEED = 25.0  # m/s, prior where only the bogies show the speed; sd is a factor of 1.8
BEYOND = 25.0  # m, audible before the first and behind the last axle together
SHORT = 0.3  # m, position error of a wheel at each of two sensors close together
PLACE_SE = 0.05  # m, error of a fitted axle position; from simulated passages


def best_count(heard, motion, span, patterns, settings):
    """(motion, axle finding, type): the count whose axles fit a template, else the one with the largest contrast.

    With few sensors a template is matched by its comb. With more sensors the cuts between peaks are tried first. Then
    the rows of vehicles that collect most of the profile are tried.
    """
    error = motion.speed * np.sqrt(2.0) * max(2 * settings.place_error, _reach(span)) / max(span, 0.1)
    error = min(error, 0.25 * motion.speed)
    if len(heard.positions) <= COMBS:
        known = known_train(heard, _near(motion, heard, 3.0 * error), patterns, settings)
        if known is not None:
            return known
        # a cut between the peaks of one or two sensors may fit a template by chance
        patterns = patterns if len(heard.positions) >= PEAKS else ()
    offers = [o for o in counts(heard, motion, settings)[:8] if len(o.offsets) >= 2]
    # a guess, reported as such, still leaves direction, track and speed
    offers = [o for o in offers if o.contrast >= 1.15] or offers[:1]
    best, first = _first_named(heard, motion, offers, error, patterns, settings)
    if best is None and patterns:
        best, _ = _first_named(heard, motion, template_counts(heard, motion, patterns), error, patterns, settings)
    offer, found = best or first or (None, None)
    return motion, offer, found


def _near(motion, heard, reach):
    """Motions at speeds within ``reach`` [m/s] of a given one, with the train's middle at the same time."""
    middle = 0.5 * (heard.begin + heard.end)
    speed = float(motion.speed_at(middle))
    low, high = max(speed - reach, 0.75 * speed), min(speed + reach, 1.3 * speed)
    speeds = np.geomspace(low, high, max(int(np.log(high / low) / FINE), 2))
    return [replace(motion, speed=v, start=middle - float(motion.way(middle)) / v, acceleration=0.0) for v in speeds]


def _reach(span):
    """Position error of a wheel at one sensor [m]: a long row of sensors averages it out."""
    return SHORT if span < 10.0 else 0.1


def _first_named(heard, motion, offers, error, patterns, settings):
    """First (axle finding, type) that fits a template, and the first one tried; None where there is none."""
    first, tried = None, set()
    for offer in offers:
        key = tuple(np.round(offer.offsets, 1))
        if key in tried:
            continue
        tried.add(key)
        for placed in _placed(heard, motion, offer):
            times = motion.time(placed.offsets)
            found = find_type(times, patterns, settings, float(motion.speed_at(times[0])), error, PLACE_SE)
            if found.type != UNKNOWN and _covers(heard, motion, placed.offsets):
                return (placed, found), first
            first = first or (placed, found)
    return None, first


def _covers(heard, motion, offsets) -> bool:
    """Whether the axles reach along the whole audible length.

    A few axles of a longer train would fit a shorter one by chance.
    """
    heard_length = motion.way(heard.end) - motion.way(heard.begin) - np.ptp(heard.positions)
    return bool(offsets[-1] - offsets[0] + BEYOND >= 0.9 * heard_length)


def _placed(heard, motion, offer):
    """The axles with positions fitted to the level around them, and then as given by the peaks."""
    yield replace(offer, offsets=axle_places(heard, motion, offer.offsets))
    yield offer


def count_without_distance(heard, patterns, settings):
    """(motion, axle finding, type) from one sensor.

    A known train is sought at any speed. Else the speed is taken that makes the most plausible bogies.
    """
    known = known_train(heard, at_all_speeds(heard.begin, settings), patterns, settings)
    if known is not None:
        return known
    slow, fast = settings.speed_minimum / KMH, settings.speed_maximum / KMH
    offers = []
    for speed in np.geomspace(slow, fast, 32):
        motion = Motion(float(speed), heard.begin)
        for offer in counts(heard, motion, settings)[:4]:
            if len(offer.offsets) >= 2 and offer.contrast >= 1.15:
                per_axle = unknown_evidence(np.diff(offer.offsets)) / (len(offer.offsets) - 1)
                usual = -0.5 * (np.log(speed / USUAL_SPEED) / 0.6) ** 2
                offers.append((usual + per_axle + 0.5 * min(np.log(offer.contrast), 1.5), motion, offer))
    for _, motion, offer in sorted(offers, key=lambda o: -o[0]):
        _, first = _first_named(heard, motion, [offer], 0.12 * motion.speed, (), settings)
        if first is not None:
            return motion, *first
    return None, None, None
