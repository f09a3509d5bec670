"""Results have the stated units: the same test in other units of length, time and force gives the same numbers.

Every input is rescaled by powers of three numbers without a common factor, and every result must change by the
powers of its unit. A forgotten rate, an absolute threshold or an exchanged channel violates this.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import fftconvolve

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts, frf, receptance_of
from turnout.hammer_test.contact import band_edges
from turnout.hammer_test.dynamic_stiffness import dynamic_stiffness
from turnout.records import Channel, Recording
from turnout.signal import coherence, filters, spectra
from turnout.signal.filters import force_pulse

METRE, SECOND, NEWTON = 1.7, 0.6, 2.3


def unit(m=0, s=0, n=0):
    """Factor for a quantity with the unit m^m s^s N^n."""
    return METRE**m * SECOND**s * NEWTON**n


ACCELERATION = {"m": 1, "s": -2}
RNG = np.random.default_rng(5)
FORCE, RESPONSE = RNG.standard_normal((2, 4, 400))
FREQUENCY = np.array([30.0, 80.0, 200.0])
POLE = np.array([-40.0 + 600j])
G_FF, G_AA, G_FA = np.array([2.0, 3.0, 1.0]), np.array([5.0, 4.0, 2.0]), np.array([1 + 1j, 2 - 1j, 0.5j])

# name: (function of factors on metre, second, newton; units of its results)
FUNCTIONS = {
    "cross_spectra": (
        lambda u: spectra.cross_spectra(FORCE * u(n=1), RESPONSE * u(**ACCELERATION), 1000.0 * u(s=-1)),
        [{"s": -1}, {"n": 2, "s": 1}, {"m": 2, "s": -3}, {"n": 1, "m": 1, "s": -1}],
    ),
    "h1": (lambda u: [frf.h1(G_FF * u(n=2), G_FA * u(m=1, n=1))], [{"m": 1, "n": -1}]),
    "h2": (lambda u: [frf.h2(G_AA * u(m=2), G_FA * u(m=1, n=1))], [{"m": 1, "n": -1}]),
    "hv": (
        lambda u: [frf.hv(G_FF * u(n=2), G_AA * u(m=2), G_FA * u(m=1, n=1), 0.8 * u(m=1, n=-1))],
        [{"m": 1, "n": -1}],
    ),
    "coherence": (lambda u: [frf.coherence(G_FF * u(n=2), G_AA * u(m=2), G_FA * u(m=1, n=1))], [{}]),
    "coherence_limits": (lambda u: coherence.coherence_limits(np.array([0.5, 0.9]), 10), [{}, {}]),
    "dynamic_stiffness": (
        lambda u: dynamic_stiffness(
            FREQUENCY * u(s=-1), G_FA * u(m=1, n=-1), np.array([0.9, 0.7, 0.8]), FREQUENCY > 50.0, 9, 90.0 * u(s=-1)
        ),
        [{"m": -1, "n": 1}] * 3,
    ),
    "band_edges": (
        lambda u: [band_edges([np.hanning(40)[1:] * u(n=1)], 20_000.0 * u(s=-1), resolution=5.0 * u(s=-1))],
        [{"s": -1}],
    ),
    "band_pass": (
        lambda u: [filters.band_pass(RESPONSE * u(m=1), 20.0 * u(s=-1), 90.0 * u(s=-1), 1000.0 * u(s=-1))],
        [{"m": 1}],
    ),
    "exponential_window": (lambda u: [spectra.exponential_window(50, 3, 4.0 * u(s=-1), 100.0 * u(s=-1))], [{}]),
    "correct_poles": (lambda u: [spectra.correct_poles(POLE * u(s=-1), 7.0 * u(s=-1))], [{"s": -1}]),
    "force_pulse": (lambda u: [force_pulse("half-sine", np.arange(9) * 1e-4 * u(s=1), 7e-4 * u(s=1))], [{}]),
}


def same(**powers):
    return 1.0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_function_follows_a_change_of_units(name):
    function, units = FUNCTIONS[name]
    for before, after, powers in zip(function(same), function(unit), units, strict=True):
        assert after == pytest.approx(np.asarray(before) * unit(**powers), rel=1e-9, abs=0.0)


def recordings(u):
    """A hammer test with a double impact, an overload and a weak impact, in any units."""
    rng = np.random.default_rng(11)
    t = np.arange(2000) / 10_000.0
    response = np.real((2.0 - 1j) * np.exp((-150.0 + 2j * np.pi * 300.0) * t))
    channels = Channel("f", "force"), Channel("a", "acceleration")
    result = []
    for k, peak in enumerate((4000.0, 5000.0, 4500.0, 4800.0, 5200.0, 600.0)):
        force = peak * force_pulse("half-sine", t - 0.01, 2e-3)
        force += 0.2 * peak * force_pulse("half-sine", t - 0.03, 2e-3) * (k == 1)
        force = np.minimum(force, 3000.0) if k == 2 else force
        samples = np.stack([force, fftconvolve(force, response)[:2000]]) + rng.normal(size=(2, 2000)) * [[1.0], [9.0]]
        scaled = samples * np.array([[u(n=1)], [u(**ACCELERATION)]])
        result.append(Recording(scaled, 10_000.0 * u(s=-1), channels, record=k))
    return result


def settings(u):
    units = {"s": u(s=1), "1/s": u(s=-1), "Hz": u(s=-1), "N": u(n=1)}
    default = ReceptanceSettings()
    fields = default.__dataclass_fields__
    changed = {
        k: getattr(default, k) * units[f.metadata["unit"]] for k, f in fields.items() if f.metadata["unit"] in units
    }
    return replace(default, **changed)


IMPACT_UNITS = {
    "peak": {"n": 1}, "contact": {"s": 1}, "impulse": {"n": 1, "s": 1}, "noise_force": {"n": 1},
    "noise_acceleration": ACCELERATION, "band_edge": {"s": -1}, "onset": {}, "contact_end": {}, "decay_start": {},
}  # fmt: skip


def test_impacts_and_their_reasons_do_not_depend_on_units():
    plain, scaled = (find_impacts(recordings(u), "f", "a", settings(u)) for u in (same, unit))
    assert [[r.reason for r in i.rejections] for i in plain] == [[], ["double_hit"], ["overload"], [], [], ["weak"]]
    for a, b in zip(plain, scaled):
        assert [r.reason for r in a.rejections] == [r.reason for r in b.rejections]
        for name, powers in IMPACT_UNITS.items():
            assert getattr(b, name) == pytest.approx(
                getattr(a, name) * unit(**powers), rel=1e-2 if name == "band_edge" else 1e-9
            )


def test_receptance_is_a_displacement_per_force():
    results = [receptance_of(find_impacts(recordings(u), "f", "a", settings(u)), settings(u)) for u in (same, unit)]
    a, b = results
    for name in ("h1", "h2", "hv"):
        assert getattr(b, name) == pytest.approx(getattr(a, name) * unit(m=1, n=-1), rel=1e-8, abs=0.0)
    assert b.frequency == pytest.approx(a.frequency * unit(s=-1))
    assert b.gate_level == pytest.approx(a.gate_level, abs=1e-9) and np.array_equal(a.passed, b.passed)
