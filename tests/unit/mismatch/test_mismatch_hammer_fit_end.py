"""Fits to hammer tests end at the same values from any start."""

from dataclasses import replace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import DampedSteps
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.hammer_case import HammerCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.simulate import uniform_track
from turnout.simulate.turnout_track import TurnoutTrack


@pytest.mark.parametrize("seed", [3, 5])
def test_a_fit_ends_at_the_same_values_from_any_start(seed):
    """Pads a third softer and ballast 1.5 times as stiff; the scatter of supports is four times that of the priors.
    A common factor is exchangeable with thirty single ones, and some end at their bounds."""
    rng = np.random.default_rng(seed)
    small = small_plan((5.0, 25.0), passages=False, hammer_positions=(21.6, 24.0))
    turnout = TurnoutTrack(uniform_track(36.0, start=6.0), {"main": ((),)})
    plan = replace(small, turnout=turnout, n_impacts=3, sensors=small.sensors[:3])
    supports = range(turnout.track.support.size)
    terms = [physics.LocalPad(j, float(np.exp(-0.4 + 0.4 * rng.normal()))) for j in supports]
    terms += [physics.LocalBallast(j, float(np.exp(0.4 + 0.4 * rng.normal()))) for j in supports]
    case = TrackCase(measured_campaign(plan, terms, seed)).hammer_case()
    ends = []
    for k in range(4):
        far = 0.7 * np.random.default_rng(k).normal(size=len(case.nuisances)) if k else np.zeros(len(case.nuisances))
        start = {n.name: n.mean + f * n.sd for n, f in zip(case.nuisances, far)}
        ends.append(float(fit_jointly(case, values=start, iterations=THRESHOLDS.max_hammer_steps).cost))
    assert np.ptp(ends) < 1.0  # half a nat; a fit ends where ten steps in a row would gain no more


class Line(Case):
    """A straight line through the origin with a bound of its slope."""

    def __init__(self):
        x = np.arange(1.0, 5.0)
        self.nuisances = tuple(Nuisance(n, "-", 0.0, 10.0, bounds=(-0.5, 0.5)) for n in ("slope", "rest"))
        self.observations = (Observation("a", "a", 2.0 * x + 0.3 * x**2, np.full(4, 0.1)),)
        self.x = x

    def predict(self, values, terms, observations):
        return [values["slope"] * self.x + values["rest"] * self.x**2]


def test_a_value_at_its_bound_stays_and_the_others_reach_their_optimum():
    """With the slope fixed at 0.5 the optimum of the others is a regression, and 0.5 at most."""
    case = Line()
    found = fit_jointly(case, iterations=20)
    assert found.values["slope"] == 0.5 and found.values["rest"] == 0.5
    x, y = case.x, case.observations[0].data
    held = JointProblem(case)
    theta = np.array([0.5, 0.1])
    predictions = held.predict(theta)
    residuals = held.residuals(predictions)
    step = DampedSteps(held, theta, residuals, held.jacobian(theta, predictions)).damped_step(0.0)
    best = np.sum((y - 0.5 * x) * x**2) / np.sum(x**4)
    assert step[0] == pytest.approx(0.0, abs=1e-9)
    assert theta[1] + step[1] == pytest.approx(best, rel=1e-3)  # the prior of 10 takes (0.1 / 10)² / sum x⁴ off


class Arctangent(Case):
    """The arctangent of a number, measured as zero. From 1.3917 Newton's step leads to -1.3917, and back again."""

    nuisances = (Nuisance("x", "-", 0.0, 1e3),)
    observations = (Observation("a", "a", np.zeros(1), np.full(1, 0.01)),)

    def predict(self, values, terms, observations):
        return [np.arctan([values["x"]])]

    def nuisance_jacobian(self, values, terms, observations, base):
        return [np.array([[1.0 / (1.0 + values["x"] ** 2)]])]


@pytest.mark.parametrize("start", [1.39, 1.391, -1.3917])
def test_a_fit_does_not_end_at_a_step_to_the_other_side_of_a_valley(start):
    """2 x / (1 + x²) = arctan x has its root at 1.39175. Just below it a full step gains less than half a nat."""
    options = {"iterations": THRESHOLDS.max_hammer_steps, "min_gain": THRESHOLDS.min_hammer_step_gain}
    assert abs(fit_jointly(Arctangent(), values={"x": start}, **options).values["x"]) < 0.02


class Vibration(HammerCase):
    """Four seconds of a vibration of 5 + x rad/s: beside the true x, about 1.5 rad/s apart, lie other minima."""

    def __init__(self, x):
        self.t = np.linspace(0.0, 4.0, 81)
        nuisance = Nuisance("x", "-", 0.0, 2.0, bounds=(-8.0, 8.0))
        observation = Observation("a", "a", np.sin((5.0 + x) * self.t), np.full(self.t.size, 0.1))
        super().__init__(None, (observation,), (nuisance,))

    def predict(self, values, terms, observations):
        return [np.sin((5.0 + values["x"]) * self.t)]

    def nuisance_jacobian(self, values, terms, observations, base):
        return [(self.t * np.cos((5.0 + values["x"]) * self.t))[:, None]]


@pytest.mark.parametrize("x", [0.4, 3.3])
def test_a_fit_to_all_tests_ends_in_the_deepest_minimum(x):
    """From the mean of the prior a fit ends beside an x of 1.6 standard deviations, also with larger errors."""
    case = Vibration(x)
    from_mean = fit_jointly(case, values=fit_jointly(case.with_broad_errors(), iterations=30).values, iterations=30)
    assert (abs(from_mean.values["x"] - x) < 0.01) == (x == 0.4)
    assert case.fit_from_priors().values["x"] == pytest.approx(x, abs=0.01)
