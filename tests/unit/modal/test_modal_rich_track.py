"""Decays of a track with more than two modes: other modes must not affect the two named modes."""

import numpy as np
import pytest

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import identify
from turnout.modal.poles import continuous_pole
from turnout.modal.summary import cramer_rao_bound
from turnout.records import Receptance

SETTINGS = IdentifySettings(null_draws=10)
RATE = 20e3
LINES = np.arange(5.0, 1500.0, 5.0)
BALLAST, RAILPAD = (99.5, 0.29, 1.0 + 0.3j), (616.0, 0.0656, 3.0 - 1.0j)


def test(modes, seed, n=10, spread=0.0, noise=0.01, duration=0.03):
    """(decays (n, n_sample), frequencies (n, n_mode)): modes (f, zeta, residue) that each move by ``spread``."""
    rng, t = np.random.default_rng(seed), np.arange(round(duration * RATE)) / RATE
    f, zeta, residue = (np.array(column) for column in zip(*modes))
    moved = f * (1 + spread * rng.standard_normal((n, len(modes))))
    s = continuous_pole(moved, np.broadcast_to(zeta, moved.shape))
    decays = np.einsum("m,nmt->nt", residue, np.exp(s[..., None] * t)).real
    decays *= 1 + 0.1 * rng.standard_normal((n, 1))
    return decays + noise * np.abs(residue).max() * rng.standard_normal(decays.shape), moved


test.__test__ = False


def exact(modes):
    """Receptance of these modes, trusted on every line."""
    f, zeta, residue = (np.array(column) for column in zip(*modes))
    p, s = 2j * np.pi * LINES[:, None], continuous_pole(f, zeta)
    h = 0.5 * (residue / (p - s) + residue.conj() / (p - s.conj())).sum(axis=1) / p[:, 0] ** 2
    level, passed = np.full(LINES.size, 0.95), np.ones(LINES.size, dtype=bool)
    return Receptance(LINES, h, h, h, level, level, level, level, passed, 10, 1500.0)


@pytest.mark.parametrize("seed", [300, 301, 302])
def test_a_weak_mode_does_not_duplicate_a_mode_that_scatters_between_impacts(seed):
    """A hundredth of the peak at 330 Hz; each impact determines its frequency to 0.1 %, so the mean is that of the
    impacts."""
    decays, moved = test([BALLAST, RAILPAD, (330.0, 0.05, 0.05)], seed, spread=0.02)
    mode = identify(decays, RATE, SETTINGS).mode("railpad")
    assert mode.frequency == pytest.approx(moved[:, 1].mean(), rel=2e-3)
    assert mode.damping == pytest.approx(RAILPAD[1], rel=0.03)
    # the standard error is that of the impacts' mean; a sample's standard deviation of ten is known to 24 %
    assert mode.frequency_se == pytest.approx(moved[:, 1].std(ddof=1) / np.sqrt(10), rel=0.25)


@pytest.mark.parametrize("other", [(1050.0, 0.03, 3.0 + 0.0j), (330.0, 0.05, 1.0 + 0.0j)])
def test_a_further_mode_is_not_part_of_the_response_of_the_named_modes(other):
    """The response to a unit impulse is that of the named modes. Without the other mode in the fit it erred by 10 %."""
    modes = [BALLAST, RAILPAD, other]
    decays, _ = test(modes, 5, noise=1e-3)
    model = identify(decays, RATE, SETTINGS, exact(modes))
    assert model.diagnostics["scale"].startswith("unit impulse")
    found = [model.c @ np.linalg.matrix_power(model.a, k) @ model.b for k in range(200)]
    f, zeta, residue = (np.array(column) for column in zip(BALLAST, RAILPAD))
    s = continuous_pole(f, zeta)
    expected = (residue[:, None] * np.exp(s[:, None] * np.arange(200) / RATE)).real.sum(axis=0)
    # poles are known to 1e-3 here and have six periods: 1e-2 of the peak by the phase alone
    np.testing.assert_allclose(found, expected, atol=2e-2 * np.abs(expected).max())


@pytest.mark.parametrize("pad", [299.0, 301.0, 285.0])
def test_a_railpad_mode_near_or_below_the_edge_of_its_band_leaves_the_ballast_mode(pad):
    decays, _ = test([(100.0, 0.2, 1.0 + 0.3j), (pad, 0.06, 3.0 - 1.0j)], 1)
    model = identify(decays, RATE, SETTINGS)
    assert model.status == "accepted"
    assert model.mode("ballast").frequency == pytest.approx(100.0, rel=0.02)
    assert model.mode("railpad").frequency == pytest.approx(pad, rel=0.01)


def test_neither_of_two_modes_in_the_ballast_band_is_a_railpad_mode():
    """The upper mode is farther below the edge than its width, so it is no railpad mode."""
    decays, _ = test([(100.0, 0.2, 1.0 + 0.3j), (250.0, 0.06, 3.0 - 1.0j)], 1)
    model = identify(decays, RATE, SETTINGS)
    assert (model.status, [m.band for m in model.modes]) == ("second_order_only", ["ballast"])


@pytest.mark.parametrize(("ballast", "zeta"), [(100.0, 0.02), (150.0, 0.02), (200.0, 0.01), (250.0, 0.01)])
def test_a_lightly_damped_mode_at_a_harmonic_of_the_mains_is_no_hum(ballast, zeta):
    """It has the same phase in every impact. Modelled as mode and hum it had 10 to 45 times the error of the noise.

    30 ms do not resolve a second pole within the half-power half-width of 2 Hz: the whole error is a part of that.
    """
    decays, _ = test([(ballast, zeta, 1.0 + 0.3j), RAILPAD], 3)
    mode = identify(decays, RATE, SETTINGS).mode("ballast")
    assert mode.frequency_repeatability < 3.0 * mode.frequency_crb
    assert mode.frequency_se < 0.3 * zeta * ballast
    assert abs(mode.frequency - ballast) < 5.0 * mode.frequency_se
    assert mode.damping == pytest.approx(zeta, rel=0.05)


@pytest.mark.parametrize("size", [0.02, 0.1, 0.5])
def test_hum_beside_the_modes_is_identified_as_hum(size):
    rng, t = np.random.default_rng(4), np.arange(600) / RATE
    decays, _ = test([BALLAST, RAILPAD], 3)
    decays = decays + 3.0 * size * np.sin(2 * np.pi * 150.0 * t + rng.uniform(0, 2 * np.pi, (10, 1)))
    assert identify(decays, RATE, SETTINGS).diagnostics["hum"] == (150.0,)


@pytest.mark.parametrize("seed", [500, 501, 502])
def test_a_residual_common_to_all_impacts_is_a_further_mode(seed):
    """A mode within 7 % of the railpad, a tenth of its amplitude: the noise of single impacts stays white without it,
    and the frequency of the railpad would be 5 Hz too high."""
    modes = [(164.0, 0.19, 1.0 + 0.2j), (677.0, 0.087, 3.0 + 1.0j), (725.0, 0.049, 0.3 + 0.1j)]
    decays, moved = test(modes, seed, n=30, noise=0.05)
    mode = identify(decays, RATE, SETTINGS).mode("railpad")
    bound = cramer_rao_bound(
        np.stack([np.log(moved), np.broadcast_to([m[1] for m in modes], moved.shape)], axis=2),
        decays,
        RATE,
        np.full(30, (0.05 * abs(modes[1][2])) ** 2),
    )[1]
    # four standard deviations of an estimate at the bound
    assert abs(np.log(mode.frequency / 677.0)) < 4 * bound[0]
    assert abs(mode.damping - 0.087) < 4 * bound[1]
