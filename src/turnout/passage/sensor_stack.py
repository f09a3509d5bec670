"""Compute features along the train from all sensors: levels, deflection, and both combined.

Detect a second train at the same time: a coherent source that passes the sensors at another speed or direction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.constants import KMH
from turnout.passage.axles import (
    GRID_STEP,
    AxleFinding,
    along_train,
    axle_candidates,
    deflection_feature,
    level_feature,
    scale_profile,
)
from turnout.passage.kinematics import Motion
from turnout.passage.profile_decoding import decode_profile
from turnout.passage.slowness_scan import correlation_at, slowness_grid
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_patterns import Pattern
    from turnout.passage.result import Passage
    from turnout.passage.sensor_envelopes import SensorEnvelopes


def feature_profiles(envelopes: SensorEnvelopes, motion: Motion) -> tuple[dict, float]:
    """Feature name -> (profile (n,), noise), and the offset [m] of their first point behind the motion's origin.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.

    Returns
    -------
    features : dict
        "both", "deflection" and "level" -> (profile (n,), noise), both about 1 at a wheel. [-]
    start : float
        Offset of the first point of the profiles. [m]
    """
    start, stop = _train_extent(envelopes, motion)
    step, positions = envelopes.levels.step, envelopes.positions
    level = level_feature(along_train(envelopes.levels.values, step, positions, motion, start, stop)).mean(axis=0)
    slow = along_train(envelopes.slow, step, positions, motion, start, stop)
    gain = np.maximum(np.sqrt(np.mean(slow**2, axis=1, keepdims=True)), 1e-30)
    deflection = deflection_feature(slow / gain)
    inside = np.zeros(level.size, dtype=bool)
    inside[int(8.0 / GRID_STEP) : -int(8.0 / GRID_STEP)] = True
    level, level_noise = scale_profile(level, inside)
    deflection, deflection_noise = scale_profile(deflection.mean(axis=0), inside)
    weights = np.array([level_noise, deflection_noise]) ** -2.0
    weights /= weights.sum()
    combined = weights[0] * level + weights[1] * deflection
    noise = float(np.hypot(weights[0] * level_noise, weights[1] * deflection_noise))
    features = {"both": (combined, noise), "deflection": (deflection, deflection_noise), "level": (level, level_noise)}
    return features, start


MAX_FIRST_SHIFT = 2.0  # m, of a sensor in the first pass
MAX_PASSES = 3  # of the alignment of the sensors
MAX_COUNTS = 3  # counts of axles by templates, those of the largest contrast


def align_sensors(envelopes: SensorEnvelopes, motion: Motion) -> Motion:
    """The motion with its speed corrected until all sensors' features coincide along the train.

    Each sensor's shift against the mean of the others [m], up to ``MAX_FIRST_SHIFT``, is regressed on its position.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        First estimate.

    Returns
    -------
    Motion
        ``motion`` itself where all sensors are within 0.3 m.
    """
    travel = motion.direction * envelopes.positions
    travel = travel - travel.mean()
    if np.ptp(travel) < 0.3:
        return motion
    reach = MAX_FIRST_SHIFT
    for _ in range(MAX_PASSES):
        shifts = _sensor_shifts(envelopes, motion, reach)
        # the slope is v/v' - 1: a train faster than assumed arrives early at later sensors
        slope = np.sum(travel * shifts) / np.sum(travel**2)
        slope = float(np.clip(slope, -0.2, 0.2))
        middle = float(motion.time(motion.direction * envelopes.positions.mean()))
        speed = motion.speed / (1.0 + slope)
        start = middle - (middle - motion.start) * motion.speed / speed
        motion = replace(motion, speed=speed, start=start)
        reach = max(0.6 * reach, 0.5)
        if abs(slope) < 1e-4:
            break
    return motion


def _sensor_shifts(envelopes: SensorEnvelopes, motion: Motion, reach: float) -> np.ndarray:
    """(n_sensor,) shift [m] of each sensor's features against the mean of the others."""
    start, stop = _train_extent(envelopes, motion)
    step, positions = envelopes.levels.step, envelopes.positions
    level = level_feature(along_train(envelopes.levels.values, step, positions, motion, start, stop))
    deflection = deflection_feature(along_train(envelopes.slow, step, positions, motion, start, stop))
    size = 2 ** int(np.ceil(np.log2(2 * level.shape[1])))
    lags = np.arange(-int(reach / GRID_STEP), int(reach / GRID_STEP) + 1)
    correlation = np.zeros((len(positions), lags.size))
    for rows in (level, deflection):
        rows = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-30)
        spectra = np.fft.rfft(rows, size, axis=1)
        other_spectra = spectra.sum(axis=0) - spectra
        candidate = np.fft.irfft(spectra * other_spectra.conj(), size, axis=1)[:, lags]
        # at low speed the deflection is below noise, on a quiet rail the level is: the better one counts
        if candidate.max(axis=1).mean() > correlation.max(axis=1).mean():
            correlation = candidate
    # a wide prior at no shift keeps a train of equal bogies from a shift by one bogie
    correlation = correlation * np.exp(-0.5 * (lags * GRID_STEP / max(reach, 1.0)) ** 2)
    best_lag = correlation.argmax(axis=1)
    n = len(positions)
    # the others' mean moves too: with n sensors a common slope appears n / (n - 1) times too large
    return lags[best_lag] * GRID_STEP * (n - 1) / n


def _train_extent(envelopes: SensorEnvelopes, motion: Motion) -> tuple[float, float]:
    """Range along the train, from before the first to behind the last axle. [m]"""
    extent = [
        motion.distance(t) - motion.direction * x for t in (envelopes.begin, envelopes.end) for x in envelopes.positions
    ]
    return min(extent) - 12.0, max(extent) + 12.0


def template_counts(envelopes: SensorEnvelopes, motion: Motion, patterns: Sequence[Pattern]) -> list[AxleFinding]:
    """The axle counts of the rows of vehicles that collect most along the train, the best first.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    patterns : sequence of Pattern
        Axle patterns of known trains.

    Returns
    -------
    list of AxleFinding
        The one with the largest contrast first.
    """
    features, start = feature_profiles(envelopes, motion)
    audible_length = min(
        motion.distance(envelopes.end) - motion.distance(envelopes.begin) - np.ptp(envelopes.positions), 2000.0
    )
    candidates = []
    for feature, (profile, noise) in features.items():
        if noise < 0.5:
            candidates += [decode_profile(profile, start, p, audible_length, feature) for p in patterns]
    return sorted((o for o in candidates if o is not None), key=lambda o: -o.contrast)[:MAX_COUNTS]


def axle_counts(envelopes: SensorEnvelopes, motion: Motion, settings: PassageSettings) -> list[AxleFinding]:
    """Candidate axle counts of all features, the one with the largest contrast first.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    settings : PassageSettings
        Least spacing and height of the axles.

    Returns
    -------
    list of AxleFinding
        The one with the largest contrast first.
    """
    features, start = feature_profiles(envelopes, motion)
    candidates = []
    for feature, (profile, noise) in features.items():
        threshold = float(np.clip(settings.axle_level * noise, 0.12, 0.5))
        candidates += axle_candidates(profile, start, settings.axle_spacing_minimum, threshold, feature)
    return sorted(candidates, key=lambda c: -c.contrast)


MIN_CORRELATION = 0.25  # least correlation of the residual between sensors
N_FASTER = 9  # trials of a motion faster than any train, with its limits: waves of an impact
MIN_LEVEL_SHARE = 0.1  # least level of the second train along its own motion, in half of the sensors, over the first's


def second_train(envelopes: SensorEnvelopes, passage: Passage, settings: PassageSettings) -> list[Rejection]:
    """Finding "two_trains" where the residual of the known motion moves coherently in another way.

    The common level of all sensors along the known train is subtracted from each: the lower median. A second train
    stays in the residual, since at every sensor it is elsewhere along the first. An impact at a fixed position, as at
    the crossing's nose, stays too, at the sensors beside it or at all at nearly one moment: its waves are faster than
    any train. So half of the sensors must record the second train at a tenth of the first one's level, and no faster
    motion may be more coherent. Needs three sensors, else there is no finding.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    passage : Passage
        The first train.
    settings : PassageSettings
        Slowest and fastest train.

    Returns
    -------
    list of Rejection
        "two_trains", or empty.
    """
    if len(envelopes.positions) < 3:
        return []
    motion = passage.train_motion
    residual = without_train(envelopes, motion)
    slowness = slowness_grid(settings)
    faster = float(np.abs(slowness).min()) * np.linspace(-1.0, 1.0, N_FASTER)[1:-1]
    correlations = correlation_at(np.append(slowness, faster), residual, envelopes.levels.step, envelopes.positions)
    correlation, of_impacts = correlations[: slowness.size], float(correlations[slowness.size :].max())
    own_slowness = motion.direction / motion.speed
    is_other = np.abs(slowness - own_slowness) > 0.15 * abs(own_slowness)
    own_correlation = correlation[~is_other].max(initial=0.0)
    peak = int(np.argmax(np.where(is_other, correlation, -np.inf)))
    strength = float(correlation[peak])
    if strength < MIN_CORRELATION or strength < 1.2 * own_correlation or strength < of_impacts:
        return []
    direction = 1 if slowness[peak] > 0 else -1
    second = Motion(1.0 / abs(slowness[peak]), 0.0, 0.0, direction)
    first_level = _shared_level(envelopes, np.clip(_smooth_levels(envelopes), 0.0, None), motion)
    if _shared_level(envelopes, residual, second) < MIN_LEVEL_SHARE * first_level:
        return []
    speed = KMH / slowness[peak]
    text = f"another train at about {abs(speed):.0f} km/h, {'facing' if speed > 0 else 'trailing'}"
    return [Rejection("two_trains", strength, MIN_CORRELATION, text)]


def _smooth_levels(envelopes: SensorEnvelopes) -> np.ndarray:
    """Levels, smoothed over 20 ms."""
    return ndimage.uniform_filter1d(envelopes.levels.values, max(round(0.02 / envelopes.levels.step), 1), axis=1)


def _shared_level(envelopes: SensorEnvelopes, values: np.ndarray, motion: Motion) -> float:
    """Sum over the time of the lower median over the sensors, each shifted by the motion. [s]"""
    step, end = envelopes.levels.step, values.shape[1] * envelopes.levels.step
    offsets = [motion.distance(t) - motion.direction * x for t in (0.0, end) for x in envelopes.positions]
    rows = np.sort(along_train(values, step, envelopes.positions, motion, min(offsets), max(offsets)), axis=0)
    return float(rows[(len(rows) - 1) // 2].sum() * GRID_STEP / motion.speed)


def without_train(envelopes: SensorEnvelopes, motion: Motion) -> np.ndarray:
    """(n_sensor, n_bin) levels above the sensors' common level along the train, smoothed over 20 ms, at least 0.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.

    Returns
    -------
    (n_sensor, n_bin) array of float
        Residual levels. [nepers of power]
    """
    step, positions = envelopes.levels.step, envelopes.positions
    values = _smooth_levels(envelopes)
    extent = [motion.distance(t) - motion.direction * x for t in (envelopes.begin, envelopes.end) for x in positions]
    start, stop = min(extent) - 15.0, max(extent) + 15.0
    rows = np.sort(along_train(values, step, positions, motion, start, stop), axis=0)
    shared = rows[(len(rows) - 1) // 2]
    offsets = start + np.arange(shared.size) * GRID_STEP
    centres = (np.arange(values.shape[1]) + 0.5) * step
    residuals = [
        row - np.interp(motion.distance(centres) - motion.direction * x, offsets, shared, left=0.0, right=0.0)
        for row, x in zip(values, positions)
    ]
    return np.clip(residuals, 0.0, None)
