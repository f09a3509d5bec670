"""A channel that is limited on one side is found; sound tests and noise are not taken for one."""

import numpy as np
import pytest
from scipy import signal

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.records import Channel, Recording

RATE, FINE, N = 20_000.0, 8, 4000
CHANNELS = Channel("force", "force"), Channel("rail", "acceleration")
ONSET = 0.02  # s
TRACKS = (  # frequency [Hz], damping ratio and modal mass [kg] of each mode
    ((95.0, 0.12, 210.0), (520.0, 0.08, 70.0), (1200.0, 0.05, 210.0)),
    ((60.0, 0.20, 300.0), (430.0, 0.06, 60.0), (1400.0, 0.04, 180.0)),
    ((170.0, 0.06, 180.0), (640.0, 0.11, 55.0), (1050.0, 0.07, 250.0)),
)


def response(force, modes):
    """Acceleration of modes at the point of the force, at the rate of the force."""
    total = np.zeros_like(force)
    for frequency, damping, mass in modes:
        w = 2.0 * np.pi * frequency
        total += signal.lfilter(*signal.bilinear([1.0, 0.0, 0.0], [mass, 2 * damping * w * mass, w**2 * mass],
                                                 FINE * RATE), force)  # fmt: skip
    return total


def test_samples(modes, seed, change=lambda a, rng: a, n_impacts=8):
    """(n_impacts, 2, N) force and acceleration behind a filter; ``change`` acts on the acceleration before it."""
    rng, low = np.random.default_rng(seed), signal.butter(6, 0.4 * RATE, fs=FINE * RATE, output="sos")
    contact, samples = rng.uniform(0.8e-3, 1.5e-3), []
    for _ in range(n_impacts):
        time = np.arange(N * FINE) / (FINE * RATE) - ONSET - rng.uniform() / RATE
        length = contact * np.exp(0.05 * rng.normal())
        inside = (time > 0.0) & (time < length)
        force = np.where(inside, 6e3 * np.exp(0.12 * rng.normal()) * np.sin(np.pi * time / length), 0.0)
        scattered = [(f * np.exp(0.003 * rng.normal()), z, m) for f, z, m in modes]
        both = np.stack([force, change(response(force, scattered), rng)])
        both = signal.sosfilt(low, both)[:, ::FINE]
        samples.append(both + rng.normal(size=both.shape) * 1e-3 * np.abs(both).max(axis=1, keepdims=True))
    return np.array(samples)


test_samples.__test__ = False


def impacts_of(samples):
    recordings = [Recording(x, RATE, CHANNELS, source="a", record=k) for k, x in enumerate(samples)]
    return find_track_impacts(recordings, "force", "rail", ReceptanceSettings())


def reasons_of(samples):
    return {r.reason for i in impacts_of(samples) for r in i.rejections}


@pytest.mark.parametrize("modes", TRACKS)
@pytest.mark.parametrize("seed", range(4))
def test_sound_tests_are_accepted(modes, seed):
    assert all(i.accepted for i in impacts_of(test_samples(modes, seed)))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_response_that_is_limited_on_one_side_in_all_impacts_is_found(side):
    """Its peak grows all the same: that of the other side."""
    whole = test_samples(TRACKS[0], 5)
    lower = np.median(np.max(side * whole[:, 1], axis=1))
    limited = test_samples(TRACKS[0], 5, lambda a, rng: side * np.minimum(side * a, 0.5 * lower))
    assert reasons_of(limited) == {"overload"}


@pytest.mark.parametrize("modes", TRACKS[:2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_response_beside_much_noise_is_not_limited(modes, seed):
    """The steepest slope of noise does not grow with the force either."""
    samples = test_samples(modes, seed)
    level = 0.1 * np.abs(samples[:, 1]).max()
    samples[:, 1] += level * np.random.default_rng(100).normal(size=samples[:, 1].shape)
    assert "overload" not in reasons_of(samples)
