"""Steps of the joint fit with a too small predicted gain are not simulated."""

import numpy as np
import pytest

from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import DampedSteps
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation


class Wall(Case):
    """A number that rises by a linear prediction and falls by ``slope`` in fact: no step helps."""

    is_large = False
    nuisances = (Nuisance("x", "-", 0.0, 1e3),)
    observations = (Observation("a", "a", np.array([0.5]), 1.0),)

    def __init__(self, slope):
        self.slope = slope

    def predict(self, values, terms, observations):
        return [np.array([min(values["x"], -self.slope * values["x"])])]


def trials(slope, least):
    """Simulations of a step from 0 with a predicted gain of 0.25 in minus twice the log posterior."""
    joint = JointProblem(Wall(slope))
    joint.min_decrease = least
    start, residuals = np.zeros(1), [np.array([0.5])]
    steps = DampedSteps(joint, start, residuals, [np.array([[1.0]])])
    assert steps.predicted_decrease(steps.damped_step(0.0)) == pytest.approx(0.25, rel=1e-5)
    improvement, _ = steps.first_improvement(joint.cost(start, residuals), 0.0)
    assert improvement is None
    return joint.evaluations


@pytest.mark.parametrize("slope", [0.5, 50.0])
def test_after_a_failure_a_step_that_would_end_the_fit_is_not_tried_again(slope):
    """A parabola with the slope 2 q at its start and a rise at its end falls by q / 2 at most."""
    assert trials(slope, 0.49) == 1
    assert trials(slope, 0.26) == 1


def test_a_step_with_a_larger_predicted_gain_is_tried_with_rising_damping():
    """Each damping is six times the last, until a trial with a lower prediction fails: 0.25 (1 + 2 d) / (1 + d)²."""
    least = 0.2
    promises = [0.25 * (1.0 + 2.0 * d) / (1.0 + d) ** 2 for d in (0.0, *(0.01 * 6.0**k for k in range(7)))]
    assert trials(50.0, least) == 1 + sum(p >= least for p in promises) == 5


@pytest.mark.parametrize(("residual", "n_solved"), [(0.5, 1), (9.0, 5)])
def test_the_scale_of_the_noise_is_iterated_until_it_is_constant(monkeypatch, residual, n_solved):
    """It is 1 for a residual within its error. For a larger one the prior gives another scale in each of five steps."""
    case = Wall(0.5)
    case.nuisances = (Nuisance("x", "-", 0.0, 1.0),)
    case.observations = (Observation("a", "a", np.array([residual]), 1.0),)
    solved, solve = [], np.linalg.solve
    monkeypatch.setattr(np.linalg, "solve", lambda a, b: solved.append(float(a[0, 0])) or solve(a, b))
    steps = DampedSteps(JointProblem(case), np.zeros(1), [np.array([residual])], [np.array([[1.0]])])
    assert len(solved) == n_solved
    scale = 1.0 / (solved[-1] - 1.0)
    assert steps.promise == pytest.approx((residual / scale) ** 2 / (1.0 + 1.0 / scale))
