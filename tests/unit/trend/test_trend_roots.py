"""The root finder of the trends is that of SciPy, and jobs of the trends do not import the rest of its package."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.optimize import brentq

from turnout.trend.roots import find_root

FUNCTIONS = {
    "cubic": (lambda x: x**3 - 2.0 * x - 5.0, 2.0, 3.0),
    "flat at its root": (lambda x: (x - 1.3) ** 9, 0.0, 4.0),
    "steps": (lambda x: np.floor(8.0 * x) - 10.5, 0.0, 3.0),
    "falls": (lambda x: np.exp(-x) - 0.01, 0.0, 50.0),
    "long tail": (lambda x: np.arctan(x - 7.0), -1e6, 1e6),
}


@pytest.mark.parametrize("tolerance", [1e-12, 5e-3])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_roots_and_evaluations_are_those_of_scipy(name, tolerance):
    function, low, high = FUNCTIONS[name]
    evaluated = []

    def recorded_function(x):
        evaluated.append(x)
        return function(x)

    root = find_root(recorded_function, low, high, tolerance)
    expected, report = brentq(function, low, high, xtol=tolerance, rtol=2.0**-50, maxiter=200, full_output=True)
    assert root == expected and len(evaluated) == report.function_calls


def test_an_end_may_be_the_root_and_equal_signs_are_rejected():
    assert find_root(lambda x: x - 1.0, 1.0, 2.0, 1e-9) == 1.0
    assert find_root(lambda x: x - 2.0, 1.0, 2.0, 1e-9) == 2.0
    with pytest.raises(ValueError, match="same sign at 1 and at 2"):
        find_root(lambda x: x, 1.0, 2.0, 1e-9)


def test_a_trend_job_imports_no_optimiser():
    code = "import sys, turnout.stages.trend; sys.exit('scipy.optimize' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
