"""Spikes are single samples; a vibration behind a recorder's filter is never one, however short its cause."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import PATTERNS, impact_train
from scipy import signal

from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.cleaning import clean
from turnout.passage.result import PassageSensor
from turnout.records import Channel
from turnout.signal.spikes import spikes_in, without_spikes

POSITIONS = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4}
LOCATIONS = ("OT", "SP", "CLP", "CP A7", "CP A8")
SENSORS = tuple(PassageSensor(name, name, x) for name, x in POSITIONS.items())


@pytest.fixture(scope="module")
def train():
    recording, _ = impact_train(np.random.default_rng(4), LOCATIONS, list(POSITIONS.values()), speed=44.4)
    return replace(recording, channels=tuple(Channel(name, "acceleration", x) for name, x in POSITIONS.items()))


def with_spikes(recording, row, size, n=12):
    """(the recording with ``n`` samples of one channel beside their values by ``size`` of its peak, their indices)."""
    at = np.sort(np.random.default_rng(8).choice(np.arange(20, recording.n_sample - 20, 40), n, replace=False))
    samples = recording.samples.copy()
    samples[row, at] += size * np.abs(samples[row]).max() * np.where(at % 3, 1.0, -1.0)
    return replace(recording, samples=samples), at


@pytest.mark.parametrize("size", [1.0, 3.0, 100.0])
def test_every_spike_is_found_and_replaced_by_the_mean_of_its_neighbours(train, size):
    recording, at = with_spikes(train, 3, size)
    found, (finding,) = without_spikes(recording)
    assert (finding.reason, finding.channel, finding.value) == ("spikes", "A7", 12.0)
    assert finding.time == at[0] / recording.rate
    expected = train.samples.copy()
    expected[3, at] = 0.5 * (expected[3, at - 1] + expected[3, at + 1])
    np.testing.assert_allclose(found.samples, expected, rtol=1e-12)


def test_the_peak_of_a_channel_does_not_count_its_spikes(train):
    settings = PassageSettings()
    recording, _ = with_spikes(train, 4, 5.0)
    expected = analyse(train, SENSORS, PATTERNS, settings)
    found = analyse(recording, SENSORS, PATTERNS, settings)
    assert found.status == "accepted" and [f.reason for f in found.findings] == ["spikes"]
    assert (found.n_axle, found.type.type, found.direction) == (expected.n_axle, expected.type.type, expected.direction)
    samples = clean(recording, SENSORS)[0].samples
    assert np.abs(samples[4]).max() == np.abs(train.samples[4]).max()


def test_hum_does_not_limit_what_is_used_of_a_passage(train):
    line = 0.3 * np.sin(2.0 * np.pi * 50.0 * np.arange(train.n_sample) / train.rate)
    found = analyse(replace(train, samples=train.samples + line), SENSORS, PATTERNS, PassageSettings())
    assert found.status == "accepted" and [f.reason for f in found.findings] == ["mains_hum"]


def test_the_noise_of_a_force_between_impacts_has_no_spikes():
    """2,000 records of 3,000 samples with an impact of 1 ms: 99 % of the samples are noise."""
    rng, pulse = np.random.default_rng(7), 2000.0 * np.sin(np.pi * np.arange(20) / 20.0)
    for _ in range(2000):
        samples = rng.standard_normal(3000)
        samples[300:320] += pulse
        assert spikes_in(samples).size == 0


@pytest.mark.parametrize("rate_share", [1.0, 0.25])
def test_the_shortest_impact_behind_a_recorders_filter_is_no_spike(train, rate_share):
    """An impulse of no duration, filtered at 0.4 of the sampling rate: of all impacts the most like a spike."""
    factor, rng = 8, np.random.default_rng(3)
    impulses = np.zeros(4000 * factor)
    impulses[rng.integers(0, impulses.size, 15)] = 100.0 * factor
    steep = signal.firwin(401, 0.8 / factor)
    recorded = signal.lfilter(steep, 1.0, impulses)[::factor] + 0.01 * rng.standard_normal(4000)
    assert spikes_in(recorded[: int(4000 * rate_share)]).size == 0


@pytest.mark.parametrize(
    "samples",
    [
        np.random.default_rng(1).standard_normal(200_000),
        np.round(2.0 * np.random.default_rng(2).random(200_000) ** 20),  # a quiet converter: single counts
        np.repeat(np.random.default_rng(3).standard_normal(200), 3),
        np.clip(5.0 * np.sin(0.9 * np.arange(5000.0)), -1.0, 1.0),
        np.ones(500),
        np.r_[np.zeros(300), np.nan, 5.0, np.zeros(300)],
        np.array([0.0, 9.0, 0.0]),
    ],
    ids=["noise", "counts", "held samples", "clipped", "constant", "not finite", "short"],
)
def test_signals_without_spikes_stay_unchanged(samples):
    assert spikes_in(samples).size == 0


def test_a_recording_without_spikes_is_the_same_object(train):
    assert without_spikes(train) == (train, ()) and without_spikes(train)[0] is train


def test_channels_that_are_not_named_stay_unchanged(train):
    recording, _ = with_spikes(train, 3, 5.0)
    assert without_spikes(recording, {"OT", "SP", "CLP"})[1] == ()


@pytest.mark.parametrize("impact", [(189.0, -441.0, 347.0), (-344.0, 462.0, -309.0), (224.0, -636.0, 387.0)])
def test_an_impact_of_a_wheel_at_a_recorder_without_filter_is_no_spike(impact):
    """Its neighbours leave the vibration too; a bit error changes one sample alone."""
    samples = np.random.default_rng(5).normal(scale=8.0, size=4000)
    samples[2000:2003] += impact
    assert spikes_in(samples).size == 0
    samples[2000], samples[2002] = 0.0, 0.0
    np.testing.assert_array_equal(spikes_in(samples), [2001])


@pytest.mark.parametrize("impact", [(-14.0, -26.0, 64.0, -32.0, -17.0), (9.0, 23.0, -66.0, 28.0, 20.0)])
def test_the_pulse_of_a_sharp_dip_at_a_recorder_without_filter_is_no_spike(impact):
    """The trough beside its peak is smooth, but larger than the vibration before and behind it."""
    samples = np.random.default_rng(6).normal(scale=2.0, size=4000)
    slow = 100.0 * np.sin(2.0 * np.pi * np.arange(4000) / 1000.0)  # m/s², of the track under a vehicle
    samples[2000:2005] += impact
    assert spikes_in(samples).size == 0 and spikes_in(samples + slow).size == 0
    samples[2000:2005] = 0.0, 0.0, impact[2], 0.0, 0.0
    np.testing.assert_array_equal(spikes_in(samples), [2002])
