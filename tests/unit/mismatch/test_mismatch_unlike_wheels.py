"""Each wheel meets a nose otherwise than the file has it: an error of the passage's own, as a simulation has it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from turnout.mismatch.joint import fit_jointly
from turnout.mismatch.track import TrackCase
from turnout.mismatch.track.planned import measured_campaign, small_plan
from turnout.mismatch.track.rolled_waves import Carrier
from turnout.mismatch.track.unlike_wheels import DEPTH, LENGTH, PLACE, _otherwise, profile_modes
from turnout.physics.term import PhysicsTerm
from turnout.simulate.wheel_path import Kink

PLAN = small_plan((15.0,), blows=(24.0,))
NOSE = Kink(25.2, 0.3e-3, 0.9, 0.55)
FILED = replace(PLAN.turnout, routes={"main": ((NOSE,),)}, spreads={NOSE: {"depth": 0.5}})


def test_ways_of_wheels_are_those_of_noses_that_differ_by_a_standard_deviation():
    """A tenth of each, by difference, to the curvature's share; the sharper one is gone at both ends and where the nose
    is deepest."""
    way = np.linspace(24.0, 26.5, 25001)
    deeper, further, longer, sharper = _otherwise(NOSE(way), way)
    others = (
        (deeper, replace(NOSE, depth=NOSE.depth * (1.0 + 0.1 * DEPTH)), 0.1),
        (further, replace(NOSE, place=NOSE.place - 0.1 * PLACE), 0.1),
        (longer, replace(NOSE, length=NOSE.length * (1.0 - 0.1 * LENGTH)), 0.1),
    )
    smooth = np.abs(way - NOSE.place) > 0.1 * PLACE + 1e-3  # the kink itself moves
    for found, nose, share in others:
        change = (nose(way) - NOSE(way)) / share
        assert found[smooth] == pytest.approx(change[smooth], abs=0.03 * np.abs(found).max())
    assert sharper[[0, -1]].tolist() == [0.0, 0.0] and abs(sharper[np.argmax(NOSE(way))]) < 1e-9
    assert sharper.max() == pytest.approx(0.5 * NOSE.depth * (0.75**3 - 0.75**4), rel=1e-3)  # where s = 0.75^4


def test_a_level_rail_is_met_alike_by_all():
    assert _otherwise(np.zeros(50), np.linspace(0.0, 1.0, 50)) == []


@dataclass(frozen=True)
class OneWheel(PhysicsTerm):
    """The second wheel alone falls deeper by ``DEPTH``."""

    name, kind = "one_wheel", "path"

    def paths(self, track, vehicle):
        part = lambda x, wheel=0: DEPTH * NOSE(x)  # noqa: E731
        deeper = type("Deeper", (), {"wheel": 1, "__call__": lambda self, x, wheel=0: part(x)})()
        return (deeper,)


@pytest.mark.slow
def test_the_signal_of_a_wheel_that_falls_deeper_is_that_of_a_simulation():
    """First mode of the second wheel against the march with that wheel's own path: cosine above 0.95, size to 15 %."""
    case = TrackCase(replace(measured_campaign(replace(PLAN, turnout=FILED), (), 7), turnout=FILED))
    fit = fit_jointly(case, iterations=6)
    o, before = next((o, p) for o, p in zip(case.observations, fit.predictions) if o.name in case.rollings)
    made = case.rollings[o.name]
    modes = profile_modes(case, {**fit.values, "surface_0_depth": 0.0}, made, Carrier(case, fit.values, made))
    assert modes.shape == (o.data.size, 4 * len(made.passage.vehicle.wheels))
    change = case.predict(fit.values, (OneWheel(),), [o])[0] - before
    found = modes[:, 4]
    assert found @ change / np.sqrt((found @ found) * (change @ change)) > 0.95
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(change), rel=0.15)
