"""A range that no file states: several channels of a logger are clipped at one value."""

import numpy as np
import pytest

from turnout.passage.channel_checks import channel_states
from turnout.records import Channel, Recording


def recording_of(signals, limit=1000.0):
    channels = tuple(Channel(f"A{i}", "acceleration", 2.0 * i, limit=limit) for i in range(len(signals)))
    return Recording(np.array(signals), 5000.0, channels)


@pytest.fixture
def signals():
    t, rng = np.arange(5000) / 5000.0, np.random.default_rng(2)
    vibration = [30.0 * np.sin(2.0 * np.pi * f * t) + rng.normal(size=t.size) for f in (40.0, 55.0, 70.0, 90.0)]
    return np.round(np.array(vibration), 2)


def clipped(recording):
    return {f.channel: f.value for state in channel_states(recording) for f in state.findings if f.reason == "clipped"}


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.0, 1.0), (1.0, 1.01, 0.995, 1.005)])
def test_channels_that_share_a_limit_far_below_the_stated_one_are_clipped(signals, gains):
    assert clipped(recording_of(signals)) == {}
    shares = clipped(recording_of(np.clip(signals, -20.0, 20.0) * np.array(gains)[:, None]))
    assert set(shares) == {"A0", "A1", "A2", "A3"} and min(shares.values()) > 0.2


def test_one_channel_with_a_limit_of_its_own_is_left_to_the_comparison_with_the_others(signals):
    signals[1] = np.clip(signals[1], -20.0, 20.0)
    assert clipped(recording_of(signals)) == {}


def test_two_channels_with_different_limits_share_none(signals):
    signals[1], signals[2] = np.clip(signals[1], -20.0, 20.0), np.clip(signals[2], -15.0, 15.0)
    assert clipped(recording_of(signals)) == {}


def test_a_quiet_channel_beside_clipped_ones_is_not_clipped(signals):
    signals = np.clip(signals * np.array([1.0, 1.0, 1.0, 0.2])[:, None], -20.0, 20.0)
    assert set(clipped(recording_of(signals))) == {"A0", "A1", "A2"}
