"""How many axles: the count whose places fit a train that is known, else the one with the clearest cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.axle_positions import axle_places
from turnout.passage.comb_search import FINE, KMH, at_all_speeds
from turnout.passage.kinematics import Motion
from turnout.passage.sensor_stack import counts, template_counts
from turnout.passage.template_match import known_train
from turnout.passage.train_type import UNKNOWN, find_type, unknown_evidence

COMBS, PEAKS = 3, 3  # sensors up to which a known train is sought by its comb, and from which on by common peaks
USUAL_SPEED = 25.0  # m/s, where nothing but the bogies tells it; a factor of 1.8 is one standard deviation
BEYOND = 25.0  # m, a train is heard before its first axle and after its last one together
SHORT = 0.3  # m, that two sensors close to each other may hear a wheel off its place
PLACE_SE = 0.05  # m, of an axle placed by the level around it; measured against the simulation


def best_count(heard, motion, span, patterns, settings):
    """(motion, count, type): the count whose axles fit a template, else the one with the clearest cut.

    With few sensors a template is sought by its comb, else first among the cuts between peaks, then among the rows of
    vehicles that collect most of the profile.
    """
    error = motion.speed * np.sqrt(2.0) * max(2 * settings.place_error, _reach(span)) / max(span, 0.1)
    error = min(error, 0.25 * motion.speed)
    if len(heard.positions) <= COMBS:
        known = known_train(heard, _near(motion, heard, 3.0 * error), patterns, settings)
        if known is not None:
            return known
        # a cut between the peaks of one or two may fit a template by chance
        patterns = patterns if len(heard.positions) >= PEAKS else ()
    offers = [o for o in counts(heard, motion, settings)[:8] if len(o.offsets) >= 2]
    # a guess, which is said to be one, still leaves direction, track and speed
    offers = [o for o in offers if o.contrast >= 1.15] or offers[:1]
    best, first = _first_named(heard, motion, offers, error, patterns, settings)
    if best is None and patterns:
        best, _ = _first_named(heard, motion, template_counts(heard, motion, patterns), error, patterns, settings)
    offer, found = best or first or (None, None)
    return motion, offer, found


def _near(motion, heard, reach):
    """Motions at speeds within ``reach`` [m/s] of a known one that bring the train's middle past at the same time."""
    middle = 0.5 * (heard.begin + heard.end)
    speed = float(motion.speed_at(middle))
    low, high = max(speed - reach, 0.75 * speed), min(speed + reach, 1.3 * speed)
    speeds = np.geomspace(low, high, max(int(np.log(high / low) / FINE), 2))
    return [replace(motion, speed=v, start=middle - float(motion.way(middle)) / v, acceleration=0.0) for v in speeds]


def _reach(span):
    """How far off a sensor may hear a wheel [m]: many metres of sensors average it out."""
    return SHORT if span < 10.0 else 0.1


def _first_named(heard, motion, offers, error, patterns, settings):
    """First (count, type) that fits a template, and the first that was looked at; None where there is none."""
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
    """Whether axles reach along all that is heard; a few of a longer train's would fit a shorter one by chance."""
    heard_length = motion.way(heard.end) - motion.way(heard.begin) - np.ptp(heard.positions)
    return bool(offsets[-1] - offsets[0] + BEYOND >= 0.9 * heard_length)


def _placed(heard, motion, offer):
    """The offer with its axles placed by the whole level around them, and as its peaks have it."""
    yield replace(offer, offsets=axle_places(heard, motion, offer.offsets))
    yield offer


def count_without_distance(heard, patterns, settings):
    """(motion, count, type) from one sensor: a known train at any speed, else the speed that makes the best bogies."""
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
