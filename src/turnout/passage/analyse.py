"""One recording in, one passage out: axles, speed, direction, track, type, and everything that is wrong with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.at_sensors import sensor_times
from turnout.passage.findings import Passage
from turnout.passage.listen import hearing, listen, narrowed, track_taken
from turnout.passage.motion import Motion
from turnout.passage.order import wrong_channels, wrong_places
from turnout.passage.other_train import second_train
from turnout.passage.place import axle_places
from turnout.passage.slowness import pair_likeness, refine_slowness, scan_slowness
from turnout.passage.soundness import channel_states
from turnout.passage.speed import combine, motion_of, slowness_from_sensors
from turnout.passage.stack import aligned, counts, template_counts
from turnout.passage.train_type import UNKNOWN, find_type, unknown_evidence
from turnout.records import Recording, Rejection

KMH = 3.6
USUAL_SPEED = 25.0  # m/s, where nothing but the bogies tells it; a factor of 1.8 is one standard deviation
CLEAR = 1.5  # least ratio between accepted and refused peaks of an unknown train
PLACE_SE = 0.05  # m, of an axle placed by the level around it; measured against the simulation


def analyse(recording: Recording, sensors, patterns, settings) -> Passage:
    """Find the train in a recording.

    Parameters
    ----------
    recording : Recording
        Channels of accelerations; others are left alone.
    sensors : sequence of PassageSensor
        What the channels are; channels without a sensor are left alone.
    patterns : sequence of Pattern
        Axle patterns of known trains, may be empty.
    settings : PassageSettings

    Returns
    -------
    Passage
        "rejected" where no axle was found, "partly" where something is wrong and part of it is sound.
    """
    states = {s.name: s for s in channel_states(recording)}
    known = {s.name: s for s in sensors}
    findings = [f for s in states.values() if s.name in known for f in s.findings]
    used = [known[name] for name, state in states.items() if name in known and state.usable and state.until is None]
    lost = [known[name] for name, state in states.items() if name in known and state.until is not None]
    used, lost = (used, lost) if used else (lost, [])
    if not used:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, 1.0, "no channel can be used")))
    samples = np.array([recording.signal(s.name) for s in used])
    heard = listen(samples, recording.rate, [s.position for s in used], settings.envelope_step)
    if heard is None:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "nothing stands out of the noise")))
    track, _ = track_taken(heard, [s.track for s in used])
    rows = hearing(heard)
    if rows.size == 0:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "no sensor hears more than noise")))
    used = [used[i] for i in rows]
    passage = _of_train(narrowed(heard, rows), used, track, findings, recording.duration, patterns, settings)
    if not passage.n_axle:
        return passage
    # a sensor that fell silent says nothing about the train, but its record up to then can be fitted
    later = {s.name: passage.motion.passing(passage.offsets, s.position) for s in lost}
    return replace(passage, at_sensor={**passage.at_sensor, **later})


def _of_train(heard, used, track, findings, duration, patterns, settings) -> Passage:
    """The train that the sensors ``used`` hear."""
    span = np.ptp(heard.positions)
    if span > 0.05:
        heard, used, start, direction = _agreeing(heard, used, findings, settings)
        start = aligned(heard, start)
        offer, found = _best_count(heard, start, span, patterns, settings)
    else:
        direction = "unknown"
        start, offer, found = _without_distance(heard, patterns, settings)
    if offer is None:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "sound, but no axles in it")))
    passage = _settled(heard, used, start, offer, found, settings, span > 0.05)
    passage = replace(passage, direction=direction, track=track, begin=heard.begin, end=heard.end)
    clear = CLEAR if span > 0.05 else 2.0 * CLEAR
    if passage.type.type == UNKNOWN and passage.contrast < clear:
        text = f"{passage.n_axle} axles, but the weakest peak is only {passage.contrast:.2f} times the next one"
        findings.append(Rejection("axles_uncertain", passage.contrast, clear, text))
    findings += _cut_off(heard, passage, duration) + second_train(heard, passage, settings)
    return replace(passage, status="partly" if findings else "accepted", findings=tuple(findings))


def _agreeing(heard, used, findings, settings):
    """The sensors that agree on a motion, that motion and its direction; what does not agree goes into ``findings``."""
    trouble, keep = wrong_channels(heard, used, settings)
    findings += trouble
    used, heard = [s for s, k in zip(used, keep) if k], heard.only(np.flatnonzero(keep))
    start, direction = _from_scan(heard, settings)
    trouble, keep = wrong_places(heard, start, used)
    if trouble and np.ptp(heard.positions[keep]) > 0.05:
        findings += trouble
        used, heard = [s for s, k in zip(used, keep) if k], heard.only(np.flatnonzero(keep))
        start, direction = _from_scan(heard, settings)
    return heard, used, start, direction


def _from_scan(heard, settings):
    """First motion and the direction's name from the slant stack."""
    scan = scan_slowness(heard.levels.values, heard.levels.step, heard.positions, settings)
    values, step, positions = heard.levels.values, heard.levels.step, heard.positions
    # a wheel is heard over about a third of a metre
    near = [n for n, _ in scan.peaks(3)]
    pairs = pair_likeness(values, step, float(np.clip(0.3 * abs(near[0]), 0.004, 0.03)))
    found = [refine_slowness(pairs, step, positions, n) for n in near]
    slowness, likeness = max(found, key=lambda f: f[1])
    sign = 1 if slowness > 0 else -1
    opposite = np.where(np.sign(scan.slowness) == -sign, scan.likeness, -np.inf)
    against = refine_slowness(pairs, step, positions, scan.slowness[int(np.argmax(opposite))])[1]
    name = "unknown" if likeness - against < 0.01 else "facing" if sign > 0 else "trailing"
    reference = float(np.mean(heard.positions))
    start = heard.begin - sign * reference * abs(slowness)
    return Motion(1 / abs(slowness), start, 0.0, sign), name


def _best_count(heard, motion, span, patterns, settings):
    """The count whose axles fit a template, else the one with the clearest cut; and its type.

    First the cuts between peaks, then the rows of vehicles that collect most of the profile.
    """
    error = motion.speed * np.sqrt(2.0) * max(2 * settings.place_error, 0.1) / max(span, 0.1)
    error = min(error, 0.25 * motion.speed)
    offers = [o for o in counts(heard, motion, settings)[:8] if o.contrast >= 1.15 and len(o.offsets) >= 2]
    best, first = _first_named(heard, motion, offers, error, patterns, settings)
    if best is None:
        best, _ = _first_named(heard, motion, template_counts(heard, motion, patterns), error, patterns, settings)
    if best is None and len(heard.positions) < 4:
        best = _from_one_of_few(heard, motion, patterns, settings)
    return best or first or (None, None)


def _from_one_of_few(heard, motion, patterns, settings):
    """Two or three sensors that are not laid on each other well: each by itself, at speeds around the common one."""
    for i, x in enumerate(heard.positions):
        alone = heard.only([i])
        middle = motion.passing(0.5 * (motion.way(heard.end) - motion.way(heard.begin)), x)
        for factor in (1.0, 0.94, 1.06, 0.89, 1.12):
            near = replace(motion, speed=motion.speed * factor)
            near = replace(near, start=near.start + float(middle - near.passing(near.way(middle), 0.0)))
            offers = template_counts(alone, near, patterns, 2)
            best, _ = _first_named(alone, near, offers, 0.1 * near.speed, patterns, settings)
            if best is not None:
                offer, found = best
                # told from the common motion again, whose places along the train the caller goes on with
                times = near.passing(offer.offsets, x)
                offsets = motion.way(times) - motion.direction * x
                return replace(offer, offsets=offsets), found
    return None


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
            if found.type != UNKNOWN:
                return (placed, found), first
            first = first or (placed, found)
    return None, first


def _placed(heard, motion, offer):
    """The offer with its axles placed by the whole level around them, and as its peaks have it."""
    yield replace(offer, offsets=axle_places(heard, motion, offer.offsets))
    yield offer


def _without_distance(heard, patterns, settings):
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


def _settled(heard, used, start, offer, found, settings, several) -> Passage:
    """Motion from sensors and template together, axle offsets on its scale, times at the sensors."""
    motion, offsets = start, offer.offsets
    for _ in range(2):
        times = sensor_times(heard, motion, offsets) if several else motion.time(offsets)[None]
        from_sensors = _sensor_speed(times, heard.positions, motion.direction, settings) if several else None
        from_type = None
        if found.type != UNKNOWN:
            centre = motion.time(offsets)
            from_type = (found.speed, found.speed_se, found.acceleration, found.acceleration_se, centre[0])
        if from_sensors is None and from_type is None:
            # an unknown train on one sensor: its bogies give the speed to a sixth
            from_type = (motion.speed, 0.16 * motion.speed, 0.0, 0.3, float(motion.time(offsets[0])))
        first = float(motion.time(offsets[0]))
        speed = combine(from_sensors, from_type, first)
        axle_times = motion.time(offsets)
        settled = abs(speed.speed / motion.speed - 1) < 2e-3
        motion = motion_of(speed, first, motion.direction)
        offsets = motion.way(axle_times)
        if settled:
            break
    if found.type == UNKNOWN and not several:
        speed = replace(speed, source="bogie")
    at_sensor = {s.name: motion.passing(offsets, x) for s, x in zip(used, heard.positions)}
    return Passage("accepted", (), motion, speed, offsets, type=found, at_sensor=at_sensor, contrast=offer.contrast)


def _sensor_speed(times, positions, direction, settings):
    """(v, se, a, a_se, time) from delays between sensors; None where too few axles are heard at two sensors."""
    good = np.isfinite(times)
    axles = good.sum(axis=0) >= 2
    if axles.sum() < 2:
        return None
    q, change, se, change_se, at, _ = slowness_from_sensors(
        times[:, axles], positions, direction, settings.place_error, settings.acceleration_limit
    )
    if not q > 0:
        return None
    return 1 / q, se / q**2, -change / q**2, max(change_se / q**2, 1e-4), at


def _cut_off(heard, passage, duration):
    """Findings where the train is already or still there at an end of the recording."""
    found = []
    # another bogie of an unknown train may come as far behind as its bogies are apart
    gap = 3.0 if passage.type.type != UNKNOWN else 1.05 * max(np.diff(passage.offsets).max(initial=3.0), 3.0)
    reach = gap / passage.motion.speed
    first = min(t[0] for t in passage.at_sensor.values())
    last = max(t[-1] for t in passage.at_sensor.values())
    if first < reach or heard.begin < 0.05:
        found.append(Rejection("train_cut_off", first, reach, f"first axle {first:.2f} s after the start"))
    if duration - last < reach or duration - heard.end < 0.05:
        left = duration - last
        found.append(Rejection("train_cut_off", left, reach, f"last axle {left:.2f} s before the end"))
    return found
