"""A case in a switch panel is not proven, and its fits reuse derivatives; a case on plain track is proven."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.unproven_panels import UNPROVEN_SWITCH
from turnout.simulate.blade import Blade
from turnout.simulate.wheel_path import BladeTop, StockFall


@pytest.fixture(scope="module")
def campaign():
    return measured_campaign(small_plan((15.0,), (28.0,), hammer_positions=(24.0,)), (), 3)


def test_a_case_on_plain_track_is_proven(campaign):
    case = TrackCase(campaign)
    assert case.reservation == "" and not case.reuses_derivatives and case.max_simulations is None


@pytest.mark.parametrize("is_crossed", [True, False])
def test_a_case_with_a_blade_is_not_proven_also_if_no_wheel_changes_to_it(campaign, is_crossed):
    track = campaign.turnout.track
    surfaces = ((StockFall(21.6, 3.0, 0.02),), (BladeTop(20.1, 3.0, 0.015),))
    turnout = replace(campaign.turnout, track=track.with_(blade=Blade(20.1, 27.0, 32.0, track.rail, 3e8, 3e4)))
    if is_crossed:
        turnout = replace(turnout, routes={"main": surfaces})
    case = TrackCase(replace(campaign, turnout=turnout))
    assert case.reservation == UNPROVEN_SWITCH
    assert case.reuses_derivatives is is_crossed
    assert case.max_simulations == (SIMULATION.max_in_switch if is_crossed else None)
    before, passage = case.n_simulations, next(o for o in case.observations if o.name in case.aligned_passages)
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    case.predict({**values, "ballast_stiffness": 0.01}, (), [passage])
    assert case.n_simulations == before + 1
    (base,) = case.predict(values, (), [passage])
    (jacobian,) = case.nuisance_jacobian(values, (), [passage], [base])
    column = [n.name for n in case.nuisances].index("chair_stiffness")
    step = SIMULATION.log_step * (SIMULATION.switch_step_factor if is_crossed else 1.0)
    (stiffer,) = case.predict({**values, "chair_stiffness": values["chair_stiffness"] + step}, (), [passage])
    assert np.linalg.norm(stiffer - base) > 0.0
    assert jacobian[:, column] == pytest.approx((stiffer - base) / step, rel=1e-6, abs=1e-9)
