"""A recorded hammer test of five impacts whose authors state the bad ones: 0 is overloaded, 2 is double.

pyFRF 1.1.4, data/impact2_response0.lvm (MIT): LabVIEW text, five segments of 1 s at 51.2 kHz.
"""

import numpy as np
import pytest

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts, receptance_of
from turnout.records import Channel, Recording

BAD = {0: "overload", 2: "double_hit"}


@pytest.fixture(scope="module")
def recordings(shared_data):
    lvm_read = pytest.importorskip("lvm_read")
    path = shared_data / "hammer_pyfrf" / "impact2_response0.lvm"
    segments = lvm_read.read(str(path), read_from_pickle=False, dump_file=False)
    channels = Channel("hammer", "force"), Channel("beam", "acceleration")  # neither range nor resolution is known
    return [Recording(segments[k]["data"][:, :2].T, 51_200.0, channels, record=k) for k in range(5)]


def findings(impacts):
    return {i.record: {r.reason for r in (*i.rejections, *i.notes)} for i in impacts}


def test_the_two_bad_impacts_are_reported_and_no_other(recordings):
    found = findings(find_impacts(recordings, "hammer", "beam"))
    assert {k: v for k, v in found.items() if v} == {0: {"overload"}, 2: {"double_hit"}}


def test_the_second_impact_has_the_measured_time_and_size(recordings):
    finding = next(
        r for i in find_impacts(recordings, "hammer", "beam") for r in (*i.rejections, *i.notes) if i.record == 2
    )
    # 0.204 of the peak in the raw samples at 22.8 ms; smoothing lifts the wider pulse by less than a tenth.
    assert finding.value == pytest.approx(0.204, rel=0.1) and "+22.8 ms" in finding.detail


@pytest.mark.parametrize("bad", BAD)
def test_each_bad_impact_is_reported_also_without_the_other(recordings, bad):
    rest = [r for r in recordings if r.record not in BAD or r.record == bad]
    assert {k for k, v in findings(find_impacts(rest, "hammer", "beam")).items() if v} == {bad}


def test_impact_0_alone_is_reported_by_its_repeated_code(recordings):
    (alone,) = find_impacts(recordings[:1], "hammer", "beam")
    assert alone.rejections[0].reason == "overload" and "repeats its highest code 2000" in alone.rejections[0].detail


def test_the_coherence_is_that_of_the_good_impacts(recordings):
    # Published with the recording: median over 20-500 Hz 0.598 of all five impacts, 0.998 without impact 0.
    impacts = find_impacts(recordings, "hammer", "beam")
    result = receptance_of(impacts)
    band = (result.frequency >= 20) & (result.frequency <= 500)
    assert np.median(result.coherence[band]) == pytest.approx(0.998, abs=0.001) and result.n == 3
    assert not result.passed[
        band
    ].all()  # three averages give wide limits at frequencies at which the beam hardly moves


def test_a_setting_decides_whether_the_double_impact_is_used(recordings):
    kept = find_impacts(recordings, "hammer", "beam", ReceptanceSettings(double_hit_remaining=0.3))
    assert kept[2].accepted and kept[2].notes[0].reason == "double_hit"
    assert kept[2].decay_start > kept[2].contact_end > kept[2].onset + 0.0228 * 51_200
