"""Count the axles of a train.

The count whose positions fit a known train is taken, else the one with the largest contrast.

Match a known train to the envelopes of one or two sensors.

Its comb must explain more than any other's, and no other shape of its vehicles may explain much more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.constants import KMH
from turnout.passage.axles import AxleFinding, fit_axle_positions
from turnout.passage.comb import CORRELATION_LENGTH, centred_start, evidence, explained_share, fit_shape, profiles_at
from turnout.passage.comb_search import (
    SPEED_STEP,
    FittedRow,
    likeliest_rows,
    motion_at_middle,
    motions_at_all_speeds,
)
from turnout.passage.kinematics import Motion
from turnout.passage.sensor_stack import axle_counts, template_counts
from turnout.passage.train_type import UNKNOWN, TypeFinding, find_type, unknown_evidence
from turnout.passage.wheel_amplitudes import fit_amplitudes, settle_count

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_patterns import Pattern
    from turnout.passage.sensor_envelopes import SensorEnvelopes

MIN_EVIDENCE = 10.0  # nat, least log Bayes factor of a comb against no train
# Largest gain by another shape of the vehicles, as a share of the evidence, less what free numbers gain by chance.
# Simulated trains with a template gain 0.08 at most, similar trains without one at least 0.22.
MAX_SHAPE_GAIN = 0.14
RELATIVE_SPEEDS = np.linspace(-0.012, 0.012, 49)  # relative speeds around the best one
BEND_STEP = 0.2  # m, step of the train's middle against its ends between accelerations
STEADY_ACCELERATION, STEADY_SHARE = (
    0.02,
    0.8,
)  # m/s², sd of a steady train; share of trains that pass a turnout at a steady speed


def match_template(
    envelopes: SensorEnvelopes, motions: Sequence[Motion], patterns: Sequence[Pattern], settings: PassageSettings
) -> tuple[Motion, AxleFinding, TypeFinding] | None:
    """(motion, AxleFinding, TypeFinding) of the train of ``patterns`` in the envelopes, None where none is certain.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Of one sensor or more.
    motions : sequence of Motion
        Candidates, in order of their speed.
    patterns : sequence of Pattern
        Known trains; their rows are tried with one vehicle type per group, then vehicle by vehicle.
    settings : PassageSettings
        Least probability of a type, prior of trains without template, limit of the acceleration.

    Returns
    -------
    (Motion, AxleFinding, TypeFinding) or None
        Motion at the best speed, axles of the comb, and the type with its posterior probability.
    """
    rows_by_type = likeliest_rows(envelopes, motions, tuple(patterns)) if patterns else {}
    if not rows_by_type:
        return None
    likeliest = max(rows_by_type.values(), key=lambda f: f.evidence)
    # here a train without template explains no more than noise; its shape is tested below
    log_posterior = {
        name: f.evidence + np.log((1 - settings.unknown_prior) / len(rows_by_type)) for name, f in rows_by_type.items()
    }
    log_posterior[UNKNOWN] = MIN_EVIDENCE + np.log(settings.unknown_prior)
    highest = max(log_posterior.values())
    total = sum(np.exp(value - highest) for value in log_posterior.values())
    posterior = {name: float(np.exp(value - highest) / total) for name, value in sorted(log_posterior.items())}
    if posterior[likeliest.pattern.type] < settings.type_probability or likeliest.evidence < MIN_EVIDENCE:
        return None
    likeliest, wheels, lead = settle_count(envelopes, likeliest)
    profiles = profiles_at(envelopes, [likeliest.motion])
    shape, share_before, share_after = fit_shape(profiles, likeliest.vehicles, likeliest.comb.offsets, likeliest.start)
    n, length = len(envelopes.positions), float(profiles.length[0])
    n_free = sum(len(positions) for positions in {v.name: v.axles for v in likeliest.vehicles}.values())
    gain = (
        evidence(share_after, length, n)
        - evidence(share_before, length, n)
        - 0.5 * n_free * np.log(n * length / CORRELATION_LENGTH)
    )
    if gain > MAX_SHAPE_GAIN * likeliest.evidence:
        return None
    likeliest = replace(likeliest, start=centred_start(profiles, likeliest.comb, likeliest.start))
    speed, speed_se, acceleration, acceleration_se, fitted = estimate_speed(envelopes, likeliest, settings)
    offsets = fitted.comb.offsets
    half_duration = 0.5 * offsets[-1] / speed
    residual = float(np.std(shape - likeliest.comb.offsets))
    # the axles' residuals may be systematic: they move a straight line through the axles by that much
    speed_se = float(np.hypot(speed_se, speed * residual / np.sqrt(np.sum((offsets - offsets.mean()) ** 2))))
    train_type = TypeFinding(
        likeliest.pattern.type,
        posterior[likeliest.pattern.type],
        posterior,
        likeliest.vehicles,
        offsets,
        residual,
        speed - acceleration * half_duration,
        float(np.hypot(speed_se, acceleration_se * half_duration)),
        acceleration,
        acceleration_se,
        speed,
        speed_se,
        motion_at_middle(envelopes, fitted).start,
    )
    profiles = profiles_at(envelopes, [fitted.motion])
    start = float(profiles.origin[0]) + centred_start(profiles, fitted.comb, fitted.start)
    weakest, further = wheels.extremes(offsets, settings.axle_spacing_minimum)
    axles = AxleFinding(
        start + offsets,
        np.ones(offsets.size),
        1.0 / (1.0 - likeliest.share),
        "comb",
        weakest=weakest,
        further=further,
        lead=lead,
    )
    return fitted.motion, axles, train_type


def estimate_speed(
    envelopes: SensorEnvelopes, fitted: FittedRow, settings: PassageSettings
) -> tuple[float, float, float, float, FittedRow]:
    """(speed halfway [m/s], its standard error, acceleration [m/s²], its standard error, the likeliest fit).

    Posterior means of both, from the comb's evidence. Most trains pass a turnout at a steady speed: 0.8 of the prior of
    the acceleration is 0 ± 0.02 m/s², the remainder 0 ± a quarter of the limit.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    fitted : FittedRow
        Row of vehicles near the best speed.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    speed, speed_se : float
        Posterior mean and standard deviation halfway through the passage. [m/s]
    acceleration, acceleration_se : float
        The same of the acceleration. [m/s²]
    likeliest : FittedRow
        The row at the most probable speed and acceleration.
    """
    middle = motion_at_middle(envelopes, fitted)
    step = 16.0 * BEND_STEP / (fitted.comb.offsets[-1] / middle.speed) ** 2
    reach = max(min(settings.acceleration_limit, 6.0 * step), step)
    # around the acceleration of the row: that of a long train is many steps from 0
    accelerations = np.linspace(-reach, reach, 13) + reach / 6.0 * np.round(middle.acceleration * 6.0 / reach)
    speeds = middle.speed * (1.0 + RELATIVE_SPEEDS)
    motions = [replace(middle, speed=v, acceleration=a) for a in accelerations for v in speeds]
    profiles = profiles_at(envelopes, motions)
    share, starts = explained_share(profiles, fitted.comb, np.arange(len(motions)))
    # sensors record the same wheels: their residuals are not independent, so they count as one
    log_posterior = evidence(share.max(axis=1), profiles.length, 1).reshape(13, -1)
    edges = np.append(
        accelerations - 0.5 * (accelerations[1] - accelerations[0]),
        accelerations[-1] + 0.5 * (accelerations[1] - accelerations[0]),
    )
    steady = np.diff(scipy.stats.norm.cdf(edges / STEADY_ACCELERATION))
    unsteady = np.diff(scipy.stats.norm.cdf(edges / (0.25 * settings.acceleration_limit)))
    log_posterior = log_posterior + np.log(STEADY_SHARE * steady + (1 - STEADY_SHARE) * unsteady + 1e-12)[:, None]
    weight = np.exp(log_posterior - log_posterior.max())
    weight /= weight.sum()
    by_speed, by_acceleration = weight.sum(axis=0), weight.sum(axis=1)
    speed, acceleration = float(by_speed @ speeds), float(by_acceleration @ accelerations)
    # the grid is no finer: add a twelfth of its step squared
    speed_se = np.sqrt(by_speed @ (speeds - speed) ** 2 + (speeds[1] - speeds[0]) ** 2 / 12)
    acceleration_se = np.sqrt(
        by_acceleration @ (accelerations - acceleration) ** 2
        + min(STEADY_ACCELERATION, accelerations[1] - accelerations[0]) ** 2
    )
    k = int(np.argmax(log_posterior))  # index over all motions
    start = float(starts[int(np.argmax(share[k]))])
    likeliest = replace(fitted, motion=motions[k], start=start, share=float(share[k].max()))
    return speed, float(speed_se), acceleration, float(acceleration_se), likeliest


MAX_COMB_SENSORS, MIN_PEAK_SENSORS = 3, 3  # most sensors of a search by comb, least sensors of one by peaks
TYPICAL_SPEED = 25.0  # m/s, prior where only the bogies show the speed; sd is a factor of 1.8
ENVELOPE_MARGIN = 25.0  # m, audible before the first and behind the last axle together
SHORT_SPAN_ERROR = 0.3  # m, position error of a wheel at each of two sensors close together
POSITION_SE = 0.05  # m, error of a fitted axle position; from simulated passages


def best_count(
    envelopes: SensorEnvelopes, motion: Motion, span: float, patterns: Sequence[Pattern], settings: PassageSettings
) -> tuple[Motion, AxleFinding, TypeFinding] | None:
    """(motion, axle finding, type): the count whose axles fit a template, else the one with the largest contrast.

    With few sensors a template is matched by its comb. With more sensors the cuts between peaks are tried first. Then
    the rows of vehicles that collect most of the profile are tried.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion from the sensors.
    span : float
        Distance between the first and the last sensor. [m]
    patterns : sequence of Pattern
        Axle patterns of known trains.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    (Motion, AxleFinding, TypeFinding) or None
        None where no axle is found.
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
    if typed is not None:
        return (motion, *typed)
    if first is None:
        return None
    rivals = [c.contrast for c in candidates if len(c.offsets) != len(first[0].offsets)]
    axles = replace(first[0], rival_contrast=max(rivals, default=0.0))
    return motion, _with_extremes(envelopes, motion, axles, settings), first[1]


def _with_extremes(
    envelopes: SensorEnvelopes, motion: Motion, axles: AxleFinding, settings: PassageSettings
) -> AxleFinding:
    """The count with the amplitudes of its weakest wheel and of the strongest one that it leaves out."""
    profiles, offsets = profiles_at(envelopes, [motion]), axles.offsets - axles.offsets[0]
    wheels = fit_amplitudes(profiles, offsets, float(axles.offsets[0] - profiles.origin[0]))
    weakest, further = wheels.extremes(offsets, settings.axle_spacing_minimum)
    return replace(axles, weakest=weakest, further=further)


def _motions_near(motion: Motion, envelopes: SensorEnvelopes, reach: float) -> list[Motion]:
    """Motions at speeds within ``reach`` [m/s] of a given one, with the train's middle at the same time."""
    middle = 0.5 * (envelopes.begin + envelopes.end)
    speed = float(motion.speed_at(middle))
    low, high = max(speed - reach, 0.75 * speed), min(speed + reach, 1.3 * speed)
    speeds = np.geomspace(low, high, max(int(np.log(high / low) / SPEED_STEP), 2))
    return [
        replace(motion, speed=v, start=middle - float(motion.distance(middle)) / v, acceleration=0.0) for v in speeds
    ]


def _position_error(span: float) -> float:
    """Position error of a wheel at one sensor [m]: a long row of sensors averages it out."""
    return SHORT_SPAN_ERROR if span < 10.0 else 0.1


def _first_with_type(
    envelopes: SensorEnvelopes,
    motion: Motion,
    candidates: Sequence[AxleFinding],
    error: float,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
) -> tuple[tuple[AxleFinding, TypeFinding] | None, tuple[AxleFinding, TypeFinding] | None]:
    """First (axle finding, type) that fits a template, and the first one tried; None where there is none."""
    untyped, checked = None, set()
    for candidate in candidates:
        key = tuple(np.round(candidate.offsets, 1))
        if key in checked:
            continue
        checked.add(key)
        for axles in _position_variants(envelopes, motion, candidate):
            # the profile is a mean over the sensors: a wrong acceleration moves no axle in the middle of them
            times = motion.passing(axles.offsets, float(np.mean(envelopes.positions)))
            train_type = find_type(times, patterns, settings, float(motion.speed_at(times[0])), error, POSITION_SE)
            if train_type.type != UNKNOWN and _is_whole_train(envelopes, motion, axles.offsets):
                return (axles, train_type), untyped
            untyped = untyped or (axles, train_type)
    return None, untyped


def _is_whole_train(envelopes: SensorEnvelopes, motion: Motion, offsets: np.ndarray) -> bool:
    """Whether the axles reach along the whole audible length.

    A few axles of a longer train would fit a shorter one by chance.
    """
    audible_length = motion.distance(envelopes.end) - motion.distance(envelopes.begin) - np.ptp(envelopes.positions)
    return bool(offsets[-1] - offsets[0] + ENVELOPE_MARGIN >= 0.9 * audible_length)


def _position_variants(envelopes: SensorEnvelopes, motion: Motion, axles: AxleFinding) -> Iterator[AxleFinding]:
    """The axles with positions fitted to the level around them, and then as given by the peaks."""
    yield replace(axles, offsets=fit_axle_positions(envelopes, motion, axles.offsets))
    yield axles


def count_without_distance(
    envelopes: SensorEnvelopes, patterns: Sequence[Pattern], settings: PassageSettings
) -> tuple[Motion, AxleFinding, TypeFinding] | None:
    """(motion, axle finding, type) from one sensor.

    A known train is sought at any speed. Else the speed is taken that makes the most plausible bogies.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of one sensor, or of sensors at one position.
    patterns : sequence of Pattern
        Axle patterns of known trains.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    (Motion, AxleFinding, TypeFinding) or None
        Motion past the sensor, axles and type; None where no axle is found.
    """
    match = match_template(envelopes, motions_at_all_speeds(envelopes.begin, settings), patterns, settings)
    if match is not None:
        return match
    slow, fast = settings.speed_minimum / KMH, settings.speed_maximum / KMH
    candidates = []
    for speed in np.geomspace(slow, fast, 32):
        motion = Motion(float(speed), envelopes.begin)
        for axles in axle_counts(envelopes, motion, settings)[:4]:
            if len(axles.offsets) >= 2 and axles.contrast >= 1.15:
                per_axle = unknown_evidence(np.diff(axles.offsets)) / (len(axles.offsets) - 1)
                log_prior = -0.5 * (np.log(speed / TYPICAL_SPEED) / 0.6) ** 2
                candidates.append((log_prior + per_axle + 0.5 * min(np.log(axles.contrast), 1.5), motion, axles))
    for plausibility, motion, axles in sorted(candidates, key=lambda o: -o[0]):
        _, typed = _first_with_type(envelopes, motion, [axles], 0.12 * motion.speed, (), settings)
        if typed is not None:
            # half the logarithm of a contrast is a part of the plausibility: the rival's is less by twice the lead
            rivals = [o[0] for o in candidates if len(o[2].offsets) != len(typed[0].offsets)]
            lead = plausibility - max(rivals, default=-np.inf)
            axles = replace(typed[0], rival_contrast=typed[0].contrast * float(np.exp(-2.0 * lead)))
            return motion, _with_extremes(envelopes, motion, axles, settings), typed[1]
    return None
