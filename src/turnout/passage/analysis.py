"""Analyse one recording of a passage: axles, speed, direction, track, train type, and whatever is wrong with it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import KMH
from turnout.errors import REMARK_REASONS
from turnout.passage.axle_count import best_count, count_without_distance
from turnout.passage.axles import MAX_LEFT_HEIGHT, sensor_times
from turnout.passage.channel_checks import channel_states, lost_sensors
from turnout.passage.cleaning import clean
from turnout.passage.crossing_nose import MIN_MOTION_GAIN, detect_at_nose, fixed_impact_correlation, simultaneity
from turnout.passage.kinematics import Motion
from turnout.passage.position_checks import inconsistent_channels, inconsistent_positions
from turnout.passage.result import Passage
from turnout.passage.sensor_stack import align_sensors, second_train
from turnout.passage.slowness_scan import pair_correlations, refine_slowness, scan_slowness
from turnout.passage.speed import combine_speeds, motion_of, slowness_from_sensors, with_acceleration
from turnout.passage.train_detection import audible_sensors, restrict_to, sensor_envelopes, train_track
from turnout.passage.train_type import UNKNOWN
from turnout.records import Recording, Rejection

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_patterns import Pattern
    from turnout.passage.axles import AxleFinding
    from turnout.passage.result import PassageSensor
    from turnout.passage.sensor_envelopes import SensorEnvelopes
    from turnout.passage.train_type import TypeFinding

MAX_SHORT_SPAN, SHORT_SPAN_ERROR = 10.0, 0.3  # m: span of a short row of sensors; position error of each in it
MIN_DURATION = 0.1  # s, least duration of a recording: two blocks of the quiet level
MAX_MOTION_PASSES = 4  # of the times at the sensors and the motion in turn
MIN_CONTRAST = 1.5  # least ratio of accepted to rejected peaks of an unknown train
MIN_NAMED_CONTRAST = 1.0  # the same of a train with a template: no peak that it leaves is higher than its weakest axle


def analyse(
    recording: Recording, sensors: Sequence[PassageSensor], patterns: Sequence[Pattern], settings: PassageSettings
) -> Passage:
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
        Settings of the passage analysis.

    Returns
    -------
    Passage
        "rejected" where no axle was found, "partly" where only a part of the passage can be used.
    """
    recording, removed = clean(recording, sensors)
    states = {s.name: s for s in channel_states(recording)}
    by_name = {s.name: s for s in sensors}
    findings = [*removed, *(f for s in states.values() if s.name in by_name for f in s.findings)]
    usable = [
        by_name[name] for name, state in states.items() if name in by_name and state.usable and state.lost_at is None
    ]
    lost = [by_name[name] for name, state in states.items() if name in by_name and state.lost_at is not None]
    usable, lost = (usable, lost) if usable else (lost, [])
    if not usable:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, 1.0, "no channel can be used")))
    if recording.duration < MIN_DURATION:
        text = f"only {recording.duration:.3f} s were recorded"
        return Passage("rejected", (*findings, Rejection("no_train", recording.duration, MIN_DURATION, text)))
    samples = np.array([recording.signal(s.name) for s in usable])
    samples = samples - np.median(samples, axis=1, keepdims=True)  # a zero offset is no vibration
    positions = np.array([s.position for s in usable])
    envelopes = sensor_envelopes(samples, recording.rate, positions, settings.envelope_step)
    if envelopes is None:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "nothing stands out of the noise")))
    track, _ = train_track(envelopes, [s.track for s in usable])
    rows = audible_sensors(envelopes, [s.track not in ("both", track) for s in usable])
    if rows.size == 0:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "no sensor records more than noise")))
    audible = [usable[i] for i in rows]
    passage = _analyse_train(
        restrict_to(envelopes, rows), audible, track, findings, recording.duration, patterns, settings
    )
    return _with_lost_sensors(passage, envelopes, usable, lost) if passage.n_axle else passage


def _with_lost_sensors(
    passage: Passage, envelopes: SensorEnvelopes, sensors: Sequence[PassageSensor], lost: Sequence[PassageSensor]
) -> Passage:
    """Passage completed with the sensors that were lost: they say nothing about the train.

    Their data up to that moment can still be fitted.
    """
    on_track, motion = [i for i, s in enumerate(sensors) if s.track in ("both", passage.track)], passage.train_motion
    times = {sensors[i].name: motion.passing(passage.offsets, sensors[i].position) for i in on_track}
    doubted_names = {name for f in passage.findings for name in f.channels}
    on_track = [i for i in on_track if sensors[i].name not in doubted_names]
    if not on_track and not lost:
        return passage
    names = [sensors[i].name for i in on_track]
    silent = lost_sensors(envelopes.select(on_track), names, times, motion.speed) if on_track else []
    lost_times = {s.name: motion.passing(passage.offsets, s.position) for s in lost}
    lost_times |= {name: times[name] for f in silent for name in f.channels}
    findings = (*passage.findings, *silent)
    return replace(
        passage,
        at_sensor={**passage.at_sensor, **lost_times},
        findings=findings,
        status=_status(findings, passage.status),
    )


def _status(findings: Iterable[Rejection], otherwise: str) -> str:
    """ "partly" if a finding limits what can be used: what was replaced or subtracted does not."""
    return "partly" if any(f.reason not in REMARK_REASONS for f in findings) else otherwise


def _analyse_train(
    envelopes: SensorEnvelopes,
    sensors: Sequence[PassageSensor],
    track: str,
    findings: list[Rejection],
    duration: float,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
) -> Passage:
    """Passage of the train that ``sensors`` record.

    Its motion is given relative to position 0 where it is among the sensors, else to the sensor nearest to it:
    a train that starts within the recording was never at a distant origin.
    """
    origin = float(np.clip(0.0, np.min(envelopes.positions), np.max(envelopes.positions)))
    envelopes = envelopes.relative_to(origin)
    is_multi_sensor, direction, all_envelopes = bool(np.ptp(envelopes.positions) > 0.05), "unknown", envelopes
    if is_multi_sensor:
        envelopes, sensors, direction, count = _count_by_several_sensors(
            envelopes, sensors, findings, patterns, settings
        )
    else:
        count = count_without_distance(envelopes, patterns, settings)
    if count is None:
        return Passage("rejected", (*findings, Rejection("no_train", 0.0, None, "vibration, but no axles in it")))
    motion, axles, train_type = count
    passage = _estimate_motion(envelopes, sensors, motion, axles, train_type, settings, is_multi_sensor)
    passage = replace(passage, direction=direction, track=track, begin=envelopes.begin, end=envelopes.end)
    findings += _axle_count_doubts(passage, axles, all_envelopes, is_multi_sensor, settings)
    findings += _out_of_search(passage, settings)
    findings += _truncation_findings(envelopes, passage, duration) + second_train(envelopes, passage, settings)
    motion = passage.train_motion
    motion = replace(motion, origin=motion.origin + origin)
    return replace(passage, motion=motion, status=_status(findings, "accepted"), findings=tuple(findings))


def _count_by_several_sensors(
    envelopes: SensorEnvelopes,
    sensors: Sequence[PassageSensor],
    findings: list[Rejection],
    patterns: Sequence[Pattern],
    settings: PassageSettings,
) -> tuple[SensorEnvelopes, Sequence[PassageSensor], str, tuple[Motion, AxleFinding, TypeFinding] | None]:
    """(envelopes, sensors, direction, (motion, axle finding, type) or None) from several sensors along the rail.

    Sensors that agree on no motion go into ``findings``. They do not if a known train's impacts at a nose explain the
    data.
    """
    inconsistencies, consistent, motion, direction = _consistent_sensors(envelopes, sensors, settings)
    count = best_count(
        consistent[0], align_sensors(consistent[0], motion), float(np.ptp(envelopes.positions)), patterns, settings
    )
    is_simultaneous = (
        bool(inconsistencies) and simultaneity(envelopes, motion) > -MIN_MOTION_GAIN
    )  # impacts at one moment look like wrong clocks
    is_uncertain = count is None or count[2].type == UNKNOWN or count[1].contrast < MIN_NAMED_CONTRAST
    if is_uncertain or is_simultaneous:
        at_nose = detect_at_nose(envelopes, patterns, settings)
        if at_nose is not None:
            return envelopes, sensors, "facing" if at_nose[0].direction > 0 else "trailing", at_nose
    findings += inconsistencies
    return *consistent, direction, count


def _axle_count_doubts(
    passage: Passage,
    axles: AxleFinding,
    envelopes: SensorEnvelopes,
    is_multi_sensor: bool,
    settings: PassageSettings,
) -> list[Rejection]:
    """Reasons to doubt the number of axles.

    The count of an unknown train is a cut between high and low peaks. Another cut that is nearly as clear may be right.
    A known train has the doubts of its row of vehicles.
    """
    is_named = passage.type is not None and passage.type.type != UNKNOWN
    min_contrast = MIN_NAMED_CONTRAST if is_named else MIN_CONTRAST if is_multi_sensor else 2.0 * MIN_CONTRAST
    n = f"{passage.n_axle} axles"
    min_lead = float(np.log(settings.type_probability / max(1.0 - settings.type_probability, 1e-12)))
    doubts: list[Rejection] = []
    if passage.contrast < min_contrast:
        text = f"{n}, but the weakest peak is only {passage.contrast:.2f} times the next one"
        doubts.append(Rejection("axles_uncertain", passage.contrast, min_contrast, text))
    elif passage.contrast < min_contrast * axles.rival_contrast:
        lead = passage.contrast / axles.rival_contrast
        text = (
            f"{n}, whose weakest peak is {passage.contrast:.2f} times the next one; another number "
            f"of axles divides the peaks nearly as clearly, {axles.rival_contrast:.2f} times"
        )
        doubts.append(Rejection("axles_uncertain", lead, min_contrast, text))
    elif is_named and axles.lead < min_lead:
        text = f"{n}, but with a vehicle exchanged another number is nearly as likely ({axles.lead:.1f} nat less)"
        doubts.append(Rejection("axles_uncertain", axles.lead, min_lead, text))
    elif is_named and axles.further > MAX_LEFT_HEIGHT:
        text = f"{n}, but a wheel of {axles.further:.2f} times the median amplitude is at none of them"
        doubts.append(Rejection("axles_uncertain", axles.further, MAX_LEFT_HEIGHT, text))
    elif not is_named and axles.weakest < MIN_CONTRAST * axles.further:
        ratio = axles.weakest / axles.further
        text = f"{n}, but the weakest wheel has only {ratio:.2f} times the amplitude of one that is left out"
        doubts.append(Rejection("axles_uncertain", ratio, MIN_CONTRAST, text))
    if is_multi_sensor and not is_named and (impacts := fixed_impact_correlation(envelopes, passage.train_motion)):
        text = (
            f"{passage.n_axle} axles, but sensors record impacts at one moment, as of a crossing's nose or a deep dip"
        )
        doubts.append(Rejection("axles_uncertain", *impacts, text))
    return doubts


def _out_of_search(passage: Passage, settings: PassageSettings) -> list[Rejection]:
    """Finding where the speed lies outside the range in which trains are sought: the right speed was never tried.

    One standard error beyond the range still belongs to it.
    """
    if passage.speed is None:
        return []
    speed, se = KMH * passage.speed.speed, KMH * passage.speed.se
    limits = (settings.speed_minimum, settings.speed_maximum)
    if limits[0] - se <= speed <= limits[1] + se:
        return []
    limit = min(limits, key=lambda v: abs(v - speed))
    text = (
        f"{passage.n_axle} axles at {speed:.1f} km/h, but trains are sought from {limits[0]:g} to {limits[1]:g} km/h: "
        "speed and axles are guesses; set passage.speed_minimum or passage.speed_maximum"
    )
    return [Rejection("axles_uncertain", speed, limit, text)]


def _consistent_sensors(
    envelopes: SensorEnvelopes, sensors: Sequence[PassageSensor], settings: PassageSettings
) -> tuple[list[Rejection], tuple[SensorEnvelopes, Sequence[PassageSensor]], Motion, str]:
    """(findings on inconsistent sensors, (envelopes, sensors) of the consistent ones, their motion, its direction)."""
    findings, keep = inconsistent_channels(envelopes, sensors, settings)
    sensors, envelopes = [s for s, k in zip(sensors, keep) if k], envelopes.select(np.flatnonzero(keep))
    motion, direction = _motion_from_scan(envelopes, settings)
    position_findings, keep = inconsistent_positions(envelopes, motion, sensors)
    if position_findings and np.ptp(envelopes.positions[keep]) > 0.05:
        findings += position_findings
        sensors, envelopes = [s for s, k in zip(sensors, keep) if k], envelopes.select(np.flatnonzero(keep))
        motion, direction = _motion_from_scan(envelopes, settings)
    return findings, (envelopes, sensors), motion, direction


def _motion_from_scan(envelopes: SensorEnvelopes, settings: PassageSettings) -> tuple[Motion, str]:
    """First motion, and the name of its direction, from the slant stack."""
    scan = scan_slowness(envelopes.levels.values, envelopes.levels.step, envelopes.positions, settings)
    values, step, positions = envelopes.levels.values, envelopes.levels.step, envelopes.positions
    # a wheel is audible over about a third of a metre
    peaks = [n for n, _ in scan.peaks(3)]
    correlations = pair_correlations(values, step, float(np.clip(0.3 * abs(peaks[0]), 0.004, 0.03)))
    refined = [refine_slowness(correlations, step, positions, n) for n in peaks]
    slowness, correlation = max(refined, key=lambda f: f[1])
    sign = 1 if slowness > 0 else -1
    opposite_correlations = np.where(np.sign(scan.slowness) == -sign, scan.correlation, -np.inf)
    opposite_correlation = refine_slowness(
        correlations, step, positions, scan.slowness[int(np.argmax(opposite_correlations))]
    )[1]
    name = "unknown" if correlation - opposite_correlation < 0.01 else "facing" if sign > 0 else "trailing"
    reference = float(np.mean(envelopes.positions))
    start = envelopes.begin - sign * reference * abs(slowness)
    steady = Motion(1 / abs(slowness), start, 0.0, sign)
    return with_acceleration(envelopes, steady, settings.acceleration_limit), name


def _estimate_motion(
    envelopes: SensorEnvelopes,
    sensors: Sequence[PassageSensor],
    initial: Motion,
    axles: AxleFinding,
    train_type: TypeFinding,
    settings: PassageSettings,
    is_multi_sensor: bool,
) -> Passage:
    """Passage with motion from sensors and template together: axle offsets on its scale, times at the sensors.

    The axles are those of a mean over the sensors. In the middle of the sensors their times are right also where the
    first motion has a wrong acceleration; elsewhere the last motion gives them.
    """
    motion, offsets = initial.from_position(float(np.mean(envelopes.positions))), axles.offsets
    # a short row of sensors and no template: the position error of each sensor decides
    unaided = is_multi_sensor and train_type.type == UNKNOWN and np.ptp(envelopes.positions) < MAX_SHORT_SPAN
    position_error = SHORT_SPAN_ERROR if unaided else settings.place_error
    for _ in range(MAX_MOTION_PASSES):
        times = sensor_times(envelopes, motion, offsets) if is_multi_sensor else motion.time(offsets)[None]
        from_sensors = (
            _sensor_speed(times, envelopes, motion.direction, position_error, settings) if is_multi_sensor else None
        )
        from_type, is_guess = None, False
        centre = motion.time(offsets)
        middle = 0.5 * float(centre[0] + centre[-1])
        if train_type.type != UNKNOWN:
            from_type = train_type.middle_motion
        if from_sensors is None and from_type is None:
            # an unknown train whose sensors give no speed: its bogies give it to one sixth
            middle_speed, is_guess = float(motion.speed_at(middle)), True
            from_type = (middle_speed, 0.16 * middle_speed, motion.acceleration, 0.3, middle)
        speed = combine_speeds(from_sensors, from_type, middle)
        converged = abs(speed.at(centre[0]) / motion.speed - 1) < 2e-3
        motion = replace(motion_of(speed, float(centre[0]), motion.direction), origin=motion.origin)
        offsets = motion.distance(centre)
        if converged:
            break
    motion = motion.from_position(0.0)
    speed = speed.moved_to(float(np.mean(motion.time(offsets[[0, -1]]))))
    if is_guess:
        speed = replace(speed, source="bogie")
    at_sensor = {s.name: motion.passing(offsets, x) for s, x in zip(sensors, envelopes.positions)}
    return Passage(
        "accepted", (), motion, speed, offsets, type=train_type, at_sensor=at_sensor, contrast=axles.contrast
    )


def _sensor_speed(
    times: np.ndarray, envelopes: SensorEnvelopes, direction: int, position_error: float, settings: PassageSettings
) -> tuple[float, float, float, float, float] | None:
    """(v, se, a, a_se, time) from delays between sensors.

    None where fewer than two axles have times at two sensors, or where no train can move like that: it would reverse,
    or its acceleration exceeds the limit.
    """
    is_timed = np.isfinite(times)
    axles = is_timed.sum(axis=0) >= 2
    if axles.sum() < 2:
        return None
    q, change, se, change_se, mean_time, _ = slowness_from_sensors(
        times[:, axles], envelopes.positions, direction, position_error, settings.acceleration_limit
    )
    if not q > 0:
        return None
    speed, acceleration = 1 / q, -change / q**2
    ends = np.array([np.nanmin(times[:, axles]), np.nanmax(times[:, axles])])
    if abs(acceleration) > settings.acceleration_limit or np.min(speed + acceleration * (ends - mean_time)) <= 0.0:
        return None
    return speed, se / q**2, acceleration, max(change_se / q**2, 1e-4), mean_time


def _truncation_findings(envelopes: SensorEnvelopes, passage: Passage, duration: float) -> list[Rejection]:
    """Findings where the train is present at the start or at the end of the recording."""
    findings = []
    # an unknown train may have a further bogie, as far away as its bogies are from each other
    is_typed = passage.type is not None and passage.type.type != UNKNOWN
    gap = 3.0 if is_typed else 1.05 * max(np.diff(passage.offsets).max(initial=3.0), 3.0)
    reach = gap / passage.train_motion.speed
    first = min(t[0] for t in passage.at_sensor.values())
    last = max(t[-1] for t in passage.at_sensor.values())
    if first < reach or envelopes.begin < 0.05:
        findings.append(Rejection("train_cut_off", first, reach, f"first axle {first:.2f} s after the start"))
    if duration - last < reach or duration - envelopes.end < 0.05:
        remaining = duration - last
        findings.append(Rejection("train_cut_off", remaining, reach, f"last axle {remaining:.2f} s before the end"))
    return findings
