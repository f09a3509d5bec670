"""Force of a wheel on a wave: closed forms on even and on uneven rail."""

import numpy as np
import pytest

from turnout.mismatch.turnout.rolling_wheel import force_envelopes

STEP, SPEED, LINES = 0.3, 28.0, np.arange(4.0, 144.0, 2.0)
EVEN = 1e-9 * (1.0 + 1j) * LINES[:, None] * np.ones(43)  # linear in frequency, so that interpolation is exact


def test_on_even_rail_the_force_is_that_of_a_wheel_at_rest():
    force = force_envelopes(EVEN, LINES, np.ones(43), STEP, SPEED, np.array([46.0, 81.0]))
    assert force[:, 0] == pytest.approx(np.full(43, -0.5 / (1e-9 * (1.0 + 1j) * 46.0)), rel=1e-9)
    assert force[:, 1] == pytest.approx(np.full(43, -0.5 / (1e-9 * (1.0 + 1j) * 81.0)), rel=1e-9)


def test_the_force_oscillates_behind_a_soft_support_and_not_before_it():
    """A resonance at 46 Hz whose half width is 3 Hz decays by exp(-2 pi 3 Hz x / v), here to a half in 1.0 m."""
    line, soft = LINES[:, None], np.ones(43)
    soft[20] = 1.3
    compliance = 1e-9 * ((46.0 - line) + 3.0j) * soft
    change = np.abs(
        force_envelopes(compliance, LINES, np.ones(43), STEP, SPEED, np.array([46.0]))
        - force_envelopes(compliance / soft, LINES, np.ones(43), STEP, SPEED, np.array([46.0]))
    )[:, 0]
    behind, before = change[22:30], change[11:19]
    assert np.mean(behind) > 3.0 * np.mean(before)
