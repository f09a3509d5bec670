"""Faults of the response in hammer tests on random tracks that share nothing with the simulator."""

import numpy as np
import pytest
from benchmarks.random_tracks import SHEAR_MODULUS, SPACING, YOUNGS_MODULUS, RandomTrack, hammer_test
from scipy.integrate import quad

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test.response_quality import find_track_impacts


@pytest.mark.parametrize(("frequency", "distance"), [(60.0, 0.0), (150.0, 0.15), (640.0, 0.1)])
def test_the_receptance_is_the_integral_over_all_wavenumbers(frequency, distance):
    r"""Timoshenko beam on a layer, from its two equations by hand:

    .. math:: W(q) \left[S q^2 + k - m\omega^2 - \frac{S^2 q^2}{EI q^2 + S - \rho I \omega^2}\right] = F
    """
    track, w = RandomTrack.draw(np.random.default_rng(5)), 2.0 * np.pi * frequency
    bending, shear = YOUNGS_MODULUS * track.second_moment, 0.39 * SHEAR_MODULUS * track.mass / 7850.0
    pad, ballast = (k + 1j * w * c for k, c in (track.pad, track.ballast))
    support = 1.0 / (1.0 / pad + 1.0 / (ballast - track.sleeper * w**2)) / SPACING

    def density(q, part):
        turned = bending * q**2 + shear - 7850.0 * track.second_moment * w**2
        return part(np.cos(q * distance) / (shear * q**2 + support - track.mass * w**2 - (shear * q) ** 2 / turned))

    # beyond 400 rad/m the density is 1 / S q² to 0.1 %, whose integral is 1 / (400 S) or less
    accuracy = {"limit": 4000, "epsabs": 1e-14}
    expected = [quad(density, 0.0, 400.0, args=(part,), **accuracy)[0] / np.pi for part in (np.real, np.imag)]
    found = track.receptance(np.array([w]), distance)[0]
    assert [found.real, found.imag] == pytest.approx(expected, abs=1.001 / (400.0 * np.pi * shear))
    assert found.imag < 0.0  # a passive track takes power


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ({}, None),
        ({"delay": -3e-3}, "not_simultaneous"),
        ({"delay": 2e-3}, "not_simultaneous"),
        ({"factor": 9.81}, "out_of_scale"),
        ({"factor": 1.0 / 9.81}, "out_of_scale"),
    ],
)
def test_a_fault_of_the_response_has_its_reason_on_any_track(fault, reason):
    for seed in range(3):
        recordings, _ = hammer_test(np.random.default_rng(seed), 6, **fault)
        impacts = find_track_impacts(recordings, "hammer", "rail", ReceptanceSettings())
        assert [{r.reason for r in i.rejections} for i in impacts] == [{reason} if reason else set()] * 6


def test_only_responses_above_the_limit_of_the_amplifier_are_called_limited():
    """Two of ten impacts or more exceed it."""
    n_found = 0
    for seed in range(6):
        recordings, excess = hammer_test(np.random.default_rng(seed), n_limited=2)
        impacts = find_track_impacts(recordings, "hammer", "rail", ReceptanceSettings())
        found = {k for k, i in enumerate(impacts) if "overload" in {r.reason for r in i.rejections}}
        assert found <= set(np.flatnonzero(excess > 1.0))
        n_found += len(found)
    assert n_found >= 6
