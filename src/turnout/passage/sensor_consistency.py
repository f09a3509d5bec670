"""Find sensors whose records disagree with their positions: swapped channels, drifting or offset clocks."""

from __future__ import annotations

import numpy as np

from turnout.passage.axle_features import GRID, along_train
from turnout.passage.slowness import coarser, pair_likeness, slowness_grid, stacked
from turnout.records import Rejection

SEEN = 0.7  # m, largest shift between a wheel's position in a record and the sensor
BLOW = 2.5  # m, the same in the crossing panel, where the impact at the nose may be louder than the wheel
POOR, GOOD = 0.85, 0.95  # of the correlation with free shifts: below is inconsistent, above is consistent
WIDTH = 0.02  # s, smoothing of the levels


def wrong_channels(heard, used, settings):
    """Findings and (n_sensor,) bool of the sensors to keep: channels that make all others disagree.

    They are sought only where no speed correlates the sensors' levels nearly as well as free shifts do. Then every
    exchange of two channels is tried, and every sensor is left out once. The one that helps decisively is reported.
    Fewer than four sensors cannot show which one is wrong.
    """
    n = len(used)
    keep = np.ones(n, dtype=bool)
    if n < 4:
        return [], keep
    positions = heard.positions
    values, step = coarser(heard.levels.values, heard.levels.step, 0.005)
    pairs = pair_likeness(values, step, WIDTH)
    slowness = slowness_grid(settings)
    free = np.mean([p.max() for p in pairs.values()])
    best = stacked(pairs, step, positions, slowness).max()
    if best >= POOR * free:
        return [], keep
    tried = []
    for i, j in pairs:
        changed = positions.astype(float).copy()
        changed[[i, j]] = changed[[j, i]]
        tried.append((stacked(pairs, step, changed, slowness).max(), (i, j)))
    for i in range(n):
        changed = positions.astype(float).copy()
        changed[i] = np.nan
        tried.append((stacked(pairs, step, changed, slowness).max(), (i,)))
    likeness, wrong = max(tried)
    if likeness < GOOD * free:
        return [], keep
    keep[list(wrong)] = False
    if len(wrong) == 2:
        text = f"{used[wrong[0]].name} and {used[wrong[1]].name}: each hears the train in the other's place"
        return [Rejection("channels_swapped", float(best / free), POOR, text)], keep
    text = f"{used[wrong[0]].name}: hears the train at another time than its place says"
    return [Rejection("clock_drift", float(best / free), POOR, text)], keep


def wrong_places(heard, motion, used):
    """Findings and (n_sensor,) bool of the sensors to keep: small offsets, once the motion is known.

    Each sensor's level along the train is compared with the median of the others, in the first and in the second half.
    A shift that changes is a drifting clock; a constant one is an error of the clock or of the configured position. In
    the crossing panel a constant shift below ``MAX_NOSE_SHIFT`` is no finding: it may be the distance to the nose.
    Fewer than four sensors cannot show which one is wrong.
    """
    n = len(used)
    keep = np.ones(n, dtype=bool)
    if n < 4:
        return [], keep
    shifts = half_shifts(heard, motion)
    shifts = shifts - np.median(shifts, axis=0)
    whole = shifts.mean(axis=1)
    limits = np.array([BLOW if s.panel == "CP" else SEEN for s in used])
    drifts = np.abs(shifts[:, 1] - shifts[:, 0]) > SEEN
    bad = np.flatnonzero((np.abs(whole) > limits) | drifts)
    if bad.size == 0 or bad.size > n // 2:
        return [], keep
    findings = []
    for i in bad:
        first, last = shifts[i] / motion.speed * 1e3
        if drifts[i]:
            text = f"{used[i].name}: its clock drifts, from {first:.0f} to {last:.0f} ms against the others"
        else:
            text = f"{used[i].name}: its clock is off, {whole[i] / motion.speed * 1e3:.0f} ms against the others"
        findings.append(Rejection("clock_drift", float(whole[i]), float(limits[i]), text))
        keep[i] = False
    return findings, keep


def half_shifts(heard, motion, reach: float = 20.0) -> np.ndarray:
    """(n_sensor, 2) shift [m] of each sensor against the others, in the first and second half of the train."""
    ways = motion.way(np.array([heard.begin, heard.end]))
    middle = motion.direction * np.mean(heard.positions)
    start, stop = ways[0] - middle - 30.0, ways[1] - middle + 30.0
    values = along_train(heard.levels.values, heard.levels.step, heard.positions, motion, start, stop)
    values = values - values.mean(axis=1, keepdims=True)
    n, out = values.shape[1], np.zeros((len(values), 2))
    lags = np.arange(-int(reach / GRID), int(reach / GRID) + 1)
    for k, part in enumerate((slice(0, n // 2), slice(n // 2, n))):
        rows = values[:, part]
        size = 2 ** int(np.ceil(np.log2(2 * rows.shape[1])))
        spectra = np.fft.rfft(rows, size, axis=1)
        for i in range(len(rows)):
            # the median of the others: a second wrong sensor must not affect it
            others = np.median(np.delete(rows, i, axis=0), axis=0)
            likeness = np.fft.irfft(spectra[i] * np.fft.rfft(others, size).conj(), size)
            out[i, k] = lags[np.argmax(likeness[lags])] * GRID
    return out
