"""A common wrong scale of all channels: a unit or a sensitivity, and no effect of track, train or one sensor."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.constants import STANDARD_GRAVITY
from turnout.mismatch.turnout.amplitude_scale import wrong_scale
from turnout.mismatch.turnout.case_data import case_data
from turnout.mismatch.turnout.channel_identity import Comparison
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

NAMES = ("A1", "A2", "A3")


def comparison(*ratios, agreement=0.9):
    correlations = np.where(np.eye(3), agreement, 0.1)[:, :, None]
    return Comparison(NAMES, NAMES, correlations, np.array(ratios))


@pytest.mark.parametrize(
    ("recordings", "ratio", "divisor"),
    [
        ("passages", 0.11, 1.0 / STANDARD_GRAVITY),
        ("passages", 9.0, STANDARD_GRAVITY),
        ("hammer tests", 0.0013, 0.001),
        ("hammer tests", 800.0, 1000.0),
        ("passages", 0.4, 0.4),  # no two units: the ratio itself
        ("passages", 1.4, 1.4),
        ("passages", 1.25, None),
        ("passages", 0.8, None),
        ("hammer tests", 1.5, None),
        ("hammer tests", 0.4, 0.4),
        ("hammer tests", 5.3, 5.3),  # far from 1 and from 9.81
    ],
)
def test_a_common_factor_is_that_of_two_units_or_itself(recordings, ratio, divisor):
    found = wrong_scale(recordings, [comparison(0.95 * ratio, ratio, 1.04 * ratio)] * 4)
    assert bool(found) is (divisor is not None)
    if found:
        assert found.divisor == pytest.approx(divisor) and found.n == 4
        assert ("ratio of" in found.sentences()[0]) is (ratio != divisor)


@pytest.mark.parametrize(
    "comparisons",
    [
        [],
        [comparison(0.1, 0.1, 1.0)] * 4,  # two sensors
        [comparison(0.1, 0.02, 0.5)] * 4,  # different factors
        [comparison(0.5, 0.5, 0.5), comparison(1.0, 1.0, 1.0)] * 2,  # one type of train
        [comparison(0.1, 0.1, 0.1, agreement=0.3)] * 4,  # recordings of something else
        [Comparison(("A1",), ("A1",), np.full((1, 1, 1), 0.9), np.array([0.1]))] * 4,  # one channel: its gain
    ],
)
def test_a_factor_of_some_recordings_or_channels_is_no_common_scale(comparisons):
    assert not wrong_scale("passages", comparisons)


@pytest.fixture(scope="module")
def campaign():
    return measured_campaign(small_plan((15.0, 25.0), hammer_positions=(21.6, 24.0)), (), 3)


def scaled(recording, factor):
    factors = [factor if c.quantity == "acceleration" else 1.0 for c in recording.channels]
    return replace(recording, samples=recording.samples * np.array(factors)[:, None])


def test_passages_in_g_are_observed_as_those_in_metres_per_second_squared(campaign):
    right, _ = case_data(campaign, MismatchSettings(), Track1D())
    passages = tuple(replace(p, recording=scaled(p.recording, 1.0 / STANDARD_GRAVITY)) for p in campaign.passages)
    data, _ = case_data(replace(campaign, passages=passages), MismatchSettings(), Track1D())
    assert right.layout_faults == ()
    (fault,) = data.layout_faults
    assert fault.recording_type == "amplitudes of passages"
    assert fault.ratio == pytest.approx(1.0 / STANDARD_GRAVITY, rel=0.1)
    by_name = {o.name: o.data for o in right.observations}
    for o in data.observations:
        np.testing.assert_allclose(o.data, by_name[o.name], rtol=1e-6, atol=1e-9 * np.max(np.abs(o.data)))


def test_hammer_tests_in_another_unit_are_observed_as_those_in_the_right_one(campaign):
    right, _ = case_data(campaign, MismatchSettings(), Track1D())
    tests = tuple(
        replace(t, recordings=tuple(scaled(r, STANDARD_GRAVITY) for r in t.recordings)) for t in campaign.hammer
    )
    data, _ = case_data(replace(campaign, hammer=tests), MismatchSettings(), Track1D())
    (fault,) = data.layout_faults
    assert fault.recording_type == "amplitudes of hammer tests" and fault.cause == "m/s² and g"
    assert "accelerations over forces of all" in fault.sentences()[0]
    by_name = {o.name: o.data for o in right.observations}
    for o in data.observations:
        np.testing.assert_allclose(o.data, by_name[o.name], rtol=1e-6, atol=1e-9 * np.max(np.abs(o.data)))
