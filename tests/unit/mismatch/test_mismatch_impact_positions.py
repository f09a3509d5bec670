"""Impacts beside their stated position: every channel agrees better there, also those on the other side."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.case_data import case_data
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

POSITION = 25.2  # m, with two sensors on either side


@pytest.fixture(scope="module")
def campaign():
    plan = small_plan((15.0,), passages=False, hammer_positions=(POSITION, 27.6))
    return measured_campaign(replace(plan, n_impacts=3))


def faults_of(campaign, first, sensors=None):
    """Faults of a campaign whose first test is stated to be at ``first``."""
    tests = (replace(campaign.hammer[0], place=first), *campaign.hammer[1:])
    data, _ = case_data(
        replace(campaign, hammer=tests, sensors=sensors or campaign.sensors), MismatchSettings(), Track1D()
    )
    return data.layout_faults


def test_the_sensors_lie_on_both_sides(campaign):
    sides = np.sign([s.place - POSITION for s in campaign.sensors if abs(s.place - POSITION) >= 0.5])
    assert {-1.0, 1.0} <= set(sides)


@pytest.mark.parametrize("beside", [0.2, -0.2, 0.3])
def test_impacts_beside_their_position_are_taken_where_they_were_made(campaign, beside):
    (fault,) = faults_of(campaign, POSITION + beside)
    stated, agreeing = fault.positions[campaign.hammer[0].name]
    assert stated == POSITION + beside and agreeing == pytest.approx(POSITION, abs=0.05)
    (sentence,) = fault.sentences()
    assert campaign.hammer[0].name in sentence and f"at {stated:.2f} m, as stated" in sentence


@pytest.mark.parametrize("beside", [0.0, 0.05])
def test_impacts_at_their_mark_stay_there(campaign, beside):
    assert faults_of(campaign, POSITION + beside) == ()


def test_a_sensor_elsewhere_moves_no_impact(campaign):
    first, *others = campaign.sensors
    assert faults_of(campaign, POSITION, (replace(first, place=first.place + 0.2), *others)) == ()
