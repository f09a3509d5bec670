"""Variable projection and the mixed fit: exact gradients, the Cramér-Rao bound, the spread between impacts."""

import numpy as np
import pytest
from benchmarks.published import hammer_test, published_model
from scipy.stats import norm

from turnout.modal import cramer_rao_bound, discrete_pole, summarise
from turnout.modal.decay_fit import held_out_fit, random_mode_fits
from turnout.modal.least_squares import drift_columns, linearise, powers
from turnout.modal.mixed_effects import between_variance, fit_common, fit_mixed
from turnout.modal.noise import noise_filter, whiten

NO_DRIFT = drift_columns(600, -1)


def theta_of(frequency, damping):
    return np.stack([np.log(frequency), damping], axis=-1)


def decays_of(location="CP A7", n=10, seed=0, **conditions):
    test = hammer_test(location, n, seed, **conditions)
    return test, np.array(test.decays())


def test_powers_are_those_of_repeated_products():
    z = np.array([[0.9 + 0.3j, 0.5 - 0.1j]])
    expected = np.cumprod(np.concatenate([np.ones((1, 2, 1)), np.repeat(z[..., None], 16, axis=2)], axis=2), axis=2)
    np.testing.assert_allclose(powers(z, 17), expected, rtol=1e-13)


@pytest.mark.parametrize("degree", [-1, 2])
def test_the_score_is_the_gradient_of_the_residual_by_differences(degree):
    test, decays = decays_of(n=2)
    columns = drift_columns(600, degree)
    theta = theta_of(test.frequency * [1.02, 0.99], test.damping * [0.9, 1.1])
    at = linearise(theta, decays, test.rate, columns)
    for mode in range(2):
        for p in range(2):
            step = np.zeros_like(theta)
            step[:, mode, p] = 1e-6
            up, down = (linearise(theta + s * step, decays, test.rate, columns).rss for s in (1.0, -1.0))
            # Central differences of step 1e-6 are good to 1e-9 of the curvature.
            np.testing.assert_allclose(-(up - down) / 4e-6, at.score[:, 2 * mode + p], rtol=1e-5)


def test_the_information_is_the_curvature_where_the_residual_vanishes():
    test, decays = decays_of(n=1, snr_db=300.0)
    theta = theta_of(test.frequency, test.damping)
    at = linearise(theta, decays, test.rate, NO_DRIFT)
    # At the truth rss = d^T J^T J d to second order in the step d, for every direction.
    for direction in np.random.default_rng(0).standard_normal((4, 4)):
        d = 1e-5 * direction
        moved = linearise(theta + d.reshape(1, 2, 2), decays, test.rate, NO_DRIFT).rss[0]
        assert moved == pytest.approx(d @ at.information[0] @ d, rel=1e-3)


def test_the_fit_reaches_the_cramer_rao_bound():
    """60 tests, 4 parameters: an rms is known to 1/sqrt(120) = 9 %, four of them stay within 3.3 deviations."""
    model = published_model("CP A7")
    truth = theta_of(model.frequency, model.damping)
    errors, bounds = [], []
    for k in range(60):
        test, decays = decays_of(seed=[11, k], snr_db=30.0)
        errors.append(fit_mixed(truth * [1.002, 1.05], decays, test.rate, NO_DRIFT).mean - truth)
        exact = theta_of(test.frequency, test.damping)
        bounds.append(cramer_rao_bound(exact, decays, test.rate, test.noise**2))
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(np.square(bounds), axis=0))
    assert np.all(ratio < 1.3)
    assert np.all(ratio > 0.7)


def test_the_bound_falls_with_the_root_of_the_number_of_impacts_and_with_the_noise():
    test, decays = decays_of(n=4, snr_db=200.0)
    one = np.repeat(decays[:1], 9, axis=0)
    theta = np.repeat(theta_of(test.frequency, test.damping)[:1], 9, axis=0)
    single = cramer_rao_bound(theta[:1], one[:1], test.rate, 2.0)
    np.testing.assert_allclose(cramer_rao_bound(theta, one, test.rate, 2.0), single / 3.0, rtol=1e-9)
    np.testing.assert_allclose(cramer_rao_bound(theta[:1], one[:1], test.rate, 8.0), 2.0 * single, rtol=1e-9)


def test_the_spread_between_impacts_is_recovered_and_does_not_become_damping():
    """Thirty impacts of 2 % spread: the standard deviation is known to 1/sqrt(58) = 13 %, three of that allowed."""
    test, decays = decays_of(n=30, seed=5, spread=0.02)
    model = published_model("CP A7")
    fit = fit_mixed(theta_of(model.frequency, model.damping), decays, test.rate, NO_DRIFT)
    spread = np.sqrt(fit.spread).reshape(2, 2)
    assert spread[1, 0] == pytest.approx(0.02, rel=0.4)
    # One pole for all impacts would give 3 % more damping in the railpad mode; the mean of 30 is known to 0.4 %.
    assert fit.mean[1, 1] == pytest.approx(test.damping[:, 1].mean(), rel=0.01)
    np.testing.assert_allclose(fit.theta[:, 1, 0], np.log(test.frequency[:, 1]), atol=2e-3)


def test_without_spread_the_mixed_fit_is_the_fit_with_shared_poles():
    test, decays = decays_of(n=10, seed=8)
    model = published_model("CP A7")
    fit = fit_mixed(theta_of(model.frequency, model.damping), decays, test.rate, NO_DRIFT)
    assert np.all(np.sqrt(fit.spread) < 0.01)
    assert fit.sigma2 == pytest.approx(np.mean(test.noise**2), rel=0.1)


def test_the_between_variance_is_zero_where_errors_explain_the_scatter():
    assert between_variance(np.array([1.0, 1.1, 0.9]), np.full(3, 1.0)) == 0.0
    assert between_variance(np.array([[5.0]]), np.array([[1.0]])) == 0.0


def test_equal_errors_give_the_t_interval():
    value = np.array([3.0, 5.0, 4.0, 8.0])
    s = summarise(value, np.full(4, 0.3))
    # t(3) at 97.5 % is 3.182 (tables); sd of the sample is sqrt(14/3).
    assert s.high - s.mean == pytest.approx(3.182 * np.sqrt(14.0 / 3.0) / 2.0, rel=1e-3)
    assert (s.mean, s.n) == (5.0, 4)


def test_a_weak_impact_has_a_lower_weight_in_the_mean():
    assert summarise([0.0, 0.1, 9.0], [0.1, 0.1, 90.0]).mean < 0.06


def test_the_error_of_the_model_choice_widens_the_interval_and_does_not_change_the_mean():
    plain, chosen = (summarise([3.0, 5.0, 4.0, 8.0], [0.3] * 4, shared_se=c) for c in (0.0, 2.0))
    assert (chosen.mean, chosen.spread) == (plain.mean, plain.spread)
    assert chosen.se == pytest.approx(np.hypot(plain.se, 2.0))
    # The shared error has a normal interval: its probability is known, not estimated from four values.
    assert chosen.high - chosen.mean == pytest.approx(np.hypot(plain.high - plain.mean, 2.0 * norm.ppf(0.975)))


def test_the_fit_with_shared_poles_to_principal_decays_is_the_optimum_for_all_decays():
    """At its optimum the score of all 30 decays vanishes against their own information."""
    _, decays = decays_of(n=30, seed=6)
    model = published_model("CP A7")
    start = theta_of(model.frequency, model.damping) * [1.001, 1.05]
    theta, settled = fit_common(start, decays, 20e3, NO_DRIFT)
    at = linearise(theta[None], decays, 20e3, NO_DRIFT)
    information, score = at.information.sum(axis=0), at.score.sum(axis=0)
    step = np.linalg.solve(information, score)
    # In standard errors; only the noise of the 22 other decays remains.
    sigma2 = at.rss.sum() / decays.size
    assert settled
    assert np.sqrt(step @ information @ step / sigma2) < 0.3


def test_a_single_impact_keeps_its_own_error():
    s = summarise([2.0], [0.5])
    assert (s.se, s.n) == (0.5, 1)
    assert s.high == pytest.approx(2.0 + 1.96 * 0.5, abs=1e-3)
    with pytest.raises(ValueError, match="no estimates"):
        summarise([], [])


def test_the_noise_filter_estimates_the_true_autoregression():
    rng = np.random.default_rng(3)
    noise = np.zeros((10, 700))
    for k in range(1, 700):
        noise[:, k] = 0.8 * noise[:, k - 1] + rng.standard_normal(10)
    found = noise_filter(noise[:, 100:], 6)
    # 6000 samples: the coefficient is known to sqrt((1 - 0.64) / 6000) = 0.008.
    assert found == pytest.approx([1.0, -0.8], abs=0.03)


def test_whitening_does_not_change_the_poles():
    k = np.arange(50)
    z = 0.9 * np.exp(0.6j)
    white = whiten((z**k).real[None], np.array([1.0, -0.5, 0.2]))[0]
    # A decay of pole z obeys y[k+2] = 2 Re(z) y[k+1] - |z|^2 y[k], for any amplitude.
    np.testing.assert_allclose(white[2:], 2 * z.real * white[1:-1] - abs(z) ** 2 * white[:-2], atol=1e-12)


def test_the_held_out_fit_of_an_impact_does_not_use_its_own_modes():
    """Three impacts of one mode and a fourth of another: the modes of the others do not describe the fourth at all."""
    k = np.arange(300)
    poles = [discrete_pole(f, 0.05, 20e3) for f in (200.0, 200.0, 200.0, 600.0)]
    decays = np.array([(z**k).real for z in poles])
    theta = theta_of(np.array([[200.0], [200.0], [200.0], [600.0]]), np.full((4, 1), 0.05))
    fits = held_out_fit(theta, decays, 20e3)
    assert fits[3] < 15.0
    exact = held_out_fit(theta[:3], decays[:3], 20e3)
    np.testing.assert_allclose(exact, 100.0, atol=1e-4)


def test_random_modes_explain_noise_only_by_the_number_of_their_amplitudes():
    """One mode has two free amplitudes: of 600 samples of noise it explains 2/600, a fit of 0.17 %."""
    noise = np.random.default_rng(4).standard_normal((20, 600))
    null = random_mode_fits(noise, 20e3, [(50.0, 300.0)], 40)
    # Medians of chi-squared: 1.39 for two amplitudes, less 0.45 for the mean that the score subtracts; halved, of 600.
    assert np.median(null) == pytest.approx(100.0 * (1.39 - 0.45) / 1200.0, abs=0.15)
    assert np.all(null < 0.6)
