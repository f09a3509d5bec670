"""A fault of one channel in the passages or the hammer tests alone: another logger records them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.turnout.case import TrackCase
from turnout.mismatch.turnout.common_delay import earlier
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.receptance_observation import channel_factor
from turnout.mismatch.turnout.wave_response import channel_responses
from turnout.physics import HammerDelay, HammerGain, PassageDelay, PassageGain, SensorGain, TimeOffset
from turnout.simulate import Sensor, car, simulate_passage, uniform_track

FAMILIES = (
    "sensor_gain", "time_offset", "clock_drift", "passage_delay", "passage_gain", "hammer_delay", "hammer_gain",
)  # fmt: skip
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
        (gain, ("hammer tests",), "hammer_gain", GAIN),
        (drift, ("passages",), "clock_drift", DRIFT),
    ],
)
def test_a_fault_in_one_type_of_recordings_has_a_name_of_its_own(campaign, change, types, name, value):
    case = TrackCase(changed(campaign, change, types), MismatchSettings(), families=FAMILIES)
    diagnosis = diagnose(case)
    assert diagnosis.names == (name,)
    (term,) = diagnosis.fit.terms
    size = term.parameters[0].name
    assert term.channel_name == "S3" and getattr(term, size) == pytest.approx(value, rel=0.25)


@pytest.mark.parametrize(
    ("term", "in_tests", "in_passages"),
    [
        (SensorGain("S3", 3.0), 3.0, 3.0),
        (PassageGain("S3", 3.0), 1.0, 3.0),
        (HammerGain("S3", 3.0), 3.0, 1.0),
        (TimeOffset("S3", 2e-3), -1j, -1j),  # a quarter period at 125 Hz
        (PassageDelay("S3", 2e-3), 1.0, -1j),
        (HammerDelay("S3", 2e-3), -1j, 1.0),
    ],
)
def test_a_spectrum_has_the_faults_of_its_type_of_recording(campaign, term, in_tests, in_passages):
    sensors = tuple(campaign.sensors_of(campaign.passages[0]))
    frequency, values = np.array([125.0]), {f"gain_{s.name}": 0.0 for s in sensors}
    expected = [in_passages if s.name == "S3" else 1.0 for s in sensors]
    found = channel_responses(values, (term,), SimpleNamespace(sensors=sensors), frequency)[0]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    (sensor,) = (s for s in sensors if s.name == "S3")
    np.testing.assert_allclose(channel_factor((term,), sensor, frequency, "hammer"), [in_tests], atol=1e-12)


def test_a_simulated_passage_has_no_fault_of_the_hammer_tests():
    bare, of_tests, of_all = (
        simulate_passage(
            uniform_track(30.0), car("car"), 30.0, [Sensor("S3", 15.0)], terms=terms, roughness=None, seed=1
        ).samples
        for terms in ((), (HammerGain("S3", 3.0),), (SensorGain("S3", 3.0),))
    )
    assert np.array_equal(of_tests, bare) and not np.array_equal(of_all, bare)


def test_without_a_fault_there_is_no_name(campaign):
    assert diagnose(TrackCase(campaign, MismatchSettings(), families=FAMILIES)).names == ()
