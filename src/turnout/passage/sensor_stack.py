"""Compute features along the train from all sensors: levels, deflection, and both combined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnout.passage.axle_features import (
    GRID,
    AxleFinding,
    along_train,
    axle_candidates,
    deflection_feature,
    level_feature,
    scaled,
)
from turnout.passage.envelope import Levels
from turnout.passage.kinematics import Motion
from turnout.passage.profile_decoding import decoded


@dataclass(frozen=True)
class Listening:
    """Envelopes of all sensors on one time grid, in which axles are sought.

    ``levels`` (n_sensor, n_bin) with their ``step`` [s]; ``slow`` (n_sensor, n_bin) mean acceleration per bin, without
    offset [m/s²]; ``positions`` (n_sensor,) [m]; ``begin``, ``end`` [s] where the train is audible.
    """

    levels: Levels
    slow: np.ndarray
    positions: np.ndarray
    begin: float
    end: float

    def only(self, rows) -> Listening:
        """The envelopes of some of the sensors."""
        rows = np.asarray(rows, dtype=int)
        levels = self.levels
        part = Levels(levels.values[rows], levels.step, levels.scatter[rows], levels.loud[rows], levels.amplitude[rows])
        return Listening(part, self.slow[rows], self.positions[rows], self.begin, self.end)


def profiles(listening: Listening, motion: Motion) -> tuple[dict, float]:
    """Feature name -> (profile (n,), noise), and the offset [m] of their first point behind the motion's origin."""
    start, stop = _stretch(listening, motion)
    step, positions = listening.levels.step, listening.positions
    level = level_feature(along_train(listening.levels.values, step, positions, motion, start, stop)).mean(axis=0)
    slow = along_train(listening.slow, step, positions, motion, start, stop)
    gain = np.maximum(np.sqrt(np.mean(slow**2, axis=1, keepdims=True)), 1e-30)
    deflection = deflection_feature(slow / gain)
    inside = np.zeros(level.size, dtype=bool)
    inside[int(8.0 / GRID) : -int(8.0 / GRID)] = True
    level, level_noise = scaled(level, inside)
    deflection, deflection_noise = scaled(deflection.mean(axis=0), inside)
    weights = np.array([level_noise, deflection_noise]) ** -2.0
    weights /= weights.sum()
    both = weights[0] * level + weights[1] * deflection
    noise = float(np.hypot(weights[0] * level_noise, weights[1] * deflection_noise))
    found = {"both": (both, noise), "deflection": (deflection, deflection_noise), "level": (level, level_noise)}
    return found, start


def aligned(listening: Listening, motion: Motion, reach: float = 2.0, passes: int = 3) -> Motion:
    """The motion with its speed corrected until all sensors' features coincide along the train.

    Each sensor's shift against the mean of the others [m], up to ``reach``, is regressed on its position.
    """
    along = motion.direction * listening.positions
    along = along - along.mean()
    if np.ptp(along) < 0.3:
        return motion
    for _ in range(passes):
        shifts = _own_shifts(listening, motion, reach)
        # the slope is v/v' - 1: a train faster than assumed arrives early at later sensors
        slope = np.sum(along * shifts) / np.sum(along**2)
        slope = float(np.clip(slope, -0.2, 0.2))
        middle = float(motion.time(motion.direction * listening.positions.mean()))
        speed = motion.speed / (1.0 + slope)
        start = middle - (middle - motion.start) * motion.speed / speed
        motion = replace(motion, speed=speed, start=start)
        reach = max(0.6 * reach, 0.5)
        if abs(slope) < 1e-4:
            break
    return motion


def _own_shifts(listening, motion, reach):
    """(n_sensor,) shift [m] of each sensor's features against the mean of the others."""
    start, stop = _stretch(listening, motion)
    step, positions = listening.levels.step, listening.positions
    level = level_feature(along_train(listening.levels.values, step, positions, motion, start, stop))
    deflection = deflection_feature(along_train(listening.slow, step, positions, motion, start, stop))
    size = 2 ** int(np.ceil(np.log2(2 * level.shape[1])))
    lags = np.arange(-int(reach / GRID), int(reach / GRID) + 1)
    likeness = np.zeros((len(positions), lags.size))
    for rows in (level, deflection):
        rows = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-30)
        spectra = np.fft.rfft(rows, size, axis=1)
        others = spectra.sum(axis=0) - spectra
        found = np.fft.irfft(spectra * others.conj(), size, axis=1)[:, lags]
        # at low speed the deflection is below noise, on a quiet rail the level is: the better one counts
        if found.max(axis=1).mean() > likeness.max(axis=1).mean():
            likeness = found
    # a wide prior at no shift keeps a train of equal bogies from a shift by one bogie
    likeness = likeness * np.exp(-0.5 * (lags * GRID / max(reach, 1.0)) ** 2)
    best = likeness.argmax(axis=1)
    n = len(positions)
    # the others' mean moves too: with n sensors a common slope appears n / (n - 1) times too large
    return lags[best] * GRID * (n - 1) / n


def _stretch(listening, motion):
    """Range along the train, from before the first to behind the last axle. [m]"""
    ways = [motion.way(t) - motion.direction * x for t in (listening.begin, listening.end) for x in listening.positions]
    return min(ways) - 12.0, max(ways) + 12.0


def template_counts(listening: Listening, motion: Motion, patterns, n: int = 3) -> list[AxleFinding]:
    """The axle counts of the rows of vehicles that collect most along the train, the best first."""
    found, start = profiles(listening, motion)
    around = min(motion.way(listening.end) - motion.way(listening.begin) - np.ptp(listening.positions), 2000.0)
    offers = []
    for feature, (profile, noise) in found.items():
        if noise < 0.5:
            offers += [decoded(profile, start, p, around, feature) for p in patterns]
    return sorted((o for o in offers if o is not None), key=lambda o: -o.contrast)[:n]


def counts(listening: Listening, motion: Motion, settings) -> list[AxleFinding]:
    """Candidate axle counts of all features, the one with the largest contrast first."""
    found, start = profiles(listening, motion)
    offers = []
    for feature, (profile, noise) in found.items():
        threshold = float(np.clip(settings.axle_level * noise, 0.12, 0.5))
        offers += axle_candidates(profile, start, settings.axle_spacing_minimum, threshold, feature)
    return sorted(offers, key=lambda c: -c.contrast)
