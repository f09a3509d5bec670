"""Electrical pulses are on all channels at one time. Travelling, long and single-channel signals are vibration."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import PATTERNS, impact_train
from scipy import signal

from turnout.passage.analysis import analyse
from turnout.passage.electrical_pulses import without_pulses
from turnout.passage.result import PassageSensor
from turnout.records import Channel

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4}
LOCATIONS = ("OT", "SP", "CLP", "CP A7", "CP A8")
SENSORS = tuple(PassageSensor(name, name, x) for name, x in PLACES.items())
AT = (0.31, 1.702, 2.4)  # s: before, under and behind the first bogie


@pytest.fixture(scope="module")
def train():
    recording, _ = impact_train(np.random.default_rng(4), LOCATIONS, list(PLACES.values()), speed=44.4)
    return replace(recording, channels=tuple(Channel(name, "acceleration", x) for name, x in PLACES.items()))


def with_pulses(recording, times, size, last=3, delays=(0.0,) * 5):
    """Pulses of ``last`` samples, ``size`` times the channel's peak, behind the recorder's filter."""
    pulses = np.zeros_like(recording.samples)
    for row, (sample, delay) in enumerate(zip(recording.samples, delays)):
        for at in times:
            k = round((at + delay) * recording.rate)
            pulses[row, k : k + last] = size * np.abs(sample).max()
    b = signal.firwin(41, 0.8)
    return replace(recording, samples=recording.samples + signal.filtfilt(b, 1.0, pulses, axis=1))


def test_a_train_with_pulses_has_the_results_of_the_train_without_them(train, settings):
    clean = analyse(train, SENSORS, PATTERNS, settings)
    found = analyse(with_pulses(train, AT, 100.0), SENSORS, PATTERNS, settings)
    assert clean.status == "accepted" and clean.type.type == "IC3"
    assert found.status == "partly" and [f.reason for f in found.findings] == ["interference"]
    assert found.findings[0].value == 3 and "first at 0.30" in found.findings[0].detail
    assert (found.n_axle, found.type.type) == (8, "IC3")
    # each pulse removes 6 ms, a quarter of a metre: no axle may move by more than a tenth of that
    assert found.speed.speed == pytest.approx(clean.speed.speed, abs=3 * clean.speed.se)
    np.testing.assert_allclose(found.times, clean.times, atol=0.6e-3)


@pytest.mark.parametrize(
    "touched",
    [
        lambda r: r,
        lambda r: with_pulses(r, AT, 1.0),  # no larger than the wheels
        lambda r: with_pulses(
            r, AT, 100.0, delays=np.array(list(PLACES.values())) / 5200.0
        ),  # as fast as a wave in steel
        lambda r: with_pulses(r, AT[:1], 100.0, last=600),  # 30 ms
    ],
)
def test_travelling_long_and_small_signals_stay(train, touched):
    recording = touched(train)
    assert without_pulses(recording, SENSORS) == (recording, ())


def test_an_impact_at_one_sensor_stays(train):
    samples = with_pulses(train, AT, 100.0).samples
    samples[1:] = train.samples[1:]
    assert without_pulses(replace(train, samples=samples), SENSORS)[1] == ()


def test_sensors_at_one_position_do_not_distinguish_pulses_from_vibration(train):
    near = tuple(replace(s, position=0.01 * k) for k, s in enumerate(SENSORS))
    assert without_pulses(with_pulses(train, AT, 100.0), near)[1] == ()


def test_a_dead_channel_does_not_count(train):
    recording = with_pulses(train, AT, 100.0)
    recording.samples[2] = 0.0
    recording.samples[3, 7] = np.nan
    found, pulses = without_pulses(recording, SENSORS)
    assert pulses[0].value == 3
    assert np.abs(found.samples[0]).max() <= 1.001 * np.abs(train.samples[0]).max()
