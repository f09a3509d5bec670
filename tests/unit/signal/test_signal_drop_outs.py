"""A drop-out repeats one value amid vibration; quiet, coarse and clipped channels repeat values, too."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import PATTERNS, impact_train
from scipy import signal

from turnout.config.settings.passage import PassageSettings
from turnout.hammer_test import find_impacts
from turnout.passage.analysis import analyse
from turnout.passage.channel_checks import channel_states
from turnout.passage.result import PassageSensor
from turnout.records import Channel, Recording
from turnout.signal.drop_outs import MIN_RUN, drop_outs

POSITIONS = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4}
SENSORS = tuple(PassageSensor(name, name, x) for name, x in POSITIONS.items())


def noise(n=4000, seed=3):
    """Vibration below a fifth of the sampling rate, of rms 1."""
    samples = signal.lfilter(*signal.butter(4, 0.4), np.random.default_rng(seed).normal(size=n))
    return samples / samples.std()


def with_drop_out(samples, start, n, value):
    samples = samples.copy()
    samples[start : start + n] = samples[start] if value == "held" else value
    return samples


@pytest.mark.parametrize("value", [0.0, "held"])
@pytest.mark.parametrize("n", [MIN_RUN, 200, 1900])
def test_a_drop_out_is_found_where_it_is(n, value):
    found = drop_outs(with_drop_out(noise(6000), 1900, n, value))
    np.testing.assert_array_equal(found, [[1900, 1900 + n]])


def test_fewer_samples_are_none():
    assert drop_outs(with_drop_out(noise(), 1900, MIN_RUN - 1, 0.0)).size == 0


@pytest.mark.parametrize("step", [0.01, 0.5, 2.0, 6.0])
def test_a_coarse_or_quiet_channel_has_none(step):
    """Steps of six standard deviations leave long runs, and single changes amid them."""
    for seed in range(20):
        assert drop_outs(step * np.round(noise(20_000, seed) / step)).size == 0


@pytest.mark.parametrize("codes", [50, 100, 300])
def test_quiet_between_wheels_that_a_coarse_converter_does_not_resolve_is_none(codes):
    """The vibration of each wheel rises and decays; half the time it is below half a step of the converter."""
    time_constant, samples = 25.0, np.arange(6000)
    distance = 4.0 * time_constant * np.log(2.0 * codes)
    from_wheel = (samples % distance) - distance / 2.0
    rounded = np.round(np.exp(-np.abs(from_wheel) / time_constant) * np.sin(0.9 * samples) * codes) / codes
    assert np.diff(np.flatnonzero(np.diff(rounded))).max() > 5 * MIN_RUN and drop_outs(rounded).size == 0


def test_a_clipped_channel_has_none():
    slow = 3.0 * np.sin(0.01 * np.arange(4000)) + 0.1 * noise()
    assert drop_outs(np.clip(slow, -2.0, 2.0)).size == 0


def test_repeated_samples_of_a_slower_logger_are_none():
    assert drop_outs(np.repeat(noise(400), 2 * MIN_RUN)).size == 0


@pytest.mark.parametrize("part", [slice(None, 900), slice(-900, None)])
def test_a_sensor_that_starts_late_or_is_lost_has_none(part):
    samples = noise()
    samples[part] = 0.0
    assert drop_outs(samples).size == 0


def test_a_gap_in_a_passage_is_stated_and_its_channel_no_model_is_fitted_to():
    recording, _ = impact_train(
        np.random.default_rng(4), ("OT", "SP", "CLP", "CP A7", "CP A8"), list(POSITIONS.values()), speed=44.4
    )
    recording = replace(recording, channels=tuple(Channel(name, "acceleration", x) for name, x in POSITIONS.items()))
    assert not any(state.findings for state in channel_states(recording))
    samples = recording.samples.copy()
    start = int(np.argmax(np.abs(samples[3]))) - 100
    samples[3, start : start + 200] = 0.0
    (state,) = (s for s in channel_states(replace(recording, samples=samples)) if s.findings)
    (finding,) = state.findings
    assert (state.name, state.usable, state.fit_for_model) == ("A7", True, False)
    assert (finding.reason, finding.channel, finding.value) == ("drop_out", "A7", 200.0)
    passage = analyse(replace(recording, samples=samples), SENSORS, PATTERNS, PassageSettings())
    assert [f.reason for f in passage.findings] == ["drop_out"]


def test_an_impact_whose_response_drops_out_is_rejected():
    rng, t = np.random.default_rng(0), np.arange(2000) / 10_000.0
    force = 500.0 * np.sin(np.pi * (t - 0.01) / 2e-3) * ((t > 0.01) & (t < 0.012))
    response = np.exp(-80.0 * (t - 0.01)) * np.sin(900.0 * (t - 0.01)) * (t > 0.01)
    samples = np.stack([force, response]) + rng.normal(size=(2, 2000)) * [[0.1], [1e-3]]
    channels = Channel("hammer", "force"), Channel("rail", "acceleration")
    (impact,) = find_impacts([Recording(samples, 10_000.0, channels)], "hammer", "rail")
    assert impact.accepted
    samples[1, 130:230] = samples[1, 130]
    (impact,) = find_impacts([Recording(samples, 10_000.0, channels)], "hammer", "rail")
    assert [(r.reason, r.channel) for r in impact.rejections if r.reason == "drop_out"] == [("drop_out", "rail")]
