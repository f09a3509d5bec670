"""Intervals on pages use quantiles of Student's t, which are compared with printed tables and with scipy."""

import math

import pytest
from scipy.special import stdtrit

from turnout.report.formatting import student_quantile

# Abramowitz and Stegun 1964, table 26.10: two-sided 95 %, degrees of freedom and quantile.
PRINTED = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 9: 2.262, 10: 2.228, 29: 2.045, 60: 2.000, 120: 1.980}


@pytest.mark.parametrize(("degrees", "quantile"), PRINTED.items())
def test_quantiles_are_those_of_the_printed_table(degrees, quantile):
    assert student_quantile(degrees + 1) == pytest.approx(quantile, abs=5e-4)


def test_quantiles_have_all_digits_for_few_and_many_values():
    for n in (*range(2, 60), 500, 501, 20_000):
        assert student_quantile(n) == pytest.approx(float(stdtrit(n - 1, 0.975)), rel=1e-11)


def test_a_single_value_has_no_interval():
    assert math.isnan(student_quantile(1))
