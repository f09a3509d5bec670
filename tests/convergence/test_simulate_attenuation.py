"""The decay of a response along the meshed track, against closed forms of infinite ones."""

import numpy as np
import pytest

from turnout.simulate.frequency_response import receptance
from turnout.simulate.infinite_track import floquet_receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.rail import Rail
from turnout.simulate.track import uniform_track


def fading(x, frequency, bending, mass, k, c):
    """F/(8 EI b^3) e^(-b|x|) (cos b|x| + sin b|x|), b^4 = (k + i w c - m w^2)/4EI; Knothe and Grassie 1993."""
    omega = 2.0 * np.pi * frequency
    b = ((k + 1j * omega * c - mass * omega**2) / (4.0 * bending)) ** 0.25
    return np.exp(-b * x) * (np.cos(b * x) + np.sin(b * x)) / (8.0 * bending * b**3)


@pytest.mark.parametrize("x", [1.5, 3.0, 4.5, 6.0])
def test_the_response_of_a_beam_on_a_foundation_decays_with_distance(x):
    """To 6 m and to a 5000th of the response at the impact: within 0.5 %, and 1e-5 of the response at the impact."""
    h, rail = 0.15, Rail(6.42e6, 60.21, 2.4e8, beam="euler")
    track = uniform_track(96.0, h, rail, layers=1, pad_stiffness=1e8 * h, pad_damping=3e4 * h, elements_per_bay=1)
    frequency = np.array([35.0, 60.0, 120.0, 205.0, 300.0, 500.0])
    found = receptance(assemble(track), frequency, 48.0, 48.0 + x)
    exact = fading(x, frequency, 6.42e6, 60.21, 1e8, 3e4)
    there = np.abs(fading(0.0, frequency, 6.42e6, 60.21, 1e8, 3e4))
    assert np.all(np.abs(found - exact) < 5e-3 * np.abs(exact) + 1e-5 * there)


@pytest.mark.parametrize("bays", [3, 7, 10])
def test_the_response_of_a_track_on_sleepers_decays_with_distance(bays):
    """Floquet's solution, to 6 m: 1 % below 150 Hz, elsewhere 5 % down to a 1000th of the response at the force."""
    rail = Rail(6.378e6, 60.2, 2.435e8, 0.2384, damping=4000.0)
    track = uniform_track(96.0, rail=rail, pad_damping=2.5e4, elements_per_bay=8)
    frequency = np.array([36.0, 50.0, 80.0, 120.0, 200.0, 300.0, 500.0, 700.0, 900.0])
    found = receptance(assemble(track), frequency, 48.0, 48.0 + 0.6 * bays)
    exact = floquet_receptance(frequency, track, 0.0, bays)
    there = np.abs(floquet_receptance(frequency, track, 0.0, 0))
    low = frequency < 150.0
    assert np.abs(found[low]) == pytest.approx(np.abs(exact[low]), rel=0.01)
    is_large = np.abs(exact) > 1e-3 * there
    assert np.abs(found[is_large]) == pytest.approx(np.abs(exact[is_large]), rel=0.05)
