"""The finite, meshed track against closed forms of infinite ones; errors fall with the stated order."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.simulate.frequency_response import receptance
from turnout.simulate.infinite_track import (
    floquet_receptance,
    propagation,
    winkler_receptance,
)
from turnout.simulate.matrices import assemble
from turnout.simulate.rail import Rail, element_mass, element_stiffness
from turnout.simulate.track import uniform_track

EULER = Rail(6.42e6, 60.21, 2.4e8, beam="euler")
TIMOSHENKO = Rail(210e9 * 3.055e-5, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3.055e-5, damping=2.0)


def test_a_beam_on_a_foundation_has_the_receptance_of_winkler():
    """Check 1: within 1e-3 to 1 kHz, complex."""
    h = 0.15
    track = uniform_track(96.0, h, EULER, layers=1, pad_stiffness=1e8 * h, pad_damping=3e4 * h, elements_per_bay=1)
    frequency = np.array([20.0, 100.0, 205.0, 300.0, 500.0, 1000.0])
    found = receptance(assemble(track), frequency, 48.0, 48.0)
    assert np.max(np.abs(found / winkler_receptance(frequency, 6.42e6, 60.21, 1e8, 3e4) - 1.0)) < 1e-3


@pytest.mark.parametrize("offset", [0.0, 0.15, 0.3])
@pytest.mark.parametrize(("elements", "low", "high"), [(4, 5e-3, 2e-2), (8, 5e-3, 2e-2)])
def test_two_independent_models_of_the_track_agree(offset, elements, low, high):
    """Magnitude within 0.5 % to 500 Hz and 2 % to 900 Hz of Floquet's solution; peaks at 96 and 486 Hz lie inside."""
    track = uniform_track(96.0, rail=TIMOSHENKO, elements_per_bay=elements)
    frequency = np.arange(20.0, 901.0, 10.0)
    found = receptance(assemble(track), frequency, 48.0 + offset, 48.0 + offset)
    error = np.abs(np.abs(found / floquet_receptance(frequency, track, offset)) - 1.0)
    assert np.max(error[frequency <= 500.0]) < low
    assert np.max(error) < high


def test_the_mesh_error_falls_with_the_square_of_the_element():
    track = uniform_track(72.0, rail=TIMOSHENKO)
    frequency = np.array([300.0, 500.0, 700.0, 900.0])
    exact = floquet_receptance(frequency, track, 0.3)
    errors = []
    for elements in (4, 8, 16):
        found = receptance(assemble(track.with_(elements_per_bay=elements)), frequency, 36.3, 36.3)
        errors.append(np.abs(found / exact - 1.0))
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(order - 2.0) < 0.1), order


@pytest.mark.parametrize(("length", "limit"), [(0.3, 2e-3), (0.15, 2e-4)])
def test_free_waves_of_a_timoshenko_rail_have_the_exact_frequencies(length, limit):
    """Frequency of a free wave of given length to 1 kHz against the dispersion relation: fourth order in the element.

    EI κGA k⁴ - (EI m + ρI κGA) ω² k² - κGA m ω² + ρI m ω⁴ = 0. Consistent mass alone: 3.6 and 0.87 % at 1 kHz.
    """
    ei, m, shear, inertia = 6.42e6, 60.21, 2.485e8, 0.2398
    rail = Rail(ei, m, shear, inertia, mass_matrix="corrected")
    for frequency in (100.0, 300.0, 600.0, 1000.0):
        w2 = (2.0 * np.pi * frequency) ** 2
        a, b, c = ei * shear, -(ei * m + inertia * shear) * w2, -(shear * m * w2 - inertia * m * w2**2)
        k = np.sqrt((-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a))
        turn = np.exp(1j * k * length)
        stiffness, mass = (
            x[:2, :2] + x[2:, 2:] + x[:2, 2:] * turn + x[2:, :2] / turn
            for x in (element_stiffness(rail, length), element_mass(rail, length))
        )
        found = np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real) / w2)
        assert abs(found - 1.0) < limit


@pytest.mark.parametrize(("offset", "limit"), [(0.0, 1.6e-2), (0.3, 2.2e-2)])
def test_point_loads_on_the_corrected_mass_keep_an_error_of_the_second_order(offset, limit):
    """To 0.5 % of Floquet's solution at 500 Hz as before; at 900 Hz 1.5 and 2.1 % for 1.9 and 1.0 % before."""
    track = uniform_track(96.0, rail=replace(TIMOSHENKO, mass_matrix="corrected"))
    frequency = np.arange(20.0, 901.0, 10.0)
    found = receptance(assemble(track), frequency, 48.0 + offset, 48.0 + offset)
    error = np.abs(np.abs(found / floquet_receptance(frequency, track, offset)) - 1.0)
    assert np.max(error[frequency <= 500.0]) < 5e-3
    assert np.max(error) < limit


def test_an_euler_bernoulli_mesh_converges_with_the_fourth_power():
    track = uniform_track(72.0, rail=Rail(6.42e6, 60.21, 2.4e8, beam="euler", damping=2.0))
    frequency = np.array([500.0, 900.0])
    exact = floquet_receptance(frequency, track, 0.3)
    errors = [
        np.abs(receptance(assemble(track.with_(elements_per_bay=n)), frequency, 36.3, 36.3) / exact - 1.0)
        for n in (2, 4)
    ]
    assert np.all(np.abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.3)


@pytest.mark.parametrize(("kappa", "printed"), [(0.34, 1035.0), (0.40, 1070.0), (0.45, 1093.0)])
def test_pinned_pinned_of_timoshenko(kappa, printed):
    """Check 4, printed to 1 Hz."""
    rail = Rail(210e9 * 3.055e-5, 60.21, kappa * 81e9 * 76.7e-4, 7850 * 3.055e-5)
    assert abs(rail.pinned_pinned_frequency(0.6) - printed) <= 0.6


def test_the_meshed_track_resonates_at_the_pinned_pinned_frequency():
    """Within 1 % from four elements per bay."""
    rail = Rail(210e9 * 3.055e-5, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3.055e-5)
    frequency = np.arange(1000.0, 1150.0, 1.0)
    found = np.abs(receptance(assemble(uniform_track(96.0, rail=rail)), frequency, 48.3, 48.3))
    assert frequency[np.argmax(found)] == pytest.approx(rail.pinned_pinned_frequency(0.6), rel=0.01)


def test_peaks_of_the_two_layer_track():
    """Check 5: 96 and 486 Hz of an independent code, to its 1 Hz."""
    rail = Rail(210e9 * 3.055e-5, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3.055e-5)
    track = uniform_track(96.0, rail=rail, elements_per_bay=8)
    frequency = np.arange(40.0, 700.0, 1.0)
    h = np.abs(receptance(assemble(track), frequency, 48.0, 48.0))
    low, high = frequency < 300.0, frequency >= 300.0
    assert abs(frequency[low][np.argmax(h[low])] - 96.0) <= 1.5
    assert abs(frequency[high][np.argmax(h[high])] - 486.0) <= 2.0


def test_waves_of_the_periodic_track_below_its_pass_band_decay():
    """Below the ballast resonance nothing propagates, above the pad resonance the rail is nearly free."""
    track = uniform_track(6.0, rail=TIMOSHENKO)
    kappa = propagation([50.0, 700.0], track)[:, 0]
    assert -kappa[0].imag > 0.5 * abs(kappa[0].real)
    free = (TIMOSHENKO.mass * (2 * np.pi * 700.0) ** 2 / TIMOSHENKO.bending_stiffness) ** 0.25
    assert abs(abs(kappa[1].real) / free - 1.0) < 0.25
    assert np.all(propagation(np.arange(50.0, 1000.0, 50.0), track).imag < 0.0)
