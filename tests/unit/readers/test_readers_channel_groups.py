"""Structures of MATLAB and groups of HDF5 that hold one channel each."""

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
FORCE, RAIL = 3.0 * np.sin(np.arange(400) / 7), 5.0 * np.cos(np.arange(400) / 3) + 0.5
LAYOUT = RawDescription((RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")), rate=RATE)


def write_group(group, content):
    for name, value in content.items():
        if isinstance(value, dict):
            write_group(group.create_group(name), value)
        elif isinstance(value, np.ndarray):
            group[name] = value
        else:
            group.attrs[name] = value


def written(path, content):
    """The file of nested content, in the format of its extension."""
    if path.suffix == ".mat":
        scipy.io.savemat(path, content)
    else:
        with h5py.File(path, "w") as file:
            write_group(file, content)
    return path


def channel(samples, unit, **facts):
    return {"data": samples, "unit": unit, "fs": RATE, **facts}


@pytest.fixture(params=["a.mat", "a.h5"])
def outcome(request, tmp_path):
    """Function: result of nested content that was written and read."""
    return lambda content: read(written(tmp_path / request.param, content).name, tmp_path, LAYOUT)


ONE = {"force": channel(FORCE, "kN"), "rail": channel(RAIL, "g")}
SAME = {
    "by group": ONE,
    "below others": {"test": {"measurement": ONE}},
    "by name": {"ch1": channel(FORCE, "kN", name="force"), "ch2": channel(RAIL, "g", name="rail")},
    "with times": {name: {**c, "time": np.arange(400) / RATE} for name, c in ONE.items()},
    "as columns": {name: {**c, "data": c["data"][:, None]} for name, c in ONE.items()},
    "as values": {name: {"Values": c["data"], "Units": c["unit"], "fs": RATE} for name, c in ONE.items()},
}


@pytest.mark.parametrize("case", SAME)
def test_groups_of_one_vector_each_are_the_channels_of_one_record(outcome, case):
    result = outcome(SAME[case])
    assert result.errors == ()
    (recording,) = result.recordings
    np.testing.assert_allclose(recording.signal("force"), FORCE * 1e3, rtol=1e-12)
    np.testing.assert_allclose(recording.signal("rail"), RAIL * 9.80665, rtol=1e-12)
    assert recording.rate == RATE


WRONG = {
    "rate": ({**ONE, "rail": channel(RAIL, "g") | {"fs": 10000.0}}, "two rates"),
    "scale": ({**ONE, "rail": channel(RAIL, "g", slope=0.5)}, "channel 'rail': the file states slope = 0.5"),
    "length": ({**ONE, "rail": channel(RAIL[:-1], "g")}, "channel 'rail' ends after 399 samples"),
    "unit": ({**ONE, "rail": channel(RAIL, "mm/s")}, "'mm/s' is no unit of acceleration"),
    "time": (
        {name: {**c, "time": (np.arange(400) + 40 * (name == "rail")) / RATE} for name, c in ONE.items()},
        "there is no channel 'force'",
    ),
    "records": ({"run_1": {"force": FORCE, "fs": RATE}, "run_2": {"force": FORCE, "fs": RATE}}, "no channel 'rail'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_a_group_states_about_its_channel_is_not_lost(outcome, case):
    content, words = WRONG[case]
    result = outcome(content)
    assert result.recordings == () and words in str(result.errors[0])


def with_headers(ends, facts):
    """Variables of two channels as catman exports them: a structure and a vector of the same name each."""
    signals = {"force": (np.sin(np.arange(400) / 9), "kN"), "rail": (np.cos(np.arange(400) / 7), "g")}
    variables = {"File_Header": {"SampleFrequency": "1000", "NumberOfChannels": "2"}}
    for k, (name, (samples, unit)) in enumerate(signals.items(), 1):
        variables[f"Channel_{k}_{ends[0]}"] = {key: {"name": name, "unit": unit}[what] for key, what in facts.items()}
        variables[f"Channel_{k}_{ends[1]}" if ends[1] else f"Channel_{k}"] = samples
    return variables, signals


@pytest.mark.parametrize("facts", [{"SignalName": "name", "Unit": "unit"}, {"Name": "name", "Units": "unit"}])
@pytest.mark.parametrize("ends", [("Header", "Data"), ("Info", "Values"), ("header", "")])
@pytest.mark.parametrize("is_swapped", [False, True])
def test_a_vector_has_the_name_and_the_unit_of_the_structure_beside_it(ends, facts, is_swapped, tmp_path):
    variables, signals = with_headers(ends, facts)
    if is_swapped:
        variables = dict(reversed(variables.items()))
    scipy.io.savemat(tmp_path / "a.mat", variables)
    channels = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
    (recording,) = read("a.mat", tmp_path, RawDescription(channels, rate=1000.0)).recordings
    np.testing.assert_allclose(recording.signal("force"), signals["force"][0] * 1000.0)
    np.testing.assert_allclose(recording.signal("rail"), signals["rail"][0] * 9.80665)


def test_the_unit_of_a_structure_beside_a_vector_contradicts_the_layout(tmp_path):
    variables, _ = with_headers(("Header", "Data"), {"Unit": "unit"})
    scipy.io.savemat(tmp_path / "a.mat", variables)
    channels = (
        RawChannel("force", "Channel_2_Data", "force", unit="N"),
        RawChannel("rail", "Channel_1_Data", "acceleration", unit="m/s²"),
    )
    (error,) = read("a.mat", tmp_path, RawDescription(channels, rate=1000.0)).errors
    assert error.reason == "unit_unknown" and "the file says 'g', the layout 'N'" in str(error)


def test_groups_without_a_vector_are_named_with_what_they_hold(tmp_path):
    signal = {"clock": {"increment": 0.001}, "trace": {"values": np.arange(400.0)}}
    scipy.io.savemat(tmp_path / "a.mat", {"force": signal, "rail": signal})
    error, *_ = read("a.mat", tmp_path, RawDescription((RawChannel("f", "force", "force", "N"),), rate=1000.0)).errors
    assert "group 'force': it holds no vector of samples; in it are 'clock', 'trace'. Save each" in str(error)
