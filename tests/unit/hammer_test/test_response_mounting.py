"""A loose sensor, a zero that shifts at the impact and a channel limited on one side are found; sound tests are not."""

import numpy as np
import pytest
from scipy import signal

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.hammer_test.zero_shift import MAX_SHARE, step_share
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


def on_mounting(frequency):
    """A sensor that resonates on its mounting."""
    w = 2.0 * np.pi * frequency
    transfer = signal.bilinear([0.06 * w, w**2], [1.0, 0.06 * w, w**2], FINE * RATE)
    return lambda a, rng: signal.lfilter(*transfer, a)


def with_step(share, decay):
    """A zero that shifts at the impact by a share of the peak and returns within some ``decay`` [s]."""

    def change(a, rng):
        time = np.arange(a.size) / (FINE * RATE) - ONSET
        return a + np.where(time > 0.0, share * np.abs(a).max() * np.exp(-time / decay), 0.0)

    return change


@pytest.mark.parametrize("modes", TRACKS)
@pytest.mark.parametrize("seed", range(4))
def test_sound_tests_are_accepted(modes, seed):
    impacts = impacts_of(test_samples(modes, seed))
    assert all(i.accepted for i in impacts)
    assert abs(step_share(impacts)[0]) < MAX_SHARE / 10.0


@pytest.mark.parametrize("modes", TRACKS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("frequency", [550.0, 700.0])
def test_a_sensor_that_resonates_on_its_mounting_is_found(modes, frequency, sign):
    assert reasons_of(test_samples(modes, 1, on_mounting(frequency)) * [[1.0], [sign]]) == {"loose_sensor"}


@pytest.mark.parametrize("samples", [-3, 2, 5])
def test_a_delay_of_some_samples_is_no_loose_sensor(samples):
    delayed = test_samples(TRACKS[0], 2)
    delayed[:, 1] = np.roll(delayed[:, 1], samples, axis=1)
    assert reasons_of(delayed) == set()


@pytest.mark.parametrize("modes", TRACKS[:2])
@pytest.mark.parametrize("share", [-0.1, 0.1])
@pytest.mark.parametrize("decay", [0.1, 1.0])
def test_a_zero_that_shifts_at_the_impact_is_found(modes, share, decay):
    impacts = impacts_of(test_samples(modes, 3, with_step(share, decay)))
    assert {r.reason for i in impacts for r in i.rejections} == {"zero_shift"}
    assert "the zero of rail shifts" in impacts[0].rejections[0].detail


def test_a_zero_that_drifts_at_random_is_no_shift():
    def drift(a, rng):
        time = np.arange(a.size) / (FINE * RATE)
        return a + 0.1 * np.abs(a).max() * np.sin(2.0 * np.pi * 0.7 * time + rng.uniform(0.0, 6.3))

    assert "zero_shift" not in reasons_of(test_samples(TRACKS[0], 4, drift))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_response_that_is_limited_on_one_side_in_all_impacts_is_found(side):
    """Its peak grows all the same: that of the other side."""
    whole = test_samples(TRACKS[0], 5)
    lower = min(np.median(np.max(side * a, axis=1)) for a in (whole[:, 1],))
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
