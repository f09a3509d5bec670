"""Fits to hammer tests with a further effect are never worse than without it, from any start."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.hammer_prescreen import _Prescreen
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.physics import Parameter

SIZE = (Parameter("size", "-", 0.0, (-1.0, 1.0), "amount", "test"),)


class TwoBasins(Case):
    """A number is 1 or -1, by its square; a second sample shows which, within ``error``. An effect changes a third
    one."""

    nuisances = (Nuisance("x", "-", 0.3, 3.0),)

    def __init__(self, side, error):
        data, sigma = (1.0, side, 0.5), (0.05, error, 0.05)
        self.observations = tuple(Observation(n, n, np.array([d]), s) for n, d, s in zip("abc", data, sigma))

    def predict(self, values, terms, observations):
        size = sum(terms)
        return [{"a": np.array([values["x"] ** 2]), "b": np.array([values["x"]]), "c": np.array([size])}[o.name]
                for o in observations]  # fmt: skip


def prescreen_from(base_values):
    """Broad errors prefer -1, actual ones +1; the base starts at ``base_values``."""
    broad, actual, settings = TwoBasins(-1.0, 0.3), TwoBasins(1.0, 0.2), MismatchSettings()
    return _Prescreen(settings, broad, actual, (), fit_jointly(broad, iterations=60), base_fit(actual, base_values))


def base_fit(case, x):
    return fit_jointly(case, values={"x": x}, iterations=60)


def test_a_fit_with_an_effect_does_not_end_in_a_worse_minimum_than_without():
    """Without a second start it ends at x = -1, where b alone costs more than c gains by the effect."""
    step = prescreen_from(0.8)
    effect = Candidate.of("effect", SIZE, lambda p: p["size"], ((0.5,),))
    broad = fit_jointly(step.broad_case, (effect,), [0.5], {"x": -0.8}, iterations=60)
    assert broad.values["x"] == pytest.approx(-1.0, abs=0.05)
    assert fit_jointly(step.hammer_case, (effect,), broad.psi, broad.values, iterations=60).cost > step.base.cost
    best = step._fit_actual((effect,), broad)
    assert best.values["x"] == pytest.approx(1.0, abs=0.05)
    assert best.cost < step.base.cost


def test_a_gain_of_the_base_fit_from_the_nuisances_of_an_effect_is_no_evidence():
    """The base fit is in the worse minimum. The nuisances of the effect lead it to the better one, and that gain is no
    evidence."""
    step = prescreen_from(-0.8)
    better, beside = base_fit(step.hammer_case, 0.8), SimpleNamespace(values={"x": 1.0})
    found = step.base_shortfall(beside)
    assert found == pytest.approx(better.evidence - step.base.evidence, abs=0.1) and found > 0.3
    assert prescreen_from(0.8).base_shortfall(beside) == pytest.approx(0.0, abs=0.1)
