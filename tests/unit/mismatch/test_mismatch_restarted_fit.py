"""A leader in a wrong minimum is restarted at the start with the lowest cost."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.leaders import restart_leader
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.search import Search
from turnout.physics import Parameter

X = np.linspace(0.0, 1.0, 400)
DEPTH, LENGTH = 1.1, 4.6
SHAPE = (
    Parameter("depth", "-", 0.0, (-9.0, 9.0), "size", "made up 2026", (0.0, 3.0)),
    Parameter("length", "-", 6.0, (1.0, 20.0), "turns", "made up 2026", (6.0, 6.0)),
)


class Turning(Case):
    """A wave whose phase depends on two numbers, four recordings, and a ramp of the base model that can imitate it."""

    is_large = True

    def __init__(self):
        rng = np.random.default_rng(4)
        self.nuisances = (Nuisance("ramp", "-", 0.0, 0.5),)
        self.candidates = (Candidate.of("dip", SHAPE, lambda p: p, ((1.0, 6.0),)),)
        true = self.wave(DEPTH, LENGTH)
        self.observations = tuple(
            Observation(f"o{k}", f"day {k}", true + 0.05 * rng.normal(size=X.size), 0.05) for k in range(4)
        )

    def wave(self, depth, length):
        return depth * np.sin(2.0 * np.pi * length * X + 1.5 * depth)

    def predict(self, values, terms, observations):
        return [values["ramp"] * X + sum((self.wave(**t) for t in terms), 0.0 * X) for _ in observations]


def score_from(case, base, start, ramp):
    found = fit_jointly(case, case.candidates, start, {"ramp": ramp}, iterations=8)
    return score_of(Search(case), base, found, case.candidates[0])


def test_a_leader_in_a_wrong_minimum_is_restarted_at_a_smaller_size():
    """A fit from 2.0 and 9.0 ends in a minimum that explains hardly anything; half of both leads to 1.1 and 4.6."""
    case = Turning()
    base = fit_jointly(case)
    stuck = score_from(case, base, [2.0, 9.0], 2.0)
    assert stuck.explained < 0.2 and abs(stuck.estimates[0][1] - LENGTH) > 1.0
    again = restart_leader(Search(case), base, stuck)
    assert again.estimates[0] == pytest.approx([DEPTH, LENGTH], abs=0.02) and again.explained > 0.9
    assert again.gain > stuck.gain + 1000.0


def test_a_leader_that_explains_enough_or_has_no_size_is_not_restarted():
    case = Turning()
    base = fit_jointly(case)
    found = score_from(case, base, [1.0, 4.5], 0.0)
    assert restart_leader(Search(case), base, found) is found
    sizeless = replace(found.candidate, effect=replace(found.candidate.effect, parameters=()))
    plain = replace(found, explained=0.1, candidate=sizeless)
    assert restart_leader(Search(case), base, plain) is plain
