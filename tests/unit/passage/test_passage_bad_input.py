"""Faulty recordings, and unusual ones without a fault: faults are reported, and intact channels are used."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, RATE, passing_times, rolling_noise, sensors_for

from turnout.passage.analysis import analyse

PLACES = (0.0, 4.0, 9.0, 15.0, 22.0)


def findings(passage, reason):
    return [f for f in passage.findings if f.reason == reason]


def impacts(rng, recording, place, speed, rows, strength=3.0):
    """The recording with a burst at the channels ``rows`` whenever a wheel is at ``place``: a nose, a joint."""
    samples = recording.samples.copy()
    time = np.arange(recording.n_sample) / RATE
    for t in passing_times(IC3, [0.0, place], speed, 0.0, 1, 1.0)[1]:
        past = time - t
        decay = np.where(past >= 0, np.exp(-np.clip(past, 0, None) / 0.01), 0.0)
        samples[rows] += strength * decay * rng.standard_normal((len(rows), time.size))
    return replace(recording, samples=samples)


@pytest.mark.parametrize("panel", ["CP", "OT"])
@pytest.mark.parametrize(("position", "named"), [(15.0, []), (18.5, []), (20.0, ["c3:"])])
def test_a_sensor_may_record_an_irregularity_beside_it_instead_of_the_wheel_above_it(settings, panel, position, named):
    """Records of 16.5 m: 1.5 and 2 m may be the distance to a nose or a joint, in every panel; 3.5 m is none."""
    recording = rolling_noise(np.random.default_rng(21), IC3, 40.0, (0.0, 4.0, 9.0, 16.5, 22.0))
    sensors = sensors_for(recording)
    sensors[3] = replace(sensors[3], position=position, panel=panel)
    passage = analyse(recording, sensors, PATTERNS, settings)
    assert [f.detail[:3] for f in findings(passage, "clock_drift")] == named
    assert len(passage.audible_sensors) == 5 - len(named)
    assert passage.speed.speed == pytest.approx(40.0, rel=3e-3)


def test_impacts_at_one_position_are_not_a_second_train(settings):
    """Two of five sensors record every wheel a second time, when it is at the nose."""
    rng = np.random.default_rng(22)
    recording = impacts(rng, rolling_noise(rng, IC3, 15.0, PLACES), 19.0, 15.0, [3, 4])
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert passage.n_axle == 8 and not findings(passage, "two_trains")


def test_a_clock_that_runs_too_fast_is_reported_with_its_channel(settings):
    """A twelfth too fast, and right at the middle of the train: the offset changes its sign, and its mean is 0."""
    recording = rolling_noise(np.random.default_rng(23), IC3, 25.0, PLACES)
    samples, n = recording.samples.copy(), recording.n_sample
    middle = (1.0 + (IC3.mean() + PLACES[1]) / 25.0) * RATE
    place = middle + (np.arange(n) - middle) / 1.08
    samples[1] = np.interp(place, np.arange(n), samples[1])
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    assert passage.n_axle == 8 and passage.speed.speed == pytest.approx(25.0, rel=3e-3)
    named = findings(passage, "clock_drift")
    assert len(named) == 1 and named[0].detail.startswith("c1: ") and "c1" not in passage.audible_sensors


@pytest.mark.parametrize("after", ["constant", "noise"])
def test_the_finding_about_a_lost_sensor_states_when_it_was_lost(after, settings):
    """Afterwards the channel records a constant, or the noise of an amplifier without a sensor."""
    rng = np.random.default_rng(24)
    recording = rolling_noise(rng, IC3, 25.0, PLACES)
    samples, fell = recording.samples.copy(), int(2.0 * RATE)
    rest = samples.shape[1] - fell
    samples[2, fell:] = 0.125 if after == "constant" else 0.02 * rng.standard_normal(rest)
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    assert passage.n_axle == 8 and passage.type.type == "IC3"
    assert passage.speed.speed == pytest.approx(25.0, rel=3e-3)
    lost = findings(passage, "sensor_lost")
    assert len(lost) == 1 and lost[0].detail.startswith("c2: ")
    assert lost[0].value == pytest.approx(2.0, abs=0.1)


def test_a_train_is_detected_although_all_channels_are_clipped(settings):
    """No channel is used for the track. The axles are those that the clipped signals show."""
    recording = rolling_noise(np.random.default_rng(25), IC3, 40.0, PLACES)
    samples = np.clip(recording.samples, -0.05, 0.05)
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    assert passage.status in ("partly", "quarantined", "rejected")
    assert {f.detail.split(":")[0] for f in findings(passage, "clipped")} == {c.name for c in recording.channels}
