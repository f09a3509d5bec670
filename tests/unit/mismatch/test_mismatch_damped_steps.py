"""Steps of the joint fit that promise too little are not simulated, and those that cost more not to their end."""

import numpy as np
import pytest

from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import DampedSteps
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation


class Wall(Case):
    """A number that a straight step promises to reach, and that falls by ``slope`` instead: nothing helps."""

    expensive = False
    nuisances = (Nuisance("x", "-", 0.0, 1e3),)
    observations = (Observation("a", "a", np.array([0.5]), 1.0),)

    def __init__(self, slope):
        self.slope = slope

    def predict(self, values, terms, observations):
        return [np.array([min(values["x"], -self.slope * values["x"])])]


class Recordings(Case):
    """Ten zeros in each of a hammer test and four passages, where ``x`` or exp 3x - 1 is predicted; each is noted."""

    expensive = True
    nuisances = (Nuisance("x", "-", 0.0, 2.0),)

    def __init__(self, steep=False):
        self.predicted, self.steep = [], steep
        self.observations = tuple(Observation(n, n, np.zeros(10), 1.0) for n in ("a", "b", "hammer", "c", "d"))

    def is_cheap(self, observation):
        return observation.name == "hammer"

    def predict(self, values, terms, observations):
        self.predicted += [o.name for o in observations]
        x = values["x"]
        return [np.full(10, np.expm1(3.0 * x) if self.steep else x) for _ in observations]


def cost_of(n_predicted, x):
    """Minus twice the log posterior if ``n_predicted`` of five recordings are off by x and the others by nothing."""
    return 50.0 * (1.0 + np.log(x**2 * n_predicted / 5.0)) + (x / 2.0) ** 2


@pytest.mark.parametrize("n_predicted", [1, 2, 4, 5])
def test_a_trial_ends_with_the_recording_that_makes_it_cost_more(n_predicted):
    """Those of hammer tests come first. The whole cost is given where it is below the limit."""
    case, x, order = Recordings(), 6.0, ["hammer", "a", "b", "c", "d"]
    joint = JointProblem(case)
    assert joint.evaluate_below(np.array([x]), cost_of(n_predicted, x) - 1e-6) is None
    assert case.predicted == order[:n_predicted]
    case.predicted.clear()
    evaluated = joint.evaluate_below(np.array([x]), cost_of(n_predicted, x) + 1e-6)
    assert case.predicted == order[: min(5, n_predicted + 1)]
    if n_predicted < 5:
        assert evaluated is None
    else:
        assert evaluated[-1] == pytest.approx(cost_of(5, x)) and len(evaluated[0]) == len(evaluated[1]) == 5


def test_a_cheap_case_is_predicted_at_once():
    case = Recordings()
    case.expensive = False
    assert JointProblem(case).evaluate_below(np.array([6.0]), 0.0) is None
    assert case.predicted == ["a", "b", "hammer", "c", "d"]


def test_a_fit_ends_where_it_does_without_this_saving(monkeypatch):
    """The first step fails: a line along exp 3x - 1 at -1 reaches 0 far where the curve has risen."""

    def fit():
        case = Recordings(steep=True)
        return fit_jointly(case, values={"x": -1.0}, iterations=25), len(case.predicted)

    saving, n_predicted = fit()
    evaluate = JointProblem.evaluate_below

    def evaluate_all(joint, theta, max_cost=np.inf):
        evaluated = evaluate(joint, theta)
        return evaluated if evaluated[-1] < max_cost else None

    monkeypatch.setattr(JointProblem, "evaluate_below", evaluate_all)
    plain, n_without = fit()
    assert (saving.values, saving.cost) == (plain.values, plain.cost)
    assert n_predicted < n_without


def trials(slope, least):
    """Simulations of a step from 0, which promises 0.25 of minus twice the log posterior."""
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


def test_a_step_that_promises_more_is_tried_with_rising_damping():
    """Each damping is six times the last, until a trial fails that promised less: 0.25 (1 + 2 d) / (1 + d)²."""
    least = 0.2
    promises = [0.25 * (1.0 + 2.0 * d) / (1.0 + d) ** 2 for d in (0.0, *(0.01 * 6.0**k for k in range(7)))]
    assert trials(50.0, least) == 1 + sum(p >= least for p in promises) == 5


@pytest.mark.parametrize(("residual", "n_solved"), [(0.5, 1), (9.0, 5)])
def test_the_scale_of_the_noise_is_sought_until_it_stays(monkeypatch, residual, n_solved):
    """It is 1 for a residual within its error. Beyond, the prior lets each of five steps leave another scale."""
    case = Wall(0.5)
    case.nuisances = (Nuisance("x", "-", 0.0, 1.0),)
    case.observations = (Observation("a", "a", np.array([residual]), 1.0),)
    solved, solve = [], np.linalg.solve
    monkeypatch.setattr(np.linalg, "solve", lambda a, b: solved.append(float(a[0, 0])) or solve(a, b))
    steps = DampedSteps(JointProblem(case), np.zeros(1), [np.array([residual])], [np.array([[1.0]])])
    assert len(solved) == n_solved
    scale = 1.0 / (solved[-1] - 1.0)
    assert steps.promise == pytest.approx((residual / scale) ** 2 / (1.0 + 1.0 / scale))
