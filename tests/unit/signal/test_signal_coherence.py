"""The coherence limits against the negative binomial mixture, drawn data and their own definition."""

import numpy as np
import pytest
from scipy.special import betainc
from scipy.stats import nbinom

from turnout.signal import coherence


@pytest.mark.parametrize("n, true, estimate", [(2, 0.4, 0.7), (3, 0.9, 0.65), (10, 0.8, 0.6), (30, 0.7, 0.8)])
def test_distribution_is_the_negative_binomial_mixture_of_betas(n, true, estimate):
    # An independent form of the same law (Goodman 1957); 4,000 terms leave less than 1e-12.
    k = np.arange(4000)
    mixture = np.sum(nbinom.pmf(k, n, 1.0 - true) * betainc(1 + k, n - 1, estimate))
    assert float(coherence.coherence_distribution(estimate, true, n)) == pytest.approx(mixture, abs=1e-11)


@pytest.mark.parametrize("n", [2, 3, 10, 30, 300])
def test_the_distribution_for_incoherent_signals_is_a_power(n):
    z = np.array([0.001, 0.05, 0.3, 0.9])
    assert coherence.coherence_distribution(z, 0.0, n) == pytest.approx(1.0 - (1.0 - z) ** (n - 1), abs=1e-12)


@pytest.mark.parametrize("n", [2, 3, 10, 30, 90, 300])
@pytest.mark.parametrize("probability", [0.025, 0.05, 0.95, 0.975])
def test_a_tabulated_limit_has_the_requested_probability(n, probability):
    estimate = -np.expm1(-np.linspace(1e-3, 12.0, 997))
    true = coherence.true_coherence_with_quantile(estimate, n, probability)
    inside = (true > 0.0) & (true < 1.0)
    reached = coherence.coherence_distribution(estimate[inside], true[inside], n)
    # 1e-5 in probability is a hundredth of what 1e6 tests could resolve.
    assert np.max(np.abs(reached - probability)) < 1e-5
    assert inside.sum() > 300


def drawn_coherence(true, n, draws, rng):
    x, e = (rng.standard_normal((2, draws, n, 2)) @ [1.0, 1j]).reshape(2, draws, n)
    y = np.sqrt(true) * x + np.sqrt(1.0 - true) * e
    cross = np.abs(np.mean(x.conj() * y, axis=1)) ** 2
    return cross / (np.mean(np.abs(x) ** 2, axis=1) * np.mean(np.abs(y) ** 2, axis=1))


@pytest.mark.parametrize("n, true", [(3, 0.9), (10, 0.8), (30, 0.6)])
def test_limits_enclose_the_truth_of_drawn_records(n, true):
    draws = 20_000
    estimate = drawn_coherence(true, n, draws, np.random.default_rng(n))
    low, high = coherence.coherence_limits(estimate, n)
    three_sigma = 3.0 * np.sqrt(0.95 * 0.05 / draws)
    assert np.mean((low <= true) & (true <= high)) == pytest.approx(0.95, abs=three_sigma)
    one_sided = coherence.lower_coherence_limit(estimate, n)
    assert np.mean(one_sided <= true) == pytest.approx(0.95, abs=three_sigma)


def test_the_paper_gate_lets_a_true_coherence_of_0_7_pass_in_a_fifth_of_all_tests():
    # Passing "> 0.8" with 10 averages, by 400,000 draws: 0.22 at a true 0.7, 0.59 at 0.8, 0.97 at 0.9.
    passes = 1.0 - coherence.coherence_distribution(0.8, np.array([0.7, 0.8, 0.9]), 10)
    assert passes == pytest.approx([0.22, 0.59, 0.97], abs=0.006)


def test_limits_of_one_record_are_0_and_1_and_those_of_a_missing_line_are_missing():
    low, high = coherence.coherence_limits(np.array([1.0, np.nan]), 1)
    assert low[0] == 0.0 and high[0] == 1.0 and np.isnan([low[1], high[1]]).all()
    with pytest.raises(ValueError, match="need 2 or more"):
        coherence.coherence_distribution(0.5, 0.5, 1)


def test_limits_widen_with_fewer_records_and_lie_around_the_estimate():
    z = np.linspace(0.05, 0.99, 50)
    low10, high10 = coherence.coherence_limits(z, 10)
    low30, high30 = coherence.coherence_limits(z, 30)
    assert (low10 <= low30).all() and (high10 >= high30).all() and (low30 < z).all()
    above_zero = z > 1.0 - 0.05 ** (1.0 / 29.0)  # incoherent signals exceed it in 5 % of all tests
    assert (high30[above_zero] > z[above_zero] - 0.05).all()


def test_one_record_allows_no_statement():
    low, high = coherence.coherence_limits([0.0, 0.3, 1.0, np.nan], 1)
    assert low[:3].tolist() == [0.0] * 3 and high[:3].tolist() == [1.0] * 3 and np.isnan([low[3], high[3]]).all()
