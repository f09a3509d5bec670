"""A hammer test that deviates on all its channels is not used; a defect changes some channels, or one in all tests."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.case_data import case_data
from turnout.mismatch.turnout.channel_identity import Comparison
from turnout.mismatch.turnout.deviating_tests import deviating_tests
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

NAMES = ("S1", "S2", "S3", "S4")


def compared(ratios):
    names = ("A1", "A2", "A3")
    return [Comparison(names, names, np.zeros((3, 3, 1)), np.array(r)) for r in ratios]


USUAL = [[0.9, 1.1, 1.3], [1.2, 0.9, 1.0], [1.0, 1.0, 0.7]]


@pytest.mark.parametrize("factor", [0.1, 0.25, 4.0, 1000.0])
def test_the_test_that_differs_on_all_channels_is_found_with_its_factor(factor):
    found = deviating_tests(NAMES, compared([*USUAL, [0.9 * factor, factor, 1.1 * factor]]))
    assert set(found.ratios) == {"S4"} and found.n == 3
    assert found.ratios["S4"] == pytest.approx(factor, rel=0.1)


@pytest.mark.parametrize(
    "last",
    [
        [0.1, 1.0, 1.0],  # one sensor
        [0.1, 10.0, 0.1],  # exchanged files: some larger, some smaller
        [0.5, 0.4, 0.6],  # cold pads
        [1.8, 2.5, 2.4],  # warm pads, the largest of eight sealed cases
    ],
)
def test_other_faults_and_defects_are_none(last):
    assert not deviating_tests(NAMES, compared([*USUAL, last]))


def test_a_scale_common_to_all_tests_is_none():
    assert not deviating_tests(NAMES, compared(0.1 * np.array([*USUAL, USUAL[0]])))


def test_two_tests_against_two_are_none():
    """Nobody knows which of them are right."""
    tenth = 0.1 * np.array(USUAL[:2])
    assert not deviating_tests(NAMES, compared([*USUAL[:2], *tenth]))
    assert not deviating_tests(NAMES[:2], compared([USUAL[0], tenth[0]]))


def test_a_case_leaves_out_the_test_and_states_it():
    plan = small_plan((5.0, 25.0), passages=False, hammer_positions=(21.6, 24.0))
    campaign = measured_campaign(replace(plan, n_impacts=3, sensors=plan.sensors[:3]))
    assert len(campaign.hammer) == 4
    right, _ = case_data(campaign, MismatchSettings(), Track1D())
    assert right.layout_faults == ()
    first, *others = campaign.hammer

    def at_a_tenth(recording):
        is_response = np.array([c.quantity == "acceleration" for c in recording.channels])
        return replace(recording, samples=recording.samples * np.where(is_response, 0.1, 1.0)[:, None])

    spoilt = replace(first, recordings=tuple(map(at_a_tenth, first.recordings)))
    data, _ = case_data(replace(campaign, hammer=(spoilt, *others)), MismatchSettings(), Track1D())
    (fault,) = data.layout_faults
    (sentence,) = fault.sentences()
    assert set(fault.ratios) == {first.name} and first.name in sentence and "0.099 times" in sentence
    assert first.name not in {p.test.name for p in data.frf_pairs.values()}
    unchanged = {o.name for o in right.observations if not o.name.startswith(f"{first.name}:")}
    assert {o.name for o in data.observations} == unchanged
