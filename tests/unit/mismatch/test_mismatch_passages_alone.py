"""A fault of one channel in the passages alone: another logger records them. It is no fault of all recordings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.turnout.case import TrackCase
from turnout.mismatch.turnout.common_delay import earlier
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

FAMILIES = ("sensor_gain", "time_offset", "clock_drift", "passage_delay", "passage_gain")
LAG, GAIN, DRIFT = 1.5e-3, 1.4, 1e-3


def lag(samples, rate):
    return earlier(samples, -LAG * rate)


def gain(samples, rate):
    return GAIN * samples


def drift(samples, rate):
    """Samples at t (1 + drift), as the clock drift is defined."""
    at = np.arange(samples.size)
    return CubicSpline(at, samples)(np.minimum(at * (1.0 + DRIFT), at[-1]))


@pytest.fixture(scope="module")
def campaign():
    return measured_campaign(small_plan((15.0,), (28.0,), hammer_positions=(24.0,)), (), 3)


def changed(campaign, change, types):
    """The campaign with change(samples, rate) in place of what channel S3 recorded in recordings of these types."""

    def of_recording(recording):
        samples = recording.samples.copy()
        row = recording.index("S3")
        samples[row] = change(samples[row], recording.rate)
        return replace(recording, samples=samples)

    for recording_type in types:
        campaign = campaign.with_recordings(recording_type, of_recording)
    return campaign


@pytest.mark.parametrize(
    ("change", "types", "name", "value"),
    [
        (lag, ("passages",), "passage_delay", LAG),
        (lag, ("passages", "hammer tests"), "time_offset", LAG),
        (gain, ("passages",), "passage_gain", GAIN),
        (drift, ("passages",), "clock_drift", DRIFT),
    ],
)
def test_a_fault_in_the_passages_alone_has_a_name_of_its_own(campaign, change, types, name, value):
    case = TrackCase(changed(campaign, change, types), MismatchSettings(), families=FAMILIES)
    diagnosis = diagnose(case)
    assert diagnosis.names == (name,)
    (term,) = diagnosis.fit.terms
    size = term.parameters[0].name
    assert term.channel_name == "S3" and getattr(term, size) == pytest.approx(value, rel=0.25)


def test_without_a_fault_there_is_no_name(campaign):
    assert diagnose(TrackCase(campaign, MismatchSettings(), families=FAMILIES)).names == ()
