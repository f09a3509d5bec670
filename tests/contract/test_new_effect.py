"""A new effect needs one file and one line: a diagnosis then tests it, names it and states what to check on site."""

import importlib
import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan
from turnout.stages.accepted_effects import AcceptedEffect
from turnout.stages.effects_page import page
from turnout.stages.finding_row import recommendation
from turnout.stages.mismatch_text import title
from turnout.stages.parameter_text import parameter_in_words

FILE = '''"""A box on one sleeper: drive, cabinet, heater."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.hypothesis import Hypothesis, SupportSite
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link


@dataclass(frozen=True)
class SleeperBox(PhysicsTerm):
    """A mass that moves with the sleeper."""

    sleeper: int
    mass: float

    name = "sleeper_box"
    left_out = "{mass:.0f} kg stand on sleeper {sleeper}"
    message = "A box of {mass} stands on the sleeper at {place}"
    site_check = "Look for a box on this sleeper"
    separating_test = "a hammer test on this sleeper"
    effect_type = "matrix"
    frame = "place"
    site_types = (SupportSite,)
    column_type = "support"
    smallest_reportable = 10.0
    parameters = (Parameter("mass", "kg", 0.0, (0.0, 500.0), "mass on one sleeper", "made up 2026"),)

    @classmethod
    def example(cls):
        """60 kg on sleeper 20."""
        return cls(20, 60.0)

    @classmethod
    def hypotheses(cls, site):
        """A light box on this sleeper."""
        yield Hypothesis(((40.0,),), {"sleeper": site.support}, site.where, site.n_sites)

    def links(self, track):
        """One mass."""
        return [Link(((("sleeper", self.sleeper), 1.0),), mass=self.mass, tag="box")]

    def pseudo_force(self, motion):
        """Its inertia."""
        return "sleeper", -self.mass * np.gradient(np.gradient(motion.sleeper)) * motion.rate**2
'''


@pytest.fixture
def box(tmp_path, monkeypatch):
    """The new effect: its file, and its line in ``physics.TERMS``."""
    (tmp_path / "sleeper_box.py").write_text(FILE)
    monkeypatch.syspath_prepend(tmp_path)
    effect = importlib.import_module("sleeper_box").SleeperBox
    monkeypatch.setattr(physics, "TERMS", (*physics.TERMS, effect))
    yield effect
    del sys.modules["sleeper_box"]


def test_a_diagnosis_tests_the_new_effect_at_every_support(box):
    case = PlannedCase(small_plan((15.0,), passages=False, hammer_positions=(24.0,)))
    boxes = [c for c in case.candidates if c.family == "sleeper_box"]
    pads = [c for c in case.candidates if c.family == "local_pad"]
    assert [c.where for c in boxes] == [c.where for c in pads] and len(boxes) > 10
    assert boxes[0].term((40.0,)) == box(boxes[0].where["sleeper"], 40.0)
    # an added link changes a receptance exactly: the order of the fits needs no other property of the effect
    fit = fit_jointly(case, iterations=0)
    column, candidate = case.screen(fit)[boxes[5].key, 0], boxes[5]
    for o, before, found in zip(case.observations, fit.predictions, column):
        (after,) = case.predict(fit.values, (candidate.term((40.0,)),), [o])
        assert np.linalg.norm(found - (after - before)) < 1e-5 * np.linalg.norm(after - before)


def test_a_finding_names_the_new_effect_and_states_what_to_check(box):
    term = {"term": "sleeper_box", "fixed": {"sleeper": 24.6}}
    term["parameters"] = {"mass": {"value": 62.0, "se": 3.0, "unit": "kg"}}
    finding = {"verdict": "named", "term_json": json.dumps([term]), "rival_term": None, "train": None, "channel": None}
    finding |= {"place_low_m": 20.0, "place_high_m": 28.0}
    assert title(finding) == "A box of 62 kg stands on the sleeper at 24.6 m (95 % interval: 56 to 68 kg)."
    assert parameter_in_words("sleeper_box", "mass") == "mass: mass on one sleeper"
    named = SimpleNamespace(verdict=SimpleNamespace(answer="named", names=("sleeper_box",)))
    assert recommendation(named) == "Look for a box on this sleeper"
    pair = SimpleNamespace(verdict=SimpleNamespace(answer="a_or_b", names=("rail_shear", "sleeper_box")))
    assert recommendation(pair) == "Measure a hammer test on this sleeper"


def test_the_page_of_effects_contains_the_new_effect(box):
    row = "| A box on one sleeper | `sleeper_box` | a position | mass on one sleeper [kg] | 10 kg | Look for a box"
    assert row in page()


def test_a_track_file_can_contain_the_new_effect(box):
    track = SimpleNamespace(support=np.arange(0.0, 48.0, 0.6), nearest_support=lambda x: round(x / 0.6))
    effect = AcceptedEffect("sleeper_box", {"sleeper": 24.6}, {"mass": (62.0, 3.0)})
    assert effect.term(track) == box(41, 62.0) and [p.name for p in effect.parameters] == ["mass"]
