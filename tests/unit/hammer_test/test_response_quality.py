"""Factors of units, saturation before a filter and lag are found in the response; intact tests are accepted."""

import runpy

import numpy as np
import pytest
from scipy import signal

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts
from turnout.hammer_test.response_quality import find_track_impacts, judge_saturation, response_lag
from turnout.hammer_test.response_scale import RATES, equivalent_free_rails, free_rail_mobility
from turnout.records import Channel, Recording

RATE = 20000.0
CHANNELS = Channel("force", "force"), Channel("rail", "acceleration")


@pytest.fixture(scope="module")
def impact_samples(shared_recordings):
    """Ten impacts on modes at 160 and 560 Hz with 250 and 90 kg: (10, 2, 3000) force and acceleration."""
    return np.array(runpy.run_path(str(shared_recordings / "gen.py"))["hits"]())


def impacts_of(samples, settings=None):
    recordings = [Recording(x, RATE, CHANNELS, source="a", record=k) for k, x in enumerate(samples)]
    return find_track_impacts(recordings, "force", "rail", settings or ReceptanceSettings())


def reasons_of(samples, settings=None):
    return {r.reason for i in impacts_of(samples, settings) for r in i.rejections}


def test_an_intact_test_is_accepted_with_the_mobility_of_its_modes(impact_samples):
    """Two masses on springs are no rail: their additional phase is taken as a delay."""
    impacts = impacts_of(impact_samples)
    assert all(i.accepted for i in impacts)
    modes = [(250.0, 2 * np.pi * 160.0, 0.08), (90.0, 2 * np.pi * 560.0, 0.06)]
    low, high = (
        free_rail_mobility(s) / sum(s / m / (s**2 + 2 * zeta * w * s + w**2) for m, w, zeta in modes) for s in RATES
    )
    expected = low * (high / low) ** (-RATES[0] / (RATES[1] - RATES[0]))
    assert equivalent_free_rails(impacts).rails == pytest.approx(expected, rel=0.05)
    assert 0 <= np.median([response_lag(i) for i in impacts]) <= 5


@pytest.mark.parametrize(
    "factor", [9.80665, 1 / 9.80665, 4.4482, 1 / 4.4482, 1000.0, 0.001, 25.4, 1 / 25.4, 0.0353, 0.01]
)
def test_factors_of_units_are_found(impact_samples, factor):
    impacts = impacts_of(impact_samples[:5] * [[1.0], [factor]])
    assert {r.reason for i in impacts for r in i.rejections} == {"out_of_scale"}
    detail = impacts[0].rejections[0].detail
    assert "rails 54E1" in detail and "receptance.minimum_peak_force: 0" in detail


def test_the_limits_of_a_track_do_not_apply_to_a_small_hammer_on_a_beam(impact_samples):
    assert not reasons_of(impact_samples[:5] * [[0.01], [1.0]], ReceptanceSettings(minimum_peak_force=0.0))


def test_a_response_that_saturates_before_its_filter_is_found(impact_samples):
    sos = signal.butter(6, 0.9, output="sos")
    rng = np.random.default_rng(3)
    clipped = impact_samples.copy()
    clipped[:, 1] = (
        signal.sosfiltfilt(sos, np.clip(impact_samples[:, 1], -35, 35)) + rng.standard_normal((10, 3000)) * 0.05
    )
    impacts = impacts_of(clipped)
    assert {r.reason for i in impacts for r in i.rejections} == {"overload"}
    assert "whatever the force" in impacts[0].rejections[0].detail and impacts[0].rejections[0].channel == "rail"


@pytest.mark.parametrize(("shift", "word"), [(-8, "before"), (200, "after")])
def test_a_response_that_is_not_simultaneous_is_reported_with_its_lag(impact_samples, shift, word):
    shifted = impact_samples.copy()
    shifted[:, 1] = np.roll(impact_samples[:, 1], shift, axis=1)
    undisturbed = np.median([response_lag(i) for i in impacts_of(impact_samples)])
    (rejection,) = impacts_of(shifted)[0].rejections
    assert rejection.reason == "not_simultaneous"
    assert rejection.value == shift + undisturbed
    assert "rail begins" in rejection.detail and f"{word} the force" in rejection.detail


def impacts_on_a_mass(rate, delay, lead, n=5, rise=7.5e-4, damping=0.05):
    """Forces of a sine squared, and the acceleration of 250 kg on a spring, 160 Hz, in closed form; ``delay`` in s.

    Before the force a channel has noise of 1/500 of the peak, as good measurements have.
    """
    rng, recordings = np.random.default_rng(8), []
    time = np.arange(round(0.3 * rate)) / rate - lead
    w0 = 2.0 * np.pi * 160.0
    fine = np.arange(round(0.35 * 4 * rate)) / (4.0 * rate)
    oscillator = [1.0 / 250.0, 0.0, 0.0], [1.0, 2.0 * damping * w0, w0**2]
    numerator, denominator, _ = signal.cont2discrete(oscillator, fine[1], "foh")
    for record in range(n):
        peak = rng.uniform(4000.0, 6000.0)
        force = np.where(fine < 2.0 * rise, peak * np.sin(0.5 * np.pi * fine / rise) ** 2, 0.0)
        answer = signal.lfilter(numerator.ravel(), denominator, force)
        both = np.stack([np.interp(time - shift, fine, x, left=0.0) for x, shift in ((force, 0.0), (answer, delay))])
        both += rng.standard_normal(both.shape) * np.abs(both).max(axis=1, keepdims=True) / 500.0
        recordings.append(Recording(both, rate, CHANNELS, source="a", record=record))
    return recordings


@pytest.mark.parametrize("rate", [10e3, 20e3, 51.2e3])
@pytest.mark.parametrize("lead_time", [1e-3, 3e-3, 10e-3, 19e-3])
def test_a_response_before_the_force_is_not_taken_for_noise(rate, lead_time):
    """The force begins at 30 ms: the response fills a thirtieth to nearly two thirds of the time before it."""
    recordings = impacts_on_a_mass(rate, -lead_time, 30e-3)
    impacts = find_track_impacts(recordings, "force", "rail", ReceptanceSettings())
    assert {r.reason for i in impacts for r in i.rejections} == {"not_simultaneous"}
    # A mass follows the force, which reaches a tenth of its peak at 0.2 of the rise, 0.15 ms.
    assert impacts[0].rejections[0].value / rate == pytest.approx(-lead_time, abs=3e-4)


@pytest.mark.parametrize("rate", [10e3, 20e3, 51.2e3])
def test_beside_the_hammer_a_response_begins_while_the_force_rises(rate):
    """The force rises for 0.75 ms; elsewhere on a structure the response may begin as late as the contact ends."""
    late = impacts_on_a_mass(rate, 1e-3, 30e-3)
    impacts = find_track_impacts(late, "force", "rail", ReceptanceSettings())
    assert {r.reason for i in impacts for r in i.rejections} == {"not_simultaneous"}
    assert "after the force" in impacts[0].rejections[0].detail
    for recordings, settings in (
        (impacts_on_a_mass(rate, 0.0, 30e-3), ReceptanceSettings()),
        (late, ReceptanceSettings(minimum_peak_force=0.0)),
    ):
        assert all(i.accepted for i in find_track_impacts(recordings, "force", "rail", settings))


def test_noise_before_the_force_stays_noise():
    """Noise of 0.4 of the peak, and a dead channel: neither shows where a response begins."""
    rng, noisy, dead = np.random.default_rng(9), [], []
    for r in impacts_on_a_mass(RATE, 0.0, 30e-3):
        noise = rng.standard_normal(r.n_sample) * np.abs(r.samples[1]).max()
        noisy.append(Recording(r.samples + np.array([[0.0], [0.4]]) * noise, RATE, CHANNELS, "a", record=r.record))
        dead.append(Recording(np.stack([r.samples[0], noise]), RATE, CHANNELS, "a", record=r.record))
    for recordings, reasons in ((noisy, {"noisy", "dead_channel"}), (dead, {"dead_channel"})):
        impacts = find_track_impacts(recordings, "force", "rail", ReceptanceSettings())
        assert {i.rejections[0].reason for i in impacts} == reasons


def test_a_knock_before_most_impacts_is_no_fault_of_the_others():
    """15 ms before the force the rail shakes with 0.45 of the peak for 9 ms in three of five impacts."""
    recordings = impacts_on_a_mass(RATE, 0.0, 30e-3)
    for r in recordings[:3]:
        start, n = round(15e-3 * RATE), round(9e-3 * RATE)
        r.samples[1, start : start + n] += 0.45 * np.abs(r.samples[1]).max() * np.sin(np.arange(n))
    impacts = find_track_impacts(recordings, "force", "rail", ReceptanceSettings())
    assert [[r.reason for r in i.rejections] for i in impacts] == [["noisy"]] * 3 + [[]] * 2


@pytest.mark.parametrize("sd", [0.3, 0.6, 1.5])
def test_a_dead_channel_that_changes_by_single_steps_has_no_lag(sd):
    """Noise of ``sd`` steps of the converter, rounded to it: a quarter of the samples or more are exactly 0."""
    rng, recordings = np.random.default_rng(10), []
    for r in impacts_on_a_mass(RATE, 0.0, 30e-3):
        steps = 0.01 * np.round(sd * rng.standard_normal(r.n_sample))
        recordings.append(Recording(np.stack([r.samples[0], steps]), RATE, CHANNELS, "a", record=r.record))
    impacts = find_track_impacts(recordings, "force", "rail", ReceptanceSettings())
    assert {r.reason for i in impacts for r in i.rejections} == {"dead_channel"}


def test_a_lag_by_the_filters_of_two_channels_is_accepted(impact_samples):
    shifted = impact_samples.copy()
    shifted[:, 1] = np.roll(impact_samples[:, 1], 3, axis=1)
    assert not reasons_of(shifted)


def test_stronger_impacts_on_a_linear_track_are_used(impact_samples):
    """Three impacts in the ratio 3.9, 3.1 and 14, and four even ones with one of three and a half times their force."""
    for peaks in ([3.9, 3.1, 14.0], [3.9, 3.8, 3.9, 4.0, 14.0]):
        scaled = (
            impact_samples[: len(peaks)]
            * (np.array(peaks) * 100.0 / impact_samples[: len(peaks), 0].max(axis=1))[:, None, None]
        )
        assert not reasons_of(scaled)
    scaled[4, 1] *= 3.9 / 14.0  # the force channel overflowed: its response is that of a usual impact
    assert "overload" in reasons_of(scaled)


def test_short_impacts_of_even_force_are_no_saturation():
    """Behind a filter the response to a pulse of 3 to 5 samples follows its impulse, which here falls with its peak."""
    low = signal.butter(1, 2000.0, fs=RATE)
    peaks, recordings = np.linspace(4500.0, 5500.0, 8), []
    fine = np.arange(16 * 20) / (16.0 * RATE)
    for record, peak in enumerate(peaks):
        width = 2e-4 * (5000.0 / peak) ** 3
        pulse = np.where(fine < width, peak * np.sin(np.pi * fine / width) ** 2, 0.0)
        force = np.zeros(4000)
        force[400:420] = pulse.reshape(-1, 16).mean(axis=1)
        time = np.arange(4000) / RATE
        free = np.exp(-60.0 * time) * np.cos(1000.0 * time)
        response = signal.lfilter(*low, np.convolve(force, free)[:4000])
        samples = np.stack([force, response])
        samples += np.random.default_rng(record).standard_normal(samples.shape) * np.abs(samples).max(1)[:, None] / 1e3
        recordings.append(Recording(samples, RATE, CHANNELS, source="a", record=record))
    impacts = find_impacts(recordings, "force", "rail")
    largest = [np.abs(i.acceleration).max() for i in impacts]
    assert all(i.accepted for i in impacts) and np.polyfit(np.log([i.peak for i in impacts]), np.log(largest), 1)[0] < 0
    assert judge_saturation(impacts, "rail") == tuple(impacts)


def slew_limited(x, limit):
    """A response that changes by at most ``limit`` per sample, as behind an amplifier that cannot follow."""
    limited, y = np.empty_like(x), 0.0
    for k, value in enumerate(x):
        y += np.clip(value - y, -limit, limit)
        limited[k] = y
    return limited


def test_a_response_whose_slope_is_limited_in_all_impacts_is_found(impact_samples):
    slopes = np.abs(np.diff(impact_samples[:, 1], axis=1)).max(axis=1)
    limited = impact_samples.copy()
    limited[:, 1] = [slew_limited(x, 0.6 * slopes.min()) for x in impact_samples[:, 1]]
    impacts = impacts_of(limited)
    assert all(i.rejections and i.rejections[0].reason == "overload" for i in impacts)
    assert "the steepest slope of rail" in impacts[0].rejections[0].detail


@pytest.mark.parametrize("seed", range(2, 6))
def test_an_intact_response_is_not_rejected_as_limited(shared_recordings, seed):
    samples = np.array(runpy.run_path(str(shared_recordings / "gen.py"))["hits"](seed=seed))
    assert "overload" not in reasons_of(samples)
