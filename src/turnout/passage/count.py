"""How many axles: the count whose places fit a train that is known, else the one with the clearest cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.motion import Motion
from turnout.passage.place import axle_places
from turnout.passage.stack import counts, template_counts
from turnout.passage.train_type import UNKNOWN, find_type, unknown_evidence

KMH = 3.6
USUAL_SPEED = 25.0  # m/s, where nothing but the bogies tells it; a factor of 1.8 is one standard deviation
BEYOND = 25.0  # m, a train is heard before its first axle and after its last one together
SHORT = 0.3  # m, that two sensors close to each other may hear a wheel off its place
PLACE_SE = 0.05  # m, of an axle placed by the level around it; measured against the simulation


def best_count(heard, motion, span, patterns, settings):
    """The count whose axles fit a template, else the one with the clearest cut; and its type.

    First the cuts between peaks, then the rows of vehicles that collect most of the profile.
    """
    error = motion.speed * np.sqrt(2.0) * max(2 * settings.place_error, _reach(span)) / max(span, 0.1)
    error = min(error, 0.25 * motion.speed)
    offers = [o for o in counts(heard, motion, settings)[:8] if len(o.offsets) >= 2]
    # a guess, which is said to be one, still leaves direction, track and speed
    offers = [o for o in offers if o.contrast >= 1.15] or offers[:1]
    best, first = _first_named(heard, motion, offers, error, patterns, settings)
    if best is None:
        best, _ = _first_named(heard, motion, template_counts(heard, motion, patterns), error, patterns, settings)
    if best is None and len(heard.positions) < 4:
        best = _from_one_of_few(heard, motion, patterns, settings)
    return best or first or (None, None)


def _reach(span):
    """How far off a sensor may hear a wheel [m]: many metres of sensors average it out."""
    return SHORT if span < 10.0 else 0.1


def _from_one_of_few(heard, motion, patterns, settings):
    """Two or three sensors that are not laid on each other well: each by itself, at speeds around the common one.

    Of all rows of vehicles that a sensor finds by itself, that which collects most.
    """
    found_by_one = []
    for i, x in enumerate(heard.positions):
        alone = heard.only([i])
        middle = motion.passing(0.5 * (motion.way(heard.end) - motion.way(heard.begin)), x)
        for factor in (1.0, 0.94, 1.06, 0.89, 1.12):
            near = replace(motion, speed=motion.speed * factor)
            near = replace(near, start=near.start + float(middle - near.passing(near.way(middle), 0.0)))
            offers = template_counts(alone, near, patterns, 4)
            best, _ = _first_named(alone, near, offers, 0.1 * near.speed, patterns, settings)
            if best is not None:
                offer, found = best
                # told from the common motion again, whose places along the train the caller goes on with
                times = near.passing(offer.offsets, x)
                offsets = motion.way(times) - motion.direction * x
                found_by_one.append((offer.contrast, replace(offer, offsets=offsets), found))
    return max(found_by_one, key=lambda f: f[0])[1:] if found_by_one else None


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
            found = find_type(times, patterns, settings, motion.speed, error, PLACE_SE)
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
    """One sensor: speeds are tried, the one that makes the best bogies or fits a template is taken."""
    offers = []
    for speed in np.geomspace(settings.speed_minimum / KMH, settings.speed_maximum / KMH, 32):
        motion = Motion(float(speed), heard.begin)
        for offer in counts(heard, motion, settings)[:4]:
            if len(offer.offsets) >= 2 and offer.contrast >= 1.15:
                per_axle = unknown_evidence(np.diff(offer.offsets)) / (len(offer.offsets) - 1)
                usual = -0.5 * (np.log(speed / USUAL_SPEED) / 0.6) ** 2
                offers.append((usual + per_axle + 0.5 * min(np.log(offer.contrast), 1.5), motion, offer))
    offers.sort(key=lambda o: -o[0])
    first, tried = None, set()
    for _, motion, offer in offers:
        key = tuple(np.round(motion.time(offer.offsets), 2))
        if key in tried or len(tried) == 12:
            continue
        tried.add(key)
        best, seen = _first_named(heard, motion, [offer], 0.12 * motion.speed, patterns, settings)
        if best is not None:
            return motion, *best
        first = first or (motion, *seen)
    return _by_template(heard, patterns, settings) or first or (None, None, None)


def _by_template(heard, patterns, settings):
    """One sensor, and no cut between peaks fits: the row of vehicles that fits best at any speed."""
    found = []
    for speed in np.geomspace(settings.speed_minimum / KMH, settings.speed_maximum / KMH, 32):
        motion = Motion(float(speed), heard.begin)
        found += [(o.contrast, motion, o) for o in template_counts(heard, motion, patterns, 2)]
    for _, motion, offer in sorted(found, key=lambda f: -f[0])[:8]:
        best, _ = _first_named(heard, motion, [offer], 0.12 * motion.speed, patterns, settings)
        if best is not None:
            return motion, *best
    return None
