"""Compute features along the train from all sensors: levels, deflection, and both combined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnout.passage.axle_features import (
    GRID_STEP,
    AxleFinding,
    along_train,
    axle_candidates,
    deflection_feature,
    level_feature,
    scale_profile,
)
from turnout.passage.envelope import Levels
from turnout.passage.kinematics import Motion
from turnout.passage.profile_decoding import decode_profile


@dataclass(frozen=True)
class SensorEnvelopes:
    """Envelopes of all sensors on one time grid, in which axles are sought.

    ``levels`` (n_sensor, n_bin) with their ``step`` [s]; ``slow`` (n_sensor, n_bin) mean acceleration per bin, without
    offset [m/s²]; ``positions`` (n_sensor,) [m]; ``begin``, ``end`` [s] where the train is audible.
    """

    levels: Levels
    slow: np.ndarray
    positions: np.ndarray
    begin: float
    end: float

    def select(self, rows) -> SensorEnvelopes:
        """The envelopes of some of the sensors."""
        rows = np.asarray(rows, dtype=int)
        levels = self.levels
        selected = Levels(
            levels.values[rows], levels.step, levels.scatter[rows], levels.loud_power[rows], levels.amplitude[rows]
        )
        return SensorEnvelopes(selected, self.slow[rows], self.positions[rows], self.begin, self.end)


def feature_profiles(envelopes: SensorEnvelopes, motion: Motion) -> tuple[dict, float]:
    """Feature name -> (profile (n,), noise), and the offset [m] of their first point behind the motion's origin."""
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


def align_sensors(envelopes: SensorEnvelopes, motion: Motion, reach: float = 2.0, passes: int = 3) -> Motion:
    """The motion with its speed corrected until all sensors' features coincide along the train.

    Each sensor's shift against the mean of the others [m], up to ``reach``, is regressed on its position.
    """
    travel = motion.direction * envelopes.positions
    travel = travel - travel.mean()
    if np.ptp(travel) < 0.3:
        return motion
    for _ in range(passes):
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


def _sensor_shifts(envelopes, motion, reach):
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


def _train_extent(envelopes, motion):
    """Range along the train, from before the first to behind the last axle. [m]"""
    extent = [
        motion.distance(t) - motion.direction * x for t in (envelopes.begin, envelopes.end) for x in envelopes.positions
    ]
    return min(extent) - 12.0, max(extent) + 12.0


def template_counts(envelopes: SensorEnvelopes, motion: Motion, patterns, n: int = 3) -> list[AxleFinding]:
    """The axle counts of the rows of vehicles that collect most along the train, the best first."""
    features, start = feature_profiles(envelopes, motion)
    audible_length = min(
        motion.distance(envelopes.end) - motion.distance(envelopes.begin) - np.ptp(envelopes.positions), 2000.0
    )
    candidates = []
    for feature, (profile, noise) in features.items():
        if noise < 0.5:
            candidates += [decode_profile(profile, start, p, audible_length, feature) for p in patterns]
    return sorted((o for o in candidates if o is not None), key=lambda o: -o.contrast)[:n]


def axle_counts(envelopes: SensorEnvelopes, motion: Motion, settings) -> list[AxleFinding]:
    """Candidate axle counts of all features, the one with the largest contrast first."""
    features, start = feature_profiles(envelopes, motion)
    candidates = []
    for feature, (profile, noise) in features.items():
        threshold = float(np.clip(settings.axle_level * noise, 0.12, 0.5))
        candidates += axle_candidates(profile, start, settings.axle_spacing_minimum, threshold, feature)
    return sorted(candidates, key=lambda c: -c.contrast)
