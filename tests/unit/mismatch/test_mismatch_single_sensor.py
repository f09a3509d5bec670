"""A gain in one sensor alone is no effect of the track if other sensors would have to show it."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate import Candidate, EffectSite
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.refit import _with_condition_gains
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.single_source import single_sensor
from turnout.physics import Parameter

SIZE = (Parameter("size", "-", 0.0, (-9.0, 9.0), "of a bump", "made up 2026"),)
BUMP = np.sin(np.linspace(0.0, 6.0, 100))
SENSORS = np.repeat(["A1", "A2"], BUMP.size)


class TwoSensors(Case):
    """Two recordings of two sensors, with the true share of a bump in each and that of the model."""

    def __init__(self, true, model, impossible_without=False):
        self.model, self.impossible_without = self.both(model), impossible_without
        data = self.both(true)
        cells = np.arange(data.size)
        self.observations = tuple(
            Observation(name, name, data, np.full(data.size, 0.1), cells=cells, labels={"sensor": SENSORS}, rows=2)
            for name in "ab"
        )
        self.candidates = (Candidate.of("bump", SIZE, lambda p: p["size"], ((0.5,),), {"place": 3.0}),)

    def both(self, shares):
        return np.concatenate([share * BUMP for share in shares])

    def predict(self, values, terms, observations):
        if self.impossible_without and not terms:
            raise SimulationError("cannot go without")
        return [sum(terms) * self.model for _ in observations]

    def fits(self):
        """Without the bump and with it."""
        return fit_jointly(self), fit_jointly(self, self.candidates, [0.5], iterations=20)

    def source(self, candidate=None, gain=15.0):
        (own,) = self.candidates
        fit = fit_jointly(self, self.candidates, [0.5], iterations=20)
        without = replace(fit, predictions=[np.zeros(SENSORS.size) for _ in self.observations])
        return single_sensor(Search(self), without, Score(candidate or own, gain, 0.0, 1.0, fit))


@pytest.mark.parametrize(
    "true, model, source",
    [
        ((1.0, 1.0), (1.0, 1.0), ""),  # both show it
        ((1.0, 0.0), (1.0, 1.0), "the sensor A1"),  # A2 would show as much, and loses
        ((0.0, 1.0), (1.0, 1.0), "the sensor A2"),
        ((1.0, 0.0), (1.0, 0.72), "the sensor A1"),  # 0.52 of the energy
        ((1.0, 0.0), (1.0, 0.68), ""),  # 0.46: too small to contradict
        ((0.02, 0.0), (1.0, 1.0), ""),  # too little gain to be a name of one sensor
        ((1.0, 0.5), (1.0, 0.72), ""),  # A2 has the effect, though smaller
    ],
)
def test_an_effect_gains_where_its_change_has_energy(true, model, source):
    assert TwoSensors(true, model).source() == source


def test_a_gain_in_the_penalty_of_nuisances_belongs_to_no_sensor():
    """Half of the bump fits best: A1 gains about 3,800 nats and A2 loses 1,300, in total less than half of 6,000."""
    case = TwoSensors((1.0, 0.0), (1.0, 1.0))
    assert case.source(gain=15.0) == "the sensor A1" and case.source(gain=6000.0) == ""


def test_without_a_simulation_sensors_are_not_compared():
    assert TwoSensors((1.0, 0.0), (1.0, 1.0), impossible_without=True).source() == ""


@pytest.mark.parametrize("true, source", [((1.0, 1.0), ""), ((1.0, 0.0), "the sensor A1")])
def test_the_leader_of_a_search_is_tested_for_a_single_sensor(true, source):
    case = TwoSensors(true, (1.0, 1.0))
    case.is_large = True
    without, fit = case.fits()
    leader = _with_condition_gains(Search(case), without, Score(case.candidates[0], 15.0, 0.0, 1.0, fit))
    assert leader.single_source == source


def test_an_effect_of_a_sensor_needs_no_other_sensor():
    case = TwoSensors((1.0, 0.0), (1.0, 1.0))
    of_a_sensor = replace(case.candidates[0], site=EffectSite({"sensor": "A1"}))
    assert case.source() == "the sensor A1" and case.source(of_a_sensor) == ""
