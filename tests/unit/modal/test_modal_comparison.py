"""Two tests are compared by their impacts; a shift is found, or the detectable shift is stated."""

import numpy as np
import pytest
from benchmarks.published import hammer_test
from scipy.stats import ttest_ind

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import compare_tests, identify, welch_test
from turnout.modal.comparison import detectable_shift

SETTINGS = IdentifySettings(null_draws=10)


def model_of(seed, **conditions):
    test = hammer_test("CP A7", 10, seed, **conditions)
    return identify(test.decays(), test.rate, SETTINGS)


def test_welch_agrees_with_scipy():
    rng = np.random.default_rng(1)
    first, second = rng.normal(0.0, 1.0, 10), rng.normal(1.0, 3.0, 7)
    difference, se, freedom, probability, _ = welch_test(first, second)
    expected = ttest_ind(second, first, equal_var=False)
    assert probability == pytest.approx(expected.pvalue)
    assert difference / se == pytest.approx(expected.statistic)
    assert freedom == pytest.approx(expected.df)


def test_the_detectable_shift_of_ten_and_ten_is_found_in_four_of_five():
    """Shift over spread at 80 % power, p < 0.01, n = 10 each: 1/0.59, as tables of the noncentral t have it."""
    shift_over_spread = detectable_shift(18.0) * np.sqrt(2.0 / 10.0)
    assert 1.0 / shift_over_spread == pytest.approx(0.59, abs=0.005)


def test_a_detectable_shift_is_detected_at_its_power():
    """400 pairs of normal samples: a power of 0.8 is known to 0.02, three of that allowed."""
    rng = np.random.default_rng(2)
    shift = detectable_shift(18.0) * np.sqrt(0.2)
    found = [welch_test(rng.normal(0, 1, 10), rng.normal(shift, 1, 10))[3] < 0.01 for _ in range(400)]
    assert np.mean(found) == pytest.approx(0.8, abs=0.06)


def test_a_shifted_ballast_mode_is_found_and_the_constant_railpad_mode_is_not():
    first, second = model_of(1, spread=0.01), model_of(2, spread=0.01, shift=(0.95, 1.0))
    ballast, railpad = (compare_tests(first, second, band) for band in ("ballast", "railpad"))
    assert ballast.detected
    assert ballast.low < 0.05 * -99.4 < ballast.high
    assert "moved" in str(ballast)
    assert not railpad.detected
    assert f"a shift of {railpad.detectable:.3g} Hz would be found in 80 % of tests" in str(railpad)


def test_a_five_per_cent_shift_hardly_changes_the_fit():
    """A fit does not detect a shift: the held-out fit depends on the scatter of impacts, not on the pole."""
    first, second = model_of(3), model_of(4, shift=(0.95, 1.0))
    assert compare_tests(first, second, "ballast").probability < 1e-6
    assert abs(first.fit - second.fit) < 2.0


def test_a_test_without_the_mode_cannot_be_compared():
    lone = identify(hammer_test("CP A8", 10, 5).decays(), 20e3, SETTINGS)
    assert compare_tests(model_of(6), lone, "railpad") is None
    with pytest.raises(ValueError, match="two impacts"):
        welch_test([1.0], [1.0, 2.0])
