"""The dynamic stiffness at a resonance between two lines of the receptance, against one mode in closed form."""

import numpy as np
import pytest

from turnout.hammer_test.dynamic_stiffness import dynamic_stiffness

MASS, RESONANCE = 150.0, 150.0  # kg, Hz


def stiffness(frequency, damping):
    """K = m (w0² - w² + 2 i zeta w0 w) [N/m]."""
    omega, natural = 2.0 * np.pi * np.asarray(frequency), 2.0 * np.pi * RESONANCE
    return MASS * (natural**2 - omega**2 + 2j * damping * omega * natural)


@pytest.mark.parametrize("spacing", [1.0, 2.0, 6.67, 10.0])
@pytest.mark.parametrize("damping", [0.05, 0.1, 0.3])
def test_the_stiffness_at_a_resonance_does_not_depend_on_where_the_lines_are(spacing, damping):
    """A parabola and its chord: at the resonance K = 2 i zeta m w0², and the chord adds at most m dw²/4 to it."""
    exact = abs(stiffness(RESONANCE, damping))
    chord = spacing**2 / (8.0 * damping * RESONANCE**2)
    for first in np.linspace(1.0, 1.0 + spacing, 11):
        frequency = np.arange(first, 400.0, spacing)
        every = np.ones(frequency.size)
        value, low, high = dynamic_stiffness(
            frequency, 1.0 / stiffness(frequency, damping), every, every > 0.0, 10, RESONANCE
        )
        assert value == low == high == pytest.approx(exact, rel=chord**2 + 1e-12)


def test_the_limits_hold_the_stiffness_between_two_lines_of_noisy_impacts():
    """Ten impacts, noise of 3 % at each line: 200 tests of 95 % limits, of which 10 ± 3 miss at most."""
    rng, damping, frequency = np.random.default_rng(4), 0.05, np.array([146.7, 153.4, 160.1])
    h, exact, inside, ratios = 1.0 / stiffness(frequency, damping), abs(stiffness(RESONANCE, damping)), 0, []
    for _ in range(200):
        noise = rng.standard_normal((10, 3)) + 1j * rng.standard_normal((10, 3))
        responses = h * (1.0 + 0.03 / np.sqrt(2.0) * noise)  # to a force of 1 N
        mean = responses.mean(axis=0)
        coherence = np.abs(mean) ** 2 / np.mean(np.abs(responses) ** 2, axis=0)
        _, low, high = dynamic_stiffness(frequency, mean, coherence, np.ones(3, bool), 10, RESONANCE)
        inside += low <= exact <= high
        ratios.append(high / low)
    assert inside >= 183
    assert np.median(ratios) < 1.12  # +- 2 x 0.03 / sqrt(10) in both lines, which K at either exceeds by a third


def test_the_gate_is_that_of_the_nearest_line():
    frequency, every = np.array([100.0, 110.0]), np.ones(2)
    h = np.array([2e-8, 1e-8], complex)
    assert dynamic_stiffness(frequency, h, every, np.array([True, False]), 10, 104.0)[0] == pytest.approx(7e7)
    assert dynamic_stiffness(frequency, h, every, np.array([True, False]), 10, 106.0) is None
    assert dynamic_stiffness(frequency, h, np.array([1.0, 0.0]), np.array([True, False]), 10, 104.0) is None
