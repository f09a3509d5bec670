"""Nuisances fitted again beside some that are fixed at other values: minimum of the quadratic cost about a fit."""

import numpy as np
import pytest

from turnout.mismatch.engine.fit import Fit

HESSIAN = np.array([[4.0, 1.0, -0.5, 0.3], [1.0, 3.0, 0.7, -0.2], [-0.5, 0.7, 2.0, 0.4], [0.3, -0.2, 0.4, 1.0]])


@pytest.fixture
def fit():
    """Three nuisances and one parameter of an effect."""
    values = {"a": 1.0, "b": -2.0, "c": 0.5}
    parts = {name: [] for name in ("predictions", "residuals", "jacobian", "white")}
    return Fit(values, (), np.zeros(1), scale={}, level={}, cost=0.0, covariance=np.linalg.inv(HESSIAN),
               evaluations=0, **parts)  # fmt: skip


def test_the_gradient_of_the_cost_is_0_for_all_free_values(fit):
    beside = fit.values_beside({"a": 1.4, "c": -0.3})
    moved = np.array([beside[name] - fit.values[name] for name in fit.values])
    hessian = np.linalg.inv(np.linalg.inv(HESSIAN)[:3, :3])  # of the nuisances, the effect at its best
    assert (beside["a"], beside["c"]) == (1.4, -0.3)
    assert (hessian @ moved)[1] == pytest.approx(0.0, abs=1e-12)
    assert abs(moved[1]) > 0.05  # b changes as well: with a and c alone the gradient would not be 0


def test_no_value_changes_if_none_is_fixed_elsewhere(fit):
    assert fit.values_beside({}) == fit.values
    assert fit.values_beside({"b": -2.0}) == pytest.approx(fit.values, abs=1e-15)


def test_an_error_states_a_name_that_is_no_nuisance(fit):
    with pytest.raises(KeyError, match="z"):
        fit.values_beside({"z": 1.0})
