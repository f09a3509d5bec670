"""Unit and quantity of the abscissa of waveforms in TDMS files."""

import nptdms
import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N = 25600.0, 400
SAMPLES = np.random.default_rng(13).normal(size=(2, N)) * [[900.0], [30.0]]
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)


def outcome(folder, first, second=None, rate=None):
    """Rates of the recordings, and the message of each error."""
    with nptdms.TdmsWriter(str(folder / "a.tdms")) as writer:
        properties = first, first if second is None else second
        channels = zip(("force", "rail"), SAMPLES, properties)
        writer.write_segment([nptdms.ChannelObject("g", *channel) for channel in channels])
    result = read("a.tdms", folder, RawDescription(SENSORS, rate=rate))
    return [r.rate for r in result.recordings], [str(e) for e in result.errors]


@pytest.mark.parametrize(
    ("scale", "unit"),
    [(1.0, "s"), (1.0, ""), (1.0, "Sec"), (1e3, "ms"), (1e3, "milisekundy"), (1e6, "µs"), (1e9, "ns"), (1 / 60, "min")],
)
def test_the_unit_of_the_abscissa_scales_the_step(scale, unit, tmp_path):
    waveform = {"wf_increment": scale / RATE, "wf_xunit_string": unit, "wf_xname": "Time"}
    rates, errors = outcome(tmp_path, waveform)
    assert rates == pytest.approx([RATE], rel=1e-9) and not errors
    assert outcome(tmp_path, waveform, rate=RATE)[0] == [RATE]
    rates, errors = outcome(tmp_path, waveform, rate=20000.0)
    assert not rates and "instead of 20000 Hz" in errors[0]


def test_steps_in_two_units_are_compared_in_seconds(tmp_path):
    in_seconds = {"wf_increment": 1 / RATE, "wf_xunit_string": "s"}
    in_ms = {"wf_increment": 1e3 / RATE, "wf_xunit_string": "ms"}
    assert outcome(tmp_path, in_seconds, in_ms, RATE) == ([RATE], [])
    rates, errors = outcome(tmp_path, in_ms, {**in_ms, "wf_start_offset": 1.0}, RATE)
    assert not rates and errors


@pytest.mark.parametrize(
    ("name", "unit"), [("Frequency", "Hz"), ("", "Hz"), ("Frequenz", ""), ("Weg", "m"), ("qwxz", "rpm"), ("", "kHz")]
)
def test_samples_over_another_quantity_than_time_are_rejected(name, unit, tmp_path):
    rates, errors = outcome(tmp_path, {"wf_increment": 10.0, "wf_xname": name, "wf_xunit_string": unit}, rate=100.0)
    assert not rates and "and not over the time" in errors[0]


def test_a_step_in_an_unknown_unit_that_is_none_in_seconds_is_rejected(tmp_path):
    for rate in (RATE, None):
        rates, errors = outcome(tmp_path, {"wf_increment": 1e3 / RATE, "wf_xunit_string": "qwxz"}, rate=rate)
        assert not rates and "the unit 'qwxz' of its step is not known" in errors[0]


UNKNOWN_UNITS = ("Time", "t", "Zeit", "relative", "s (rel)", "UTC", "HH:MM:SS", "qwxz")


@pytest.mark.parametrize("unit", UNKNOWN_UNITS)
@pytest.mark.parametrize("name", ["Time", "", "qwxz"])
def test_a_step_in_an_unknown_unit_that_has_the_rate_of_the_layout_in_seconds_is_one(unit, name, tmp_path):
    waveform = {"wf_increment": 1 / RATE, "wf_xunit_string": unit, "wf_xname": name}
    assert outcome(tmp_path, waveform, rate=RATE) == ([RATE], [])
    assert outcome(tmp_path, waveform | {"Sampling rate": "25600 Hz"}) == ([RATE], [])
    for rate in (20000.0, 25.6):
        rates, errors = outcome(tmp_path, waveform, rate=rate)
        assert not rates and "its step is not known" in errors[0]
    rates, errors = outcome(tmp_path, waveform)
    assert not rates and "nothing else states the rate" in errors[0]


@pytest.mark.parametrize("name", ["Frequenz", "Frequency response time", "Frekvens"])
def test_a_known_unit_of_time_counts_more_than_the_name_of_the_axis(name, tmp_path):
    waveform = {"wf_increment": 1 / RATE, "wf_xunit_string": "s", "wf_xname": name}
    assert outcome(tmp_path, waveform, rate=RATE) == ([RATE], [])


@pytest.mark.parametrize(("unit", "step"), [("Hz", 25.0), ("m", 0.01), ("rpm", 10.0)])
def test_only_channels_in_use_are_sampled_over_the_time(unit, step, tmp_path):
    other = {"wf_increment": step, "wf_xunit_string": unit, "wf_xname": "qwxz"}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        channels = [("force", SAMPLES[0], {"wf_increment": 1 / RATE}), ("rail", SAMPLES[1], {"wf_increment": 1 / RATE})]
        channels.append(("psd", np.abs(SAMPLES[1]), other))
        writer.write_segment([nptdms.ChannelObject("g", *channel) for channel in channels])
    for quantity, n_record in (("ignored", 1), ("acceleration", 0)):
        unit = None if quantity == "ignored" else "m/s²"
        description = RawDescription((*SENSORS, RawChannel("psd", "psd", quantity, unit=unit)), rate=RATE)
        result = read("a.tdms", tmp_path, description)
        assert len(result.recordings) == n_record and len(result.errors) == 1 - n_record
        assert n_record or "and not over the time" in str(result.errors[0])


GROUPS = ("Accel", "Hammer", "Spare")


@pytest.mark.parametrize(
    ("starts", "are_one"),
    [
        *[((0.0, 2e-5, None), True), ((None, 0.0, None), True), ((0.0, None, 2e-5), True)],
        *[((0.0, None, 3e-5), False), ((None, 0.0, 1e-3), False), ((0.0, 0.0, -1.0), False)],
    ],
)
def test_groups_of_tasks_may_start_half_a_sample_apart_or_state_no_start(starts, are_one, tmp_path):
    """Each task of one trigger has a time stamp of its own, or none."""
    origin = np.datetime64("2026-05-13T08:00:00", "us")
    samples = dict(zip(("rail", "force", "spare"), np.random.default_rng(3).normal(size=(3, 200))))
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        for group, start, (name, values) in zip(GROUPS, starts, samples.items()):
            stamp = {} if start is None else {"wf_start_time": origin + np.timedelta64(round(1e6 * start), "us")}
            file.write_segment([nptdms.ChannelObject(group, name, values, {"wf_increment": 5e-5, **stamp})])
    sensors = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
    description = RawDescription((*sensors, RawChannel("spare", "spare", "ignored")), rate=20000.0)
    if not are_one:
        with pytest.raises(ReadError, match="their time axes differ"):
            read("a.tdms", tmp_path, description)
        return
    (recording,) = read("a.tdms", tmp_path, description).recordings
    np.testing.assert_array_equal(recording.signal("rail"), samples["rail"])
    assert abs((recording.started_at - origin.item()).total_seconds()) < 1e-3
