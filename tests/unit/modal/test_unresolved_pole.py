"""A second pole that the decays do not resolve: its closed form, the noise alone, and the interval with it."""

import numpy as np
import pytest

from turnout.modal.least_squares import drift_columns
from turnout.modal.mixed_effects import fit_mixed
from turnout.modal.poles import continuous_pole
from turnout.modal.unresolved_pole import second_order_term, second_pole_posterior, unresolved_pole_error

RATE, N, N_IMPACT = 20e3, 600, 20
F, ZETA = 120.0, 0.15
POLE = complex(continuous_pole(np.array(F), np.array(ZETA)))
HALF = -POLE.real  # half-power half-width [rad/s]
NO_DRIFT = drift_columns(N, -1)


def fit_of_two(distance, ratio, noise, rng):
    """Fit of one pole to decays of two, the second at ``distance`` half-widths and of ``ratio`` to the first."""
    t = np.arange(N) / RATE
    wave = np.exp(POLE * t) + ratio * np.exp((POLE + distance * HALF) * t)
    size = (1.0 + 0.1 * rng.standard_normal((N_IMPACT, 1))) * np.exp(0.1j * rng.standard_normal((N_IMPACT, 1)))
    decays = (size * wave).real + noise * rng.standard_normal((N_IMPACT, N))
    return fit_mixed(np.array([[np.log(F), ZETA]]), decays, RATE, NO_DRIFT, iterations=40)


@pytest.mark.parametrize("distance", [0.06, 0.06j, -0.03 + 0.05j])
@pytest.mark.parametrize("ratio", [0.5, 0.4 * np.exp(2j), 0.3 * np.exp(-1j)])
def test_kappa_and_the_pole_of_the_fit_are_those_of_the_closed_form(distance, ratio):
    """Both to the next order in the distance."""
    fit = fit_of_two(distance, ratio, 1e-9, np.random.default_rng(1))
    expected = ratio * distance**2 / (2.0 * (1.0 + ratio) ** 2)
    kappa = second_order_term(fit, NO_DRIFT, RATE)[0][0]
    assert abs(kappa - expected) < 0.15 * abs(expected)
    shift = (complex(continuous_pole(np.exp(fit.mean[0, 0]), fit.mean[0, 1])) - POLE) / HALF
    assert abs(shift) ** 2 == pytest.approx(2.0 * abs(ratio) * abs(expected), rel=0.15)


def test_kappa_of_noise_has_the_stated_variance_and_a_clear_record_has_no_error():
    rng = np.random.default_rng(2)
    fits = [fit_of_two(0.0, 0.0, 0.01, rng) for _ in range(60)]
    kappa, variance = np.array([second_order_term(f, NO_DRIFT, RATE) for f in fits])[..., 0].T
    ratio = np.mean(np.abs(kappa) ** 2 / (2.0 * variance.real))  # chi-squared of 120 over 120
    assert 0.65 < ratio < 1.4
    error = np.array([unresolved_pole_error(f, NO_DRIFT, RATE)[0, 1] for f in fits])
    assert np.median(error) < 0.02 * ZETA


def test_the_interval_contains_the_stronger_mode_if_noise_hides_the_second_pole():
    """Eighty such modes; two standard errors of the noise alone contain three in five."""
    rng = np.random.default_rng(3)
    inside = []
    for _ in range(80):
        ratio = rng.uniform(0.2, 0.6) * np.exp(1j * rng.uniform(-np.pi, np.pi))
        fit = fit_of_two(np.exp(1j * rng.uniform(-np.pi, np.pi)) * rng.uniform(0.3, 0.8), ratio, 1.5, rng)
        error = np.abs(fit.mean[0] - [np.log(F), ZETA])
        information = fit.linearisation.information.sum(axis=0)
        noise = np.sqrt(fit.sigma2 * np.diag(np.linalg.inv(information)))
        stated = np.hypot(noise, unresolved_pole_error(fit, NO_DRIFT, RATE)[0])
        inside.append(np.concatenate([error < 2.0 * noise, error < 2.0 * stated]))
    share = np.mean(inside, axis=0)
    assert np.all(share[:2] < 0.75), share
    assert np.all(share[2:] > 0.8), share


def test_decays_without_information_do_not_change_the_probability():
    probability, open_variance = second_pole_posterior(np.array([3.0]), np.array([1e8]))
    assert probability[0] == pytest.approx(0.5, abs=1e-3)
    assert open_variance[0] == pytest.approx(0.3**2, rel=1e-3)
