"""Averaged spectra: energy, the side of the conjugate, and the coverage of the density's interval."""

import numpy as np
import pytest

from turnout.signal.spectra import cross_spectra, density_interval

RATE = 1000.0


@pytest.mark.parametrize("n_sample", [250, 255])
def test_density_integrates_to_the_mean_square(n_sample):
    x = np.random.default_rng(1).standard_normal((3, n_sample)) + 0.7
    frequency, g_xx, _, _ = cross_spectra(x, x, RATE, n_sample)
    assert np.sum(g_xx) * RATE / n_sample == pytest.approx(np.mean(x**2), rel=1e-12)
    assert frequency[-1] <= RATE / 2


def test_appended_zeros_do_not_change_the_density():
    x = np.random.default_rng(2).standard_normal((2, 100))
    _, short, _, _ = cross_spectra(x, x, RATE, 100)
    _, long, _, _ = cross_spectra(x, x, RATE, 300)
    assert long[::3][1:-1] == pytest.approx(short[1:-1], rel=1e-10)


def test_a_delayed_response_has_a_negative_phase():
    delay, n = 7, 512
    x = np.random.default_rng(3).standard_normal((1, n))
    frequency, _, _, g_xy = cross_spectra(x, np.roll(x, delay, axis=1), RATE, n)
    expected = np.exp(-2j * np.pi * frequency * delay / RATE)
    assert g_xy / np.abs(g_xy) == pytest.approx(expected, abs=1e-9)


def test_interval_of_a_density_covers_it_in_95_percent():
    rng, k = np.random.default_rng(4), 10
    low, high = density_interval(k)
    draws = rng.standard_normal((300, k, 64))
    lines = np.array([cross_spectra(x, x, 64.0, 64)[1] for x in draws])[:, 2:-2]  # two-sided variance 1 over 32 Hz
    covered = np.mean((low * lines <= 1 / 32) & (1 / 32 <= high * lines))
    assert covered == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / lines.size))


def test_interval_in_decibel_uses_log10():
    # nu = 20: 10 ln would print -5.4 and +7.3 dB.
    assert 10 * np.log10(density_interval(10)) == pytest.approx([-2.3, 3.2], abs=0.05)


def test_unequal_shapes_and_too_short_transforms_are_rejected():
    with pytest.raises(ValueError, match="one shape"):
        cross_spectra(np.zeros((2, 8)), np.zeros((3, 8)), RATE)
    with pytest.raises(ValueError, match="would cut"):
        cross_spectra(np.zeros((2, 8)), np.zeros((2, 8)), RATE, 4)
