"""Analyse one recording of a passage: axles, speed, direction, track, train type, and whatever is wrong with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnout.passage.axle_count import best_count, count_without_distance
from turnout.passage.axle_positions import sensor_times
from turnout.passage.channel_checks import channel_states, fell_silent, without_pulses
from turnout.passage.crossing_nose import AT_ONCE, at_a_nose, blows_at_one_place, heard_at_once
from turnout.passage.kinematics import Motion
from turnout.passage.result import Passage
from turnout.passage.second_train import second_train
from turnout.passage.sensor_consistency import wrong_channels, wrong_places
from turnout.passage.sensor_stack import aligned
from turnout.passage.slowness import pair_likeness, refine_slowness, scan_slowness
from turnout.passage.speed import combine, motion_of, slowness_from_sensors, with_change
from turnout.passage.train_detection import hearing, listen, narrowed, track_taken
from turnout.passage.train_type import UNKNOWN
from turnout.records import Recording, Rejection

SHORT_SPAN, PLACE_ALONE = 10.0, 0.3  # m: span of a short row of sensors; position error of each in it
SHORTEST = 0.1  # s, least duration of a recording: two blocks of the quiet level
CLEAR = 1.5  # least ratio of accepted to rejected peaks of an unknown train


def analyse(recording: Recording, sensors, patterns, settings) -> Passage:
    """Find the train in a recording.

    Parameters
    ----------
    recording : Recording
        Channels of acceleration; other channels are ignored.
    sensors : sequence of PassageSensor
        What the channels are; channels without a sensor are ignored.
    patterns : sequence of Pattern
        Axle patterns of known trains, may be empty.
    settings : PassageSettings

    Returns
    -------
    Passage
        "rejected" where no axle was found, "partly" where only a part of the passage can be used.
    """
    recording, pulses = without_pulses(recording, sensors)
    states = {s.name: s for s in channel_states(recording)}
    known = {s.name: s for s in sensors}
    findings = [*pulses, *(f for s in states.values() if s.name in known for f in s.findings)]
    used = [known[name] for name, state in states.items() if name in known and state.usable and state.until is None]
    lost = [known[name] for name, state in states.items() if name in known and state.until is not None]
    used, lost = (used, lost) if used else (lost, [])
    if not used:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, 1.0, "no channel can be used")))
    if recording.duration < SHORTEST:
        text = f"only {recording.duration:.3f} s were recorded"
        return Passage("rejected", (*findings, Rejection("no_train", recording.duration, SHORTEST, text)))
    samples = np.array([recording.signal(s.name) for s in used])
    samples = samples - np.median(samples, axis=1, keepdims=True)  # a zero offset is no vibration
    heard = listen(samples, recording.rate, [s.position for s in used], settings.envelope_step)
    if heard is None:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "nothing stands out of the noise")))
    track, _ = track_taken(heard, [s.track for s in used])
    rows = hearing(heard)
    if rows.size == 0:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "no sensor hears more than noise")))
    own = [used[i] for i in rows]
    passage = _of_train(narrowed(heard, rows), own, track, findings, recording.duration, patterns, settings)
    return _with_silent(passage, heard, used, lost) if passage.n_axle else passage


def _with_silent(passage, heard, used, lost):
    """Passage completed with the sensors that were lost: they say nothing about the train.

    Their data up to that moment can still be fitted.
    """
    side = [i for i, s in enumerate(used) if s.track in ("both", passage.track)]
    times = {used[i].name: passage.motion.passing(passage.offsets, used[i].position) for i in side}
    wrong = {f.detail.split(":")[0] for f in passage.findings}
    side = [i for i in side if used[i].name not in wrong]
    if not side and not lost:
        return passage
    names = [used[i].name for i in side]
    silent = fell_silent(heard.only(side), names, times, passage.motion.speed) if side else ()
    later = {s.name: passage.motion.passing(passage.offsets, s.position) for s in lost}
    later |= {f.detail.split(":")[0]: times[f.detail.split(":")[0]] for f in silent}
    findings = (*passage.findings, *silent)
    return replace(
        passage,
        at_sensor={**passage.at_sensor, **later},
        findings=findings,
        status="partly" if findings else passage.status,
    )


def _of_train(heard, used, track, findings, duration, patterns, settings) -> Passage:
    """Passage of the train that ``sensors`` record."""
    several, direction, every = bool(np.ptp(heard.positions) > 0.05), "unknown", heard
    if several:
        heard, used, direction, counted = _by_several(heard, used, findings, patterns, settings)
    else:
        counted = count_without_distance(heard, patterns, settings)
    start, offer, found = counted
    if offer is None:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "sound, but no axles in it")))
    passage = _settled(heard, used, start, offer, found, settings, several)
    passage = replace(passage, direction=direction, track=track, begin=heard.begin, end=heard.end)
    if passage.type.type == UNKNOWN:
        findings += _doubts(passage, every, several)
    findings += _cut_off(heard, passage, duration) + second_train(heard, passage, settings)
    return replace(passage, status="partly" if findings else "accepted", findings=tuple(findings))


def _by_several(heard, used, findings, patterns, settings):
    """(envelopes, sensors, direction, (motion, axle finding, type)) from several sensors along the rail.

    Sensors that agree on no motion go into ``findings``. They do not if a known train's impacts at a nose explain the
    data.
    """
    trouble, own, start, direction = _agreeing(heard, used, settings)
    counted = best_count(own[0], aligned(own[0], start), np.ptp(heard.positions), patterns, settings)
    accused = bool(trouble) and heard_at_once(heard, start) > -AT_ONCE  # impacts at one moment look like wrong clocks
    if counted[1] is None or counted[2].type == UNKNOWN or accused:
        banging = at_a_nose(heard, patterns, settings)
        if banging is not None:
            return heard, used, "facing" if banging[0].direction > 0 else "trailing", banging
    findings += trouble
    return *own, direction, counted


def _doubts(passage, heard, several) -> list[Rejection]:
    """Reasons to doubt the number of axles of a train without template."""
    clear, found = CLEAR if several else 2.0 * CLEAR, []
    if passage.contrast < clear:
        text = f"{passage.n_axle} axles, but the weakest peak is only {passage.contrast:.2f} times the next one"
        found.append(Rejection("axles_uncertain", passage.contrast, clear, text))
    if several and (blows := blows_at_one_place(heard, passage.motion)):
        text = f"{passage.n_axle} axles, but sensors hear blows at one moment, as of a crossing's nose or a deep dip"
        found.append(Rejection("axles_uncertain", *blows, text))
    return found


def _agreeing(heard, used, settings):
    """(findings on inconsistent sensors, (envelopes, sensors) of the consistent ones, their motion, its direction)."""
    found, keep = wrong_channels(heard, used, settings)
    used, heard = [s for s, k in zip(used, keep) if k], heard.only(np.flatnonzero(keep))
    start, direction = _from_scan(heard, settings)
    trouble, keep = wrong_places(heard, start, used)
    if trouble and np.ptp(heard.positions[keep]) > 0.05:
        found += trouble
        used, heard = [s for s, k in zip(used, keep) if k], heard.only(np.flatnonzero(keep))
        start, direction = _from_scan(heard, settings)
    return found, (heard, used), start, direction


def _from_scan(heard, settings):
    """First motion, and the name of its direction, from the slant stack."""
    scan = scan_slowness(heard.levels.values, heard.levels.step, heard.positions, settings)
    values, step, positions = heard.levels.values, heard.levels.step, heard.positions
    # a wheel is audible over about a third of a metre
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
    steady = Motion(1 / abs(slowness), start, 0.0, sign)
    return with_change(heard, steady, settings.acceleration_limit), name


def _settled(heard, used, start, offer, found, settings, several) -> Passage:
    """Passage with motion from sensors and template together: axle offsets on its scale, times at the sensors."""
    motion, offsets = start, offer.offsets
    # a short row of sensors and no template: the position error of each sensor decides
    alone = several and found.type == UNKNOWN and np.ptp(heard.positions) < SHORT_SPAN
    place_error = PLACE_ALONE if alone else settings.place_error
    for _ in range(2):
        times = sensor_times(heard, motion, offsets) if several else motion.time(offsets)[None]
        from_sensors = _sensor_speed(times, heard, motion.direction, place_error, settings) if several else None
        from_type = None
        centre = motion.time(offsets)
        middle = 0.5 * float(centre[0] + centre[-1])
        if found.type != UNKNOWN:
            from_type = (found.middle, found.middle_se, found.acceleration, found.acceleration_se, middle)
        if from_sensors is None and from_type is None:
            # an unknown train at one sensor: its bogies give the speed to one sixth
            from_type = (motion.speed, 0.16 * motion.speed, 0.0, 0.3, middle)
        speed = combine(from_sensors, from_type, middle)
        settled = abs(speed.at(centre[0]) / motion.speed - 1) < 2e-3
        motion = motion_of(speed, float(centre[0]), motion.direction)
        offsets = motion.way(centre)
        if settled:
            break
    if found.type == UNKNOWN and not several:
        speed = replace(speed, source="bogie")
    at_sensor = {s.name: motion.passing(offsets, x) for s, x in zip(used, heard.positions)}
    return Passage("accepted", (), motion, speed, offsets, type=found, at_sensor=at_sensor, contrast=offer.contrast)


def _sensor_speed(times, heard, direction, place_error, settings):
    """(v, se, a, a_se, time) from delays between sensors; None where fewer than two axles have times at two sensors."""
    good = np.isfinite(times)
    axles = good.sum(axis=0) >= 2
    if axles.sum() < 2:
        return None
    q, change, se, change_se, at, _ = slowness_from_sensors(
        times[:, axles], heard.positions, direction, place_error, settings.acceleration_limit
    )
    if not q > 0:
        return None
    return 1 / q, se / q**2, -change / q**2, max(change_se / q**2, 1e-4), at


def _cut_off(heard, passage, duration):
    """Findings where the train is present at the start or at the end of the recording."""
    found = []
    # an unknown train may have a further bogie, as far away as its bogies are from each other
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
