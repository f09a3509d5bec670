"""Find sensors whose records disagree with their positions: swapped channels, drifting or offset clocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.passage.axles import GRID_STEP, along_train
from turnout.passage.kinematics import Motion
from turnout.passage.slowness_scan import coarsen, pair_correlations, slowness_grid, stack_correlations
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.result import PassageSensor
    from turnout.passage.sensor_envelopes import SensorEnvelopes


# m: largest shift between a wheel's position in a record and the sensor. A fixed irregularity beside a sensor (nose,
# joint, weld, dip) may be louder there than the wheel above it, in any panel: its distance is no error of the clock.
MAX_POSITION_SHIFT = 2.5
MIN_CONSISTENT_SHARE, MIN_REPAIRED_SHARE = (
    0.85,
    0.95,
)  # of the correlation with free shifts: below is inconsistent, above is consistent
MAX_TRIED_SHIFT = 20.0  # m, of a sensor against the others, to either side
SMOOTHING_TIME = 0.02  # s, smoothing of the levels


def inconsistent_channels(
    envelopes: SensorEnvelopes, sensors: Sequence[PassageSensor], settings: PassageSettings
) -> tuple[list[Rejection], np.ndarray]:
    """Findings and (n_sensor,) bool of the sensors to keep: channels that make all others disagree.

    They are sought only where no speed correlates the sensors' levels nearly as well as free shifts do. Then every
    exchange of two channels is tried, and every sensor is left out once. The one that helps decisively is reported.
    Fewer than four sensors cannot show which one is wrong.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    sensors : sequence of PassageSensor
        The sensors of ``envelopes``.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    findings : list of Rejection
        "channels_swapped" or "clock_drift", or none.
    keep : (n_sensor,) array of bool
        False for the channels of the finding.
    """
    n = len(sensors)
    keep = np.ones(n, dtype=bool)
    if n < 4:
        return [], keep
    positions = envelopes.positions
    values, step = coarsen(envelopes.levels.values, envelopes.levels.step, 0.005)
    correlations = pair_correlations(values, step, SMOOTHING_TIME)
    slowness = slowness_grid(settings)
    free_correlation = np.mean([p.max() for p in correlations.values()])
    best_correlation = stack_correlations(correlations, step, positions, slowness).max()
    if best_correlation >= MIN_CONSISTENT_SHARE * free_correlation:
        return [], keep
    trials: list[tuple[float, tuple[int, ...]]] = []
    for i, j in correlations:
        changed = positions.astype(float).copy()
        changed[[i, j]] = changed[[j, i]]
        trials.append((stack_correlations(correlations, step, changed, slowness).max(), (i, j)))
    for i in range(n):
        changed = positions.astype(float).copy()
        changed[i] = np.nan
        trials.append((stack_correlations(correlations, step, changed, slowness).max(), (i,)))
    correlation, suspects = max(trials)
    if correlation < MIN_REPAIRED_SHARE * free_correlation:
        return [], keep
    keep[list(suspects)] = False
    names, share = [sensors[i].name for i in suspects], float(best_correlation / free_correlation)
    if len(suspects) == 2:
        text = f"{' and '.join(names)}: each records the train at the other's position"
        return [Rejection("channels_swapped", share, MIN_CONSISTENT_SHARE, text, names[0], names[1])], keep
    text = f"{names[0]}: records the train at another time than its position states"
    return [Rejection("clock_drift", share, MIN_CONSISTENT_SHARE, text, names[0])], keep


def inconsistent_positions(
    envelopes: SensorEnvelopes, motion: Motion, sensors: Sequence[PassageSensor]
) -> tuple[list[Rejection], np.ndarray]:
    """Findings and (n_sensor,) bool of the sensors to keep: small offsets, once the motion is known.

    Each sensor's level along the train is compared with the median of the others, in the first and in the second half.
    A shift that changes is a drifting clock; a constant one is an error of the clock or of the configured position.
    Either must exceed ``MAX_POSITION_SHIFT``. Fewer than four sensors cannot show which one is wrong, nor can a half of
    them that disagrees with the other half.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    sensors : sequence of PassageSensor
        The sensors of ``envelopes``.

    Returns
    -------
    findings : list of Rejection
        One "clock_drift" per inconsistent sensor.
    keep : (n_sensor,) array of bool
        False for the sensors of the findings.
    """
    n = len(sensors)
    keep = np.ones(n, dtype=bool)
    if n < 4:
        return [], keep
    shifts = half_shifts(envelopes, motion)
    shifts = shifts - np.median(shifts, axis=0)
    mean_shift = shifts.mean(axis=1)
    is_drifting = np.abs(shifts[:, 1] - shifts[:, 0]) > MAX_POSITION_SHIFT
    suspects = np.flatnonzero((np.abs(mean_shift) > MAX_POSITION_SHIFT) | is_drifting)
    if suspects.size == 0 or 2 * suspects.size >= n:
        return [], keep
    findings = []
    for i in suspects.tolist():
        first, last = shifts[i] / motion.speed * 1e3
        if is_drifting[i]:
            text = f"{sensors[i].name}: its clock drifts, from {first:.0f} to {last:.0f} ms against the others"
        else:
            shift = f"{mean_shift[i] / motion.speed * 1e3:.0f} ms against the others"
            text = (
                f"{sensors[i].name}: records the train {shift}: its clock is off, or its position or channel is wrong"
            )
        findings.append(Rejection("clock_drift", float(mean_shift[i]), MAX_POSITION_SHIFT, text, sensors[i].name))
        keep[i] = False
    return findings, keep


def half_shifts(envelopes: SensorEnvelopes, motion: Motion) -> np.ndarray:
    """(n_sensor, 2) shift [m] of each sensor against the others, in the first and second half of the train.

    Only the part of the train that every sensor recorded is compared: in a recording that begins or ends within the
    train, a sensor would seem shifted towards the wheels that it has not missed.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.

    Returns
    -------
    (n_sensor, 2) array of float
        Shift in the first and the second half. A half of which the sensors have less than twice
        ``MAX_POSITION_SHIFT`` in common has the shift of the other one, 0 if neither has more. [m]
    """
    extent = motion.distance(np.array([envelopes.begin, envelopes.end]))
    middle = motion.direction * np.mean(envelopes.positions)
    start, stop = extent[0] - middle - 30.0, extent[1] - middle + 30.0
    duration = envelopes.levels.values.shape[1] * envelopes.levels.step
    recorded = motion.distance(np.array([[0.0], [duration]])) - motion.direction * envelopes.positions
    first, last = max(start, recorded[0].max()), min(stop, recorded[1].min())
    max_shift = min(MAX_TRIED_SHIFT, 0.5 * (last - first))
    if max_shift < MAX_POSITION_SHIFT:
        return np.zeros((len(envelopes.positions), 2))
    values = along_train(envelopes.levels.values, envelopes.levels.step, envelopes.positions, motion, start, stop)
    offsets = start + np.arange(values.shape[1]) * GRID_STEP
    in_common = (offsets >= first) & (offsets <= last)
    values = np.where(in_common, values - values[:, in_common].mean(axis=1, keepdims=True), 0.0)
    n, shifts = values.shape[1], np.zeros((len(values), 2))
    lags = np.arange(-int(max_shift / GRID_STEP), int(max_shift / GRID_STEP) + 1)
    halves = (slice(0, n // 2), slice(n // 2, n))
    comparable = [k for k in (0, 1) if np.sum(in_common[halves[k]]) * GRID_STEP >= 2.0 * MAX_POSITION_SHIFT]
    for k in comparable:
        rows = values[:, halves[k]]
        size = 2 ** int(np.ceil(np.log2(2 * rows.shape[1])))
        spectra = np.fft.rfft(rows, size, axis=1)
        for i in range(len(rows)):
            # the median of the others: a second wrong sensor must not affect it
            median_of_others = np.median(np.delete(rows, i, axis=0), axis=0)
            correlation = np.fft.irfft(spectra[i] * np.fft.rfft(median_of_others, size).conj(), size)
            shifts[i, k] = lags[np.argmax(correlation[lags])] * GRID_STEP
    return shifts[:, [k if k in comparable else 1 - k for k in (0, 1)]]
