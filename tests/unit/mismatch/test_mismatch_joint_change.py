"""A quantity that an effect and a tolerance change: recordings determine the total change, priors its division."""

import numpy as np
import pytest

from turnout.mismatch.engine.joint_change import with_probable_division
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import FitPoint
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan


@pytest.fixture(scope="module")
def case():
    return TrackCase(measured_campaign(small_plan((15.0,)), (), 3))


def of_family(case, family):
    return next(c for c in case.candidates if c.family == family)


def end_of_fit(case, candidate, size, tolerance_sds):
    """(problem, point, Jacobian, names) of a fit that ends with this size beside this tolerance."""
    joint, names = JointProblem(case, (candidate,)), [n.name for n in case.nuisances]
    theta = np.append([n.mean for n in case.nuisances], size)
    k = names.index(candidate.site.masking_parameter)
    theta[k] += tolerance_sds * case.nuisances[k].sd
    predictions = joint.predict(theta)
    residuals = joint.residuals(predictions)
    point = FitPoint(theta, predictions, residuals, joint.cost(theta, residuals))
    return joint, point, joint.jacobian(theta, predictions), k


@pytest.mark.parametrize(
    "family, size", [("unsprung_mass", 1.36), ("sensor_gain", 0.7), ("sensor_gain", -1.1), ("sensor_position", 0.31)]
)
def test_a_division_changes_no_prediction_and_has_a_lower_cost(case, family, size):
    joint, point, jacobian, k = end_of_fit(case, of_family(case, family), size, 3.0)
    moved, rows = with_probable_division(joint, point, jacobian)
    assert abs(moved.theta[k] - joint.mean[k]) < abs(point.theta[k] - joint.mean[k]) / 2
    predictions = joint.predict(moved.theta)
    for before, after in zip(point.predictions, predictions, strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-9 * np.abs(before).max())  # rounding alone
    assert moved.cost < point.cost
    assert moved.cost == pytest.approx(joint.cost(moved.theta, joint.residuals(predictions)), rel=1e-9)
    new = joint.jacobian(moved.theta, predictions)
    for scaled, computed in zip(rows, new, strict=True):
        for column in (k, -1):  # one-sided differences, in single precision
            largest = np.abs(computed[:, column]).max()
            np.testing.assert_allclose(scaled[:, column], computed[:, column], rtol=0.03, atol=0.03 * largest)


def test_the_division_of_a_mass_is_that_of_both_priors(case):
    candidate = of_family(case, "unsprung_mass")
    joint, point, jacobian, k = end_of_fit(case, candidate, 1.36, 4.0)
    moved, _ = with_probable_division(joint, point, jacobian)
    eta, psi = moved.theta[k], moved.theta[-1]
    (mean, sd), tolerance_sd = candidate.parameters[0].prior, case.nuisances[k].sd
    # psi = t exp(-eta): the cost is least where psi (psi - mean) / sd^2 = eta / tolerance_sd^2
    assert psi * np.exp(eta) == pytest.approx(1.36 * np.exp(4.0 * tolerance_sd))
    assert eta == pytest.approx(tolerance_sd**2 * psi * (psi - mean) / sd**2, rel=1e-3)


def test_every_fit_ends_with_the_division_of_the_priors(case):
    candidate = of_family(case, "unsprung_mass")
    tolerance = next(n for n in case.nuisances if n.name == candidate.site.masking_parameter)
    fit = fit_jointly(case, (candidate,), [1.36], {tolerance.name: 4.0 * tolerance.sd}, iterations=0)
    assert fit.psi[0] * np.exp(fit.values[tolerance.name]) == pytest.approx(1.36 * np.exp(4.0 * tolerance.sd))
    assert fit.values[tolerance.name] < tolerance.sd


def test_an_effect_at_its_bound_stays_there(case):
    candidate = of_family(case, "unsprung_mass")
    lowest = candidate.parameters[0].bounds[0]
    joint, point, jacobian, _ = end_of_fit(case, candidate, lowest, -2.0)  # the priors would have a smaller one
    moved, _ = with_probable_division(joint, point, jacobian)
    assert moved is point


def test_pads_whose_tolerance_changes_the_damper_differently_are_not_divided(case):
    joint, point, jacobian, _ = end_of_fit(case, of_family(case, "local_pad"), 0.4, 3.0)
    moved, rows = with_probable_division(joint, point, jacobian)
    assert moved is point and all(a is b for a, b in zip(rows, jacobian, strict=True))
