"""Decays with similar poles are combined with a loss that does not affect the choice of modes."""

import numpy as np
import pytest

from turnout.modal.least_squares import drift_columns, linearise
from turnout.modal.mixed_effects import fit_mixed
from turnout.modal.similar_decays import MAX_SMEAR, MIN_GROUPS, combine, group_similar

RATE, N = 20e3, 600
THETA = np.array([[np.log(150.0), 0.2], [np.log(600.0), 0.05]])
AMPLITUDE = np.array([1.0, 1.0])
NONE = drift_columns(N, -1)


def decays_of(theta):
    """Noise-free decays (n_decay, N) of modes (n_decay, n_mode, 2), all amplitudes 1."""
    omega, zeta = 2 * np.pi * np.exp(theta[..., 0]), theta[..., 1]
    pole = omega * (-zeta + 1j * np.sqrt(1 - zeta**2)) / RATE
    return np.exp(pole[..., None] * np.arange(N)).real.sum(axis=1)


def fit_of(spread, noise, seed, n=30):
    rng = np.random.default_rng(seed)
    theta = np.repeat(THETA[None], n, axis=0)
    theta[..., 0] += spread * rng.standard_normal((n, 1))
    decays = decays_of(theta) + noise * rng.standard_normal((n, N))
    return decays, fit_mixed(THETA, decays, RATE, NONE)


def test_the_mean_of_scattered_waves_lacks_the_energy_of_its_second_derivative():
    """Closed form for ln f: a quarter of the squared variance times 3 / zeta^2 times that of the first derivative."""
    mode, step = THETA[1:], 1e-3
    shifted = np.stack([mode, mode])
    shifted[:, :, 0] += [[step], [-step]]
    lacking = decays_of(shifted).mean(axis=0) - decays_of(mode[None])[0]
    shift = (decays_of(shifted)[0] - decays_of(shifted)[1]) / (2 * step)
    expected = 0.25 * step**4 * 3.0 / mode[0, 1] ** 2 * np.sum(shift**2)
    assert np.sum(lacking**2) == pytest.approx(expected, rel=0.02)


def test_impacts_with_equal_poles_need_the_fewest_groups():
    _, fit = fit_of(0.0, 0.01, 1)
    group = group_similar(fit)
    assert group.max() + 1 == MIN_GROUPS and set(np.bincount(group)) <= {3, 4, 7, 8}


@pytest.mark.parametrize(("spread", "noise"), [(0.006, 0.002), (0.02, 0.05)])
def test_the_modes_of_the_groups_explain_the_combined_decays(spread, noise):
    decays, fit = fit_of(spread, noise, 2)
    group = group_similar(fit)
    combined = combine(decays, group)
    assert MIN_GROUPS <= len(combined) <= 15
    refit = fit_mixed(fit.mean, combined, RATE, NONE)
    excess = refit.rss / noise**2 - combined.size
    # chance alone: three standard deviations of chi-squared; beyond it each group may add its limit in both parameters
    assert excess < 3.0 * np.sqrt(2.0 * combined.size) + 4 * MAX_SMEAR * len(combined)
    # All but the noise of the other combinations of each group, (30 - groups) N samples, and the remaining scatter.
    lost = np.sum(decays**2) - np.sum(combined**2) - (30 - len(combined)) * N * noise**2
    assert lost < 0.01 * np.sum(decays**2)


def test_impacts_that_differ_too_much_are_not_combined():
    _, fit = fit_of(0.03, 2e-4, 3)
    assert list(group_similar(fit)) == list(range(30))


def test_a_few_impacts_are_not_combined():
    _, fit = fit_of(0.0, 0.01, 4, n=10)
    assert list(group_similar(fit)) == list(range(10))


def test_a_combination_has_the_noise_of_one_decay_for_any_signs():
    rng = np.random.default_rng(5)
    sign = np.where(np.arange(12) % 3, 1.0, -1.0)
    wave = sign[:, None] * decays_of(np.repeat(THETA[None], 12, axis=0))
    combined = combine(wave + 0.01 * rng.standard_normal((12, N)), np.repeat([0, 1], 6))
    at = linearise(THETA[None], combined, RATE, NONE)
    np.testing.assert_allclose(np.abs(at.amplitude), np.sqrt(6.0), rtol=0.01)
    assert at.rss.sum() / (2 * (N - 4)) == pytest.approx(1e-4, rel=4 * np.sqrt(2 / (2 * (N - 4))))
