"""The collection of tests computes nothing, as each process repeats it and would compile the kernels."""

import numpy as np

from turnout.simulate.spline_kernel import second_differences


def test_no_test_module_simulates_on_import(kernels_of_collection):
    assert not kernels_of_collection, "a test module called it on import: call it in a fixture or a cached function"


def test_a_called_kernel_is_listed(used_kernels):
    second_differences(np.zeros(4), np.zeros(4))
    assert "turnout.simulate.spline_kernel.second_differences" in used_kernels()
