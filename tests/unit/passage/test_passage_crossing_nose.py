"""Trains over a nose: each wheel has an impact there, which all sensors record stronger than wheels above them."""

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, RATE, passing_times, recording_of, rolling_noise, sensors_for

from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.axle_patterns import Group, Pattern, Vehicle
from turnout.passage.train_type import UNKNOWN

PLACES, NOSE = (0.0, 2.3, 4.1, 7.4), 3.2  # m
STRANGER = np.array([0.0, 1.9, 11.2, 13.1, 19.7, 21.8, 33.0, 35.4])


def with_impacts(rng, offsets, speed, direction, strength=6.0, nose=NOSE, source=NOSE, wave_speed=np.inf):
    """Bursts that follow the wheels, and at all sensors a burst of 15 ms, ``strength`` times as strong, for each wheel
    at the nose, whose waves come from the source; and (n_sensor, n_axle) times at which the wheels pass the sensors."""
    recording = rolling_noise(rng, offsets, speed, PLACES, direction)
    samples, time = recording.samples.copy(), np.arange(recording.samples.shape[1]) / RATE
    every = passing_times(offsets, (*PLACES, nose), speed, 0.0, direction, 1.0)
    for t in every[-1]:
        for i, x in enumerate(PLACES):
            age = time - t - abs(x - source) / wave_speed
            ring = np.where(age >= 0.0, np.exp(-np.maximum(age, 0.0) / 0.015), 0.0)
            samples[i] += strength * np.exp(-abs(x - source) / 15.0) * ring * rng.standard_normal(time.size)
    return recording_of(samples, PLACES), every[:-1]


@pytest.mark.parametrize(("direction", "speed"), [(1, 26.0), (-1, 26.0), (1, 44.0), (-1, 52.0)])
def test_a_known_train_with_nose_impacts_is_found_with_its_speed_and_direction(direction, speed):
    recording, times = with_impacts(np.random.default_rng(round(speed) + direction), IC3, speed, direction)
    passage = analyse(recording, sensors_for(recording), PATTERNS, PassageSettings())
    assert (passage.type.type, passage.n_axle, passage.status) == ("IC3", 8, "accepted")
    assert passage.direction == ("facing" if direction > 0 else "trailing")
    # axles 0.4 m off at either end of 53 m would be 1.5 %
    assert passage.speed.speed == pytest.approx(speed, rel=0.01)
    at_sensors = np.array([passage.at_sensor[c.name] for c in recording.channels])
    # the recording shows an axle over 0.4 m on either side
    assert np.abs(at_sensors - times).max() * speed < 0.8


@pytest.mark.parametrize(("seed", "strength", "wave_speed"), [(0, 6.0, 140.0), (1, 6.0, 140.0), (1, 2.0, 90.0)])
def test_waves_from_behind_the_sensors_that_are_faster_than_any_train_are_no_second_train(seed, strength, wave_speed):
    """A part behind the last sensor rattles whenever a wheel is at the first one; 250 km/h is on the flank of 504."""
    recording, _ = with_impacts(
        np.random.default_rng(seed), IC3, 33.0, 1, strength, PLACES[0], PLACES[-1] + 1.1, wave_speed
    )
    passage = analyse(recording, sensors_for(recording), PATTERNS, PassageSettings())
    assert passage.n_axle == 8 and "two_trains" not in {f.reason for f in passage.findings}


def test_a_train_without_template_with_nose_impacts_has_an_uncertain_count():
    recording, _ = with_impacts(np.random.default_rng(3), STRANGER, 33.0, 1)
    passage = analyse(recording, sensors_for(recording), PATTERNS, PassageSettings())
    assert passage.type.type == UNKNOWN
    assert "axles_uncertain" in {f.reason for f in passage.findings}


@pytest.mark.parametrize("seed", [0, 3])
def test_impacts_that_look_like_a_known_train_at_another_speed_do_not_name_it(seed):
    """Four axles carry little information: impacts at the nose look like a locomotive at 58 m/s instead of 44.

    That locomotive leaves the peaks of the wheels out.
    """
    locomotive = Pattern("locomotive", (Group((Vehicle("unit", 18.0, (2.7, 5.7, 12.3, 15.3)),), 1, 1),))
    recording, _ = with_impacts(np.random.default_rng(seed), np.array([0.0, 3.0, 9.6, 12.6]), 44.0, 1)
    passage = analyse(recording, sensors_for(recording), [*PATTERNS, locomotive], PassageSettings())
    assert passage.type.type == UNKNOWN
    assert abs(passage.speed.speed - 44.0) < 3.0 * passage.speed.se
    assert "axles_uncertain" in {f.reason for f in passage.findings}


def test_the_same_train_without_nose_impacts_is_certain():
    recording = rolling_noise(np.random.default_rng(3), STRANGER, 33.0, PLACES)
    passage = analyse(recording, sensors_for(recording), PATTERNS, PassageSettings())
    assert (passage.type.type, passage.n_axle, passage.status) == (UNKNOWN, 8, "accepted")
