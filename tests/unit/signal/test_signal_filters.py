"""Filters and windows against their closed forms."""

import numpy as np
import pytest
from scipy.signal import freqz_sos

from turnout.signal.filters import FAMILIES, band_pass, butterworth_sections, force_pulse
from turnout.signal.spectra import correct_poles, exponential_window, force_window

RATE = 20_000.0


def test_the_low_pass_has_the_response_of_butterworth():
    f = np.array([100.0, 700.0, 900.0, 3000.0])
    _, gain = freqz_sos(butterworth_sections(None, 800.0, RATE, 4), f, fs=RATE)
    warped = np.tan(np.pi * f / RATE) / np.tan(np.pi * 800.0 / RATE)
    assert np.abs(gain) ** 2 == pytest.approx(1.0 / (1.0 + warped**8), rel=1e-9)


def test_causal_filter_is_silent_before_the_onset_and_zero_phase_is_symmetric():
    x = np.zeros(4001)
    x[2000] = 1.0
    causal, both = (band_pass(x, 80.0, 800.0, RATE, zero_phase=z) for z in (False, True))
    assert not causal[:2000].any() and causal[2000] != 0.0
    assert both == pytest.approx(both[::-1], abs=1e-9)


@pytest.mark.parametrize("edges", [(None, None), (800.0, 80.0), (-5.0, 80.0), (10.0, 10_000.0)])
def test_impossible_edges_are_rejected(edges):
    with pytest.raises(ValueError, match="cannot pass"):
        butterworth_sections(*edges, RATE)


def test_an_exponential_window_shifts_a_pole_and_the_correction_restores_it():
    pole, decay = -30.0 + 2j * np.pi * 150.0, 40.0
    n = np.arange(400)
    y = np.real(np.exp(pole * n / RATE)) * exponential_window(400, 0, decay, RATE)
    a = np.stack([y[1:-1], y[:-2]], axis=1)
    coefficients = np.linalg.lstsq(a, y[2:], rcond=None)[0]
    seen = np.log(np.roots([1.0, *-coefficients]).astype(complex)) * RATE
    assert correct_poles(seen[seen.imag > 0], decay)[0] == pytest.approx(pole, rel=1e-6)
    with pytest.raises(ValueError, match="must decay"):
        exponential_window(3, 0, -1.0, RATE)


def test_an_exponential_window_is_1_ahead_of_the_impact():
    window = exponential_window(2000, 1000, 100.0, RATE)
    assert (window[:1001] == 1.0).all()
    assert window[-1] == pytest.approx(np.exp(-100.0 * 999 / RATE))


def test_a_force_window_does_not_change_the_contact():
    window = force_window(50, 20, 8)
    assert (window[:21] == 1.0).all() and (window[28:] == 0.0).all() and (np.diff(window) <= 0.0).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_pulses_have_a_peak_of_1_and_begin_at_0(family):
    t = np.linspace(-1e-3, 3e-3, 40_001)
    x = force_pulse(family, t, 2e-3)
    assert x.max() == pytest.approx(1.0, abs=1e-6) and not x[t <= 0].any()
    assert x[np.searchsorted(t, 2e-3)] <= 0.0201
