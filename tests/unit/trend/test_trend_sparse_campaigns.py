"""Few campaigns, several sections: splits, steps and errors against brute force and statsmodels."""

import itertools

import numpy as np
import pytest
import statsmodels.api as sm
from benchmarks.sparse_campaigns import (
    Block,
    design,
    deviance,
    find_splits,
    independent_quantities,
    left_out_error,
    steps,
    verdicts,
)


def block(seed, truth=(0, 0, 0, 0), step=1.0, n_quantity=8, n_campaign=5, noise=0.2, slope=0.01):
    rng = np.random.default_rng(seed)
    n_section = len(truth)
    temperature = rng.uniform(-5, 35, (1, n_campaign)) + rng.normal(0, 2, (n_section, n_campaign))
    values = rng.normal(0, 1, (n_quantity, n_section, 1)) + slope * temperature
    for s, k in enumerate(truth):
        if k:
            values[:, s, k:] += step * rng.choice([-1, 1, 0.5], (n_quantity, 1))
    return Block(values + noise * rng.standard_normal(values.shape), temperature)


@pytest.mark.parametrize("truth", [(0, 0, 0, 0), (2, 0, 0, 3), (1, 1, 1, 0), (1, 1, 1, 1), (0, 3, 0, 0)])
def test_splits_found_step_by_step_are_the_best_of_all(truth):
    blocks = [block(1, truth, n_campaign=4), block(2, truth, n_quantity=3, n_campaign=4)]
    best = find_splits(blocks)
    every = itertools.product(range(4), repeat=4)
    assert deviance(blocks, best) == pytest.approx(min(deviance(blocks, k) for k in every), abs=1e-9)
    assert best == truth


def test_steps_and_slopes_are_those_of_ordinary_regression():
    b = block(3, (0, 2, 0, 0))
    step, error, p_value, slope, slope_error = steps(b, (0, 2, 0, 0))
    matrix = design((0, 2, 0, 0), b.temperature)
    for q in range(len(b.values)):
        fit = sm.OLS(b.values[q].ravel(), matrix).fit()
        assert (step[q, 1], error[q, 1], p_value[q, 1]) == pytest.approx(
            (fit.params[4], fit.bse[4], fit.pvalues[4]), rel=1e-8
        )
        assert (slope[q], slope_error[q]) == pytest.approx((fit.params[5], fit.bse[5]), rel=1e-8)
    assert np.isnan(step[:, [0, 2, 3]]).all()


def test_the_error_of_a_left_out_campaign_equals_that_of_a_new_fit():
    b, splits = block(4, (0, 4, 0, 0)), (0, 4, 0, 0)
    matrix = design(splits, b.temperature)
    campaign, section = np.tile(np.arange(5), 4), np.repeat(np.arange(4), 5)
    for q in range(2):
        squares = []
        for c in range(5):
            # Campaign 4 alone determines the step of section 1: that cell has no prediction.
            columns = [j for j in range(matrix.shape[1]) if not (c == 4 and j == 4)]
            fit = sm.OLS(b.values[q].ravel()[campaign != c], matrix[campaign != c][:, columns]).fit()
            ahead = (campaign == c) & ~((c == 4) & (section == 1))
            squares += list((b.values[q].ravel()[ahead] - matrix[ahead][:, columns] @ fit.params) ** 2)
        assert left_out_error(b, splits)[q] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-8)


def test_a_temperature_term_reduces_the_error_only_if_temperature_has_an_effect():
    warm, cold = block(5, slope=0.05, noise=0.1), block(6, slope=0.0, noise=0.1)
    assert (left_out_error(warm, (0,) * 4) < left_out_error(warm, (0,) * 4, "")).all()
    assert np.mean(left_out_error(cold, (0,) * 4, "") < left_out_error(cold, (0,) * 4)) > 0.5


def test_equal_quantities_are_not_counted_twice():
    b = block(7, n_quantity=1)
    copies = Block(np.repeat(b.values, 10, axis=0), b.temperature)
    assert independent_quantities([copies], (0,) * 4) == pytest.approx(1.0)
    many = block(8, n_quantity=10)
    assert 4.0 < independent_quantities([many], (0,) * 4) <= 10.0


def test_a_changed_section_is_reported_and_an_intact_one_is_not():
    found = verdicts([block(9, (0, 2, 0, 0), n_campaign=6)], n_permutation=400)
    assert found[1].split == 2
    assert found[1].probability[2] > 0.95 and found[1].p_value < 0.02
    assert all(v.p_value > 0.02 for i, v in enumerate(found) if i != 1)


def test_p_values_of_intact_sections_are_not_too_small():
    p_values = [v.p_value for seed in range(20) for v in verdicts([block(100 + seed, n_quantity=4)], n_permutation=59)]
    # 80 of them; under the null at most 5 % lie at 0.05 or below: 4 expected, 11 or more once in 500 times.
    assert np.mean(np.array(p_values) <= 0.05) < 11 / 80
