"""Starts of effects with a resonance: at any frequency one of them has to resemble the resonance."""

from functools import cache

import numpy as np
import pytest

from turnout.physics import attached_resonator, mount_resonance
from turnout.simulate import uniform_track
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble

F = np.arange(40.0, 1000.0, 1.0)  # Hz
SPAN = np.geomspace(60.0, 800.0, 300)  # Hz


@cache
def rail_receptance():
    """At mid-track [m/N]; not computed on import, since each process that collects tests would compile kernels."""
    return receptance(assemble(uniform_track(24.0)), F, 12.0, 12.0)


def mass_on_spring(mass, frequency, damping):
    """Force per deflection of a mass behind spring and damper, -w^2 m (k + iwc) / (k + iwc - w^2 m)."""
    w, w0 = 2.0 * np.pi * F, 2.0 * np.pi * frequency
    branch = mass * w0**2 + 1j * w * 2.0 * damping * mass * w0
    return -(w**2) * mass * branch / (branch - w**2 * mass)


def on_a_track(mass, frequency, damping):
    """Change of the receptance at the mass, -z g^2 / (1 + z g), on a rail of receptance g, which a heavy mass stops."""
    z, g = mass_on_spring(mass, frequency, damping), rail_receptance()
    return z * g**2 / (1.0 + z * g)


def mounting(frequency, quality):
    """Additional signal of a sensor on a spring, per motion below it."""
    r = F / frequency
    return 1.0 / (1.0 - r**2 + 1j * r / quality) - 1.0


def similarity(first, second):
    """Cosine between two changes of a complex response: the share of one that the other, scaled, predicts."""
    return np.real(np.vdot(first, second)) / np.linalg.norm(first) / np.linalg.norm(second)


def least_similarity(shape, starts, spans):
    columns = [shape(*start) for start in starts]
    return min(max(similarity(shape(*true), column) for column in columns) for true in spans)


@pytest.mark.parametrize("mass", [5.0, 20.0, 70.0, 150.0])
@pytest.mark.parametrize("damping", [0.012, 0.03, 0.05])
def test_a_mass_on_the_rail_resembles_a_start_at_any_frequency(mass, damping):
    """At 0.5 the column predicts a quarter of the gain in chi-squared. Starts with a single mass were below 0.5."""
    true = [(mass, f, damping) for f in SPAN]
    assert least_similarity(on_a_track, attached_resonator.STARTS, true) > 0.5


def test_starts_need_two_masses_and_small_steps_in_frequency():
    starts = attached_resonator.STARTS
    heavy = [(150.0, f, 0.012) for f in SPAN]
    light = [s for s in starts if s[0] < 20.0]
    assert least_similarity(on_a_track, light, heavy) < 0.5 < least_similarity(on_a_track, starts, heavy)
    assert least_similarity(on_a_track, starts[::3], [(5.0, f, 0.012) for f in SPAN]) < 0.4


@pytest.mark.parametrize("quality", [2.0, 5.0, 12.0])
def test_a_mounting_resembles_a_start_at_any_frequency(quality):
    starts = [(1.0 / period, q) for period, q in mount_resonance.STARTS]
    true = [(f, quality) for f in np.geomspace(150.0, 1700.0, 300)]
    assert least_similarity(mounting, starts, true) > 0.5
    assert least_similarity(mounting, starts[:1], true) < 0.25
