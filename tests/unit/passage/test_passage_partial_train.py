"""A row of axles that is only a part of the train: signals before or behind it are detected."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.passage_truth import (
    IC3,
    PATTERN_FILE,
    PATTERNS,
    RATE,
    passing_times,
    recording_of,
    rolling_noise,
    sensors_for,
)

from turnout.passage.analysis import analyse
from turnout.passage.axle_patterns import offsets, read_patterns
from turnout.passage.comb import COMB_STEP, LEAD_LENGTH, N_TAPS, Comb, teeth_of
from turnout.passage.comb_search import continues_beyond
from turnout.passage.kinematics import Motion
from turnout.passage.train_detection import audible_sensors, sensor_envelopes

SPEED, COACHES = 33.0, {"units": [{"any": ["coach"], "count": [2, 12]}]}


def with_locomotive(width, seed):
    """Five coaches whose wheels cause bursts of 0.4 m, behind a locomotive whose bursts are ``width`` [m] wide."""
    patterns = read_patterns({**PATTERN_FILE, "trains": {**PATTERN_FILE["trains"], "coaches": COACHES}})
    kinds = {v.name: v for p in patterns for g in p.groups for v in g.vehicles}
    places = offsets((kinds["loco"], *(kinds["coach"],) * 5))
    rng = np.random.default_rng(seed)
    behind = rolling_noise(rng, places[4:] - places[4], SPEED, (2.0,), lead=1.0 + places[4] / SPEED)
    samples = behind.samples.copy()
    time = np.arange(samples.shape[1]) / RATE
    passed = (time[:, None] - 1.0) * SPEED - 2.0 - places[:4]
    samples[0] += np.sqrt(0.8 * np.sum(np.exp(-0.5 * (passed / width) ** 2), axis=1)) * rng.standard_normal(time.size)
    return recording_of(samples, (2.0,)), behind, patterns, len(places)


def test_coaches_behind_a_locomotive_with_another_signal_are_not_recognized_alone(settings):
    """The whole train is recognized or unknown, and never recognized as the coaches alone."""
    whole = 0
    for width in (1.2, 2.0, 3.0):
        recording, alone, patterns, n_axle = with_locomotive(width, 5)
        found = analyse(recording, sensors_for(recording), patterns, settings)
        assert found.type.type != "coaches"
        whole += (found.type.type, found.n_axle) == ("intercity", n_axle)
        found = analyse(alone, sensors_for(alone), patterns, settings)
        assert (found.type.type, found.n_axle) == ("coaches", n_axle - 4)
    assert whole >= 2


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("speed", [12.0, 50.0])
def test_the_signal_beyond_a_row_is_compared_with_the_row(speed, direction):
    """Amplitude 2 along 60 m and 1.1, 1.3 or 1.45 over 40 m beyond it, quiet level 0.3: shares 0.47, 0.59 and 0.68."""
    step, motion, place = 0.01, Motion(speed, 4.0, 0.0, direction), 17.0
    way = motion.distance((np.arange(3000) + 0.5) * step) - direction * place
    for beyond, is_cut_off in ((1.1, False), (1.3, False), (1.45, True)):
        for first, last in ((60.0, 100.0), (-40.0, 0.0)):
            amplitude = np.full((1, way.size), 0.3)
            amplitude[0, (way > 0) & (way < 60.0)] = 2.0
            amplitude[0, (way > first) & (way < last)] = beyond
            levels = SimpleNamespace(amplitude=amplitude, step=step)
            envelopes = SimpleNamespace(levels=levels, positions=np.array([place]))
            assert continues_beyond(envelopes, motion, 0.0, 60.0) is is_cut_off


def test_sensors_of_the_neighbouring_track_are_not_used_beside_one_sensor_of_the_train():
    """One sensor at the track of the train, and two at the other track with 8 % of its amplitude: 22 dB below."""
    rng = np.random.default_rng(3)
    samples = rolling_noise(rng, positions=(2.0, 9.0, 14.0)).samples * np.array([[1.0], [0.08], [0.08]])
    samples += 1e-3 * rng.standard_normal(samples.shape)
    assert audible_sensors(sensor_envelopes(samples, RATE, (2.0, 9.0, 14.0), 0.001)).tolist() == [0]


PLACES = (-12.0, 3.6, 13.8, 24.6, 26.4, 36.0)  # m, those of config/layouts
COACHES_OF_TRAIN = np.concatenate([26.4 * k + np.array([2.5, 5.0, 21.5, 24.0]) for k in range(6)])


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(
    ("offsets", "first", "last"),
    [
        *((offsets, *part) for offsets in (IC3, COACHES_OF_TRAIN) for part in ((0.0, 0.6), (0.4, 1.0))),
        (COACHES_OF_TRAIN, 0.25, 0.75),
    ],
)
def test_a_part_of_a_train_is_no_fault_of_a_clock(offsets, first, last, direction, settings):
    """Sensors over 48 m record different parts of it; the first wheels may have passed before the recording."""
    recording = rolling_noise(np.random.default_rng(11), offsets, 22.0, PLACES, direction, lead=2.0)
    start, *_, end = passing_times(offsets, PLACES, 22.0, 0.0, direction, 2.0)[0 if direction > 0 else -1]
    begin = int((start + first * (end - start)) * RATE) if first else 0
    stop = int((start + last * (end - start)) * RATE) if last < 1.0 else recording.n_sample
    passage = analyse(
        replace(recording, samples=recording.samples[:, begin:stop]), sensors_for(recording), PATTERNS, settings
    )
    assert passage.n_axle and not {"clock_drift", "two_trains"} & {f.reason for f in passage.findings}
    assert "train_cut_off" in {f.reason for f in passage.findings}
    assert passage.speed.speed == pytest.approx(22.0, abs=4.0 * passage.speed.se)


@pytest.mark.parametrize("first_axle", [-90.0, -30.0, -14.0, 3.0, 55.0, 70.0])
def test_wheels_outside_the_recorded_part_have_no_signal_in_it(first_axle):
    """The normal equations written out, with 0 for what was not recorded: 12 m before the audible part, 60 m of it."""
    offsets, rng = np.array([0.0, 2.52, 16.5, 19.02, 40.02]), np.random.default_rng(12)
    values, comb, half = rng.standard_normal((2, 1200)), Comb.of(offsets), N_TAPS // 2
    teeth, residuals = teeth_of(SimpleNamespace(values=values[:, None]), comb, first_axle)
    first = round((first_axle + LEAD_LENGTH) / COMB_STEP)
    for row, tooth, residual in zip(values, teeth, residuals):
        recorded = [(first + i + k, i, k) for i in range(comb.teeth.size) for k in range(-half, half + 1)]
        recorded = [r for r in recorded if 0 <= r[0] < row.size]
        correlation, model = np.zeros(N_TAPS), np.zeros(row.size)
        for point, i, k in recorded:
            correlation[k + half] += comb.teeth[i] * row[point]
        expected = comb.inverse @ correlation
        for point, i, k in recorded:
            model[point] += comb.teeth[i] * expected[k + half]
        np.testing.assert_allclose(tooth, expected, atol=1e-9)
        np.testing.assert_allclose(residual, row - model, atol=1e-9)
