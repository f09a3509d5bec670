"""An effect within a wide tolerance of the base model is a finding if its size is certain: a worn nose."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import case as track_case
from turnout.mismatch.turnout.accepted_effects import NO_EFFECTS
from turnout.mismatch.turnout.planned_case import small_plan
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.worn_nose import is_certainly_worn, worn_noses
from turnout.physics import Parameter
from turnout.simulate.wheel_path import Kink

DEPTH = (Parameter("depth", "-", 0.0, (-10.0, 10.0), "of a dip", "made up 2026", (0.0, 3.0)),)
X = np.linspace(-1.0, 1.0, 200)
PLAN = small_plan((15.0,), hammer_positions=(24.0,))
NOSE = Kink(25.2, 0.8e-3, 1.0, 0.55)


class Nose(Case):
    """A parabola of an uncertain depth, 1 by the file with a tolerance of 2, under noise of 0.05."""

    nuisances = (Nuisance("depth", "-", 1.0, 2.0),)

    def __init__(self, depth, width=1.0):
        noise = 0.05 * np.random.default_rng(5).normal(size=(3, X.size))
        self.width = width  # of the dip that describes the wear
        self.observations = tuple(
            Observation(f"o{k}", f"day {k}", depth * self.dip(1.0) + n, np.full(X.size, 0.05))
            for k, n in enumerate(noise)
        )

    def dip(self, width):
        return np.clip(1.0 - np.abs(X) / width, 0.0, None) ** 2

    def predict(self, values, terms, observations):
        return [values["depth"] * self.dip(1.0) + sum(terms) * self.dip(self.width) for _ in observations]

    def tolerated_effects(self, fit):
        if fit.values["depth"] < 2.0:
            return ()
        more = {"nuisances": {"depth": 1.0}, "masking_parameter": "depth"}
        return (Candidate.of("dip", DEPTH, lambda p: p["depth"], ((2.0,),), {"place": 3.0}, **more),)


def test_a_worn_nose_is_no_candidate_of_a_library_without_dips(monkeypatch):
    dip = Candidate.of("surface_dip", DEPTH, dict, ((2.0,),), {"place": 3.0})
    monkeypatch.setattr(track_case, "worn_noses", lambda surface, estimates, fit: [dip])
    surface = SimpleNamespace(parameters=("depth",), estimate=lambda case, fit: ())
    case = SimpleNamespace(
        predictor=SimpleNamespace(site=SimpleNamespace(surface=surface)), fitted_passages=lambda: ["passage"],
        accepted=NO_EFFECTS,
    )  # fmt: skip
    for families, expected in ((None, (dip,)), ({"surface_dip"}, (dip,)), ({"local_pad"}, ())):
        case.families = families
        assert track_case.TrackCase.tolerated_effects(case, None) == expected


@pytest.mark.parametrize(("depth", "answer"), [(1.0, "none"), (1.8, "none"), (4.0, "named")])
def test_a_depth_that_the_tolerance_allows_for_has_a_name_if_it_is_certain(depth, answer):
    """The true depth is 4, that of the file 1. Dip and nose share the difference by their variances, 9 and 0.04."""
    found = diagnose(Nose(depth))
    assert found.verdict.answer == answer
    if answer == "named":
        assert found.names == ("dip",) and found.verdict.trail[-2:] == ("beyond_tolerance", "not_contradicted")
        assert found.fit.psi[0] == pytest.approx(3.0 * 9.0 / 9.04, rel=0.02)
        assert found.fit.psi[0] + found.fit.values["depth"] == pytest.approx(4.0, rel=0.02)


def test_a_dip_that_does_not_explain_the_recordings_has_no_name():
    """A dip of a tenth of the width does not explain the wear of the nose."""
    assert diagnose(Nose(4.0, width=0.1)).verdict.answer == "none"


def test_a_nose_clearly_twice_as_deep_as_in_the_file_is_reported_as_a_dip():
    plan = replace(PLAN.turnout, routes={"main": ((NOSE,),)}, spreads={NOSE: {"place": 0.02, "depth": 0.4}})
    surface = RunningSurface(plan, Waves([s.place for s in PLAN.sensors], 0.0), ("main",))
    fit = SimpleNamespace(values={"surface_0_place": 0.1, "surface_0_depth": 1.2, "surface_0_power": 0.0})
    estimate = next(p for p in surface.parameters if p.field == "depth").estimate(1.2, 0.12)
    (dip,) = worn_noses(surface, [estimate], fit)
    assert (dip.family, dip.where["place"], dip.site.n_scanned) == ("surface_dip", 25.3, 1)
    assert dip.starts[0][:2] == pytest.approx((NOSE.depth * (np.exp(1.2) - 1.0), NOSE.length))
    assert dip.site.masking_parameter == "surface_0_depth"
    assert dip.refit.nuisances == dict.fromkeys(surface.names, 0.0)
    assert not list(worn_noses(surface, [estimate | {"name": "length"}], fit))
    assert not list(worn_noses(surface, [estimate | {"se": 0.2 * estimate["value"]}], fit))


def test_a_depth_below_the_file_is_no_wear():
    assert is_certainly_worn(2.1e-3, 0.0, 1e-3) and not is_certainly_worn(2.0e-3, 0.0, 1e-3)  # exp(0.7) = 2.01
    assert not is_certainly_worn(0.2e-3, 0.0, 1e-3) and not is_certainly_worn(-1e-3, 1e-4, 1e-3)
