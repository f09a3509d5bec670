"""A delay of all accelerations of hammer tests is corrected and stated; that of one sensor or of the track is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.case_data import case_data
from turnout.mismatch.turnout.common_delay import earlier
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

LAG = 0.6e-3  # s


@pytest.fixture(scope="module")
def campaign():
    plan = small_plan((15.0,), passages=False, hammer_positions=(21.6, 24.0))
    return measured_campaign(replace(plan, n_impacts=3), (), 3)


def changed(campaign, change, names=None):
    """The campaign with change(samples, rate) in place of the accelerations of hammer tests, of ``names`` alone."""

    def of_recording(recording):
        samples = recording.samples.copy()
        for row in recording.of_quantity("acceleration"):
            if names is None or recording.channels[row].name in names:
                samples[row] = change(samples[row], recording.rate)
        return replace(recording, samples=samples)

    return campaign.with_recordings("hammer tests", of_recording)


def lines_of(data):
    """Name -> {frequency: receptance} of the hammer tests."""
    halves = {o.name: o.data.reshape(2, -1) for o in data.observations}
    return {
        name: dict(zip(data.frf_pairs[name].frequency, (real + 1j * imaginary) * data.frf_pairs[name].size))
        for name, (real, imaginary) in halves.items()
    }


def faults_of(campaign):
    return case_data(campaign, MismatchSettings(), Track1D())[0].layout_faults


@pytest.mark.parametrize("n", [0.5, 3.0, -2.25])
def test_a_sine_is_moved_by_parts_of_a_sample(n):
    """Far from the ends, where the signal is continued by a constant."""
    at = np.arange(600.0)
    moved = earlier(np.sin(0.3 * at) * np.hanning(600), n)
    np.testing.assert_allclose(moved, np.sin(0.3 * (at + n)) * np.interp(at + n, at, np.hanning(600)), atol=1e-4)


@pytest.mark.parametrize("lag", [LAG, -LAG])
def test_a_common_delay_is_corrected_and_stated(campaign, lag):
    right, _ = case_data(campaign, MismatchSettings(), Track1D())
    assert right.layout_faults == ()
    data, _ = case_data(changed(campaign, lambda x, rate: earlier(x, -lag * rate)), MismatchSettings(), Track1D())
    (fault,) = data.layout_faults
    assert fault.lag == pytest.approx(lag, abs=1e-4)  # the track differs from its file
    (sentence,) = fault.sentences()
    assert ("lag behind the force" if lag > 0 else "lead the force") in sentence and "0.6" in sentence
    right_lines, lines = lines_of(right), lines_of(data)
    assert len(lines) == len(right_lines) > 4
    for name, expected in right_lines.items():
        pairs = np.array([(expected[f], lines[name][f]) for f in expected.keys() & lines[name].keys()])
        phase = np.angle(pairs[:, 1] / pairs[:, 0])
        # what is left of the delay turns the phase by 2 pi f times 0.1 ms: by half a radian at the highest line
        assert len(pairs) >= 20 and np.quantile(np.abs(phase), 0.9) < 0.6


def test_a_filter_of_all_accelerations_is_a_delay(campaign):
    def low_pass(x, rate):
        return signal.sosfilt(signal.butter(4, 1000.0, fs=rate, output="sos"), x)

    (fault,) = faults_of(changed(campaign, low_pass))
    # group delay of a Butterworth filter of fourth order at low frequencies: 2.61 over its angular frequency
    assert fault.lag == pytest.approx(2.61 / (2 * np.pi * 1000.0), abs=1.5e-4)


def test_the_delay_of_one_channel_is_no_common_one(campaign):
    names = {campaign.sensors[1].name}
    assert faults_of(changed(campaign, lambda x, rate: earlier(x, -LAG * rate), names)) == ()


def test_a_delay_below_the_limit_stays(campaign):
    assert faults_of(changed(campaign, lambda x, rate: earlier(x, -1e-4 * rate))) == ()
