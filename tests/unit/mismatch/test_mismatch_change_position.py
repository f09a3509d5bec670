"""The numbers of the tops of a switch that trains measure, and the numbers of a running surface that are stated."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.planned_case import small_plan
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.surface_priors import SURFACE
from turnout.simulate.blade import Blade
from turnout.simulate.wheel_path import BladeTop, Kink, StockFall
from turnout.stages.mismatch_rows import surface_estimates
from turnout.stages.mismatch_text import surface_sentence

STOCK, TOP = StockFall(21.0, 4.0, 0.02, 1.0), BladeTop(20.0, 4.0, 0.02, 1.0)  # two lines, level at 22.5 m
PLAN = small_plan((15.0,), hammer_positions=(24.0,))
TRACK = PLAN.turnout.track
FILED = replace(
    PLAN.turnout,
    track=TRACK.with_(blade=Blade(20.0, 27.0, 32.0, TRACK.rail, 3e8, 3e4)),
    routes={"main": ((STOCK,), (TOP,))},
    spreads={TOP: {"depth": 0.2, "power": 1e-6}},
)
WAVES = Waves([s.place for s in PLAN.sensors], 0.0)


def fit_of(surface, depth, error):
    """A fit that holds only a depth of the blade and its standard error."""
    values = dict.fromkeys(surface.names, 0.0) | {"surface_0_depth": depth}
    covariance = np.diag([error**2 if name == "surface_0_depth" else 0.0 for name in surface.names])
    return SimpleNamespace(values=values, covariance=covariance, jacobian=[])


def level(depth):
    """Crossing of a line that falls by 5 mm per metre from 21 m on and one from ``depth`` [mm] at 20 m to 0 at 24 m."""
    return (depth * 24.0 / 4.0 + 5.0 * 21.0) / (5.0 + depth / 4.0)


def test_for_tops_the_position_of_the_change_is_stated_with_its_error():
    """A depth at the toe, 2.5 m from where wheels touch the blade, is extrapolated: 1.6 times it, 4 prior sd."""
    surface = RunningSurface(FILED, WAVES, ("main",))
    case = SimpleNamespace(nuisances=surface.nuisances())
    (stated,) = surface.estimate(case, fit_of(surface, 0.5, 0.02))
    assert stated["filed"] == pytest.approx(22.5, abs=0.004)
    assert stated["value"] == pytest.approx(level(20.0 * np.exp(0.5)), abs=0.004)
    slope = (level(20.0 * np.exp(0.7)) - level(20.0 * np.exp(0.3))) / 0.4
    assert stated["se"] == pytest.approx(np.hypot(0.02 * slope, SURFACE.model_position_error), rel=0.05)
    text = surface_sentence(stated)
    assert text.startswith("The position of the change to the blade at 22.5 m is 22.9 m (")
    assert text.endswith("the track file has 22.5 m.")


def test_a_change_as_in_the_file_has_no_sentence_and_an_uncertain_one_is_not_stated():
    surface = RunningSurface(FILED, WAVES, ("main",))
    case = SimpleNamespace(nuisances=surface.nuisances())
    (stated,) = surface.estimate(case, fit_of(surface, 0.05, 0.02))
    assert surface_sentence(stated) == ""
    assert not list(surface.estimate(case, fit_of(surface, 0.05, 0.2)))


def test_for_a_nose_its_own_numbers_are_stated():
    nose = Kink(25.2, 0.8e-3, 1.0, 0.55)
    surface = RunningSurface(
        replace(PLAN.turnout, routes={"main": ((nose,),)}, spreads={nose: {"depth": 0.5}}), WAVES, ("main",)
    )
    case = SimpleNamespace(nuisances=surface.nuisances())
    assert [e["name"] for e in surface.estimate(case, fit_of(surface, 0.9, 0.02))][:1] == ["depth"]


@pytest.mark.parametrize(
    ("level", "loud", "is_stated"), [(0.6, 1.0, True), (0.9, 1.0, False), (0.6, 1.6, False), (None, 1.0, True)]
)
def test_a_fit_that_does_not_explain_the_passages_states_no_number(level, loud, is_stated):
    """With an excess in all channels or in one (1.6² of 2.0) the missing effect has changed the numbers."""
    observation = Observation(
        "p", "c", np.zeros(20), np.ones(20), 1.0, "passage", {}, np.repeat([0, 1], 10),
        {"sensor": np.array(["A1", "A2"])},
    )  # fmt: skip
    case = SimpleNamespace(
        predictor=SimpleNamespace(site=SimpleNamespace(surface=SimpleNamespace(estimate=lambda case, fit: ["number"]))),
        control_level={"passage": 0.7}, cell_level={"passage": 2.0}, observations=(observation,),
    )  # fmt: skip
    fit = SimpleNamespace(level={} if level is None else {"passage": level}, white=[np.repeat([0.1, loud], 10)])
    assert surface_estimates(case, fit) == (["number"] if is_stated else [])
