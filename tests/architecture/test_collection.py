"""Collecting the tests computes nothing: each process does it, and on a new checkout each would compile the kernels."""

import numpy as np

from turnout.simulate.spline_kernel import second_differences


def test_no_test_simulates_while_it_is_collected(kernels_of_collection):
    assert not kernels_of_collection, (
        "called on import by a module of tests: a fixture or a cached function calls later"
    )


def test_a_called_kernel_is_listed(used_kernels):
    second_differences(np.zeros(4), np.zeros(4))
    assert "turnout.simulate.spline_kernel.second_differences" in used_kernels()
