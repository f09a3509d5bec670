"""Structures of MATLAB and groups of HDF5 with one channel each."""

from dataclasses import replace

import h5py
import nptdms
import numpy as np
import pytest
import scipy.io

from turnout.errors import ReadError
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


def write_file(path, content):
    """Write nested content in the format of the extension; return the path."""
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
    """Function that writes nested content and returns the result of reading it."""
    return lambda content: read(write_file(tmp_path / request.param, content).name, tmp_path, LAYOUT)


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
def test_statements_of_a_group_about_its_channel_are_checked(outcome, case):
    content, words = WRONG[case]
    result = outcome(content)
    assert result.recordings == () and words in str(result.errors[0])


def with_headers(ends, facts):
    """Variables of two channels as catman exports them: for each a structure and a vector of the same name."""
    signals = {"force": (np.sin(np.arange(400) / 9), "kN"), "rail": (np.cos(np.arange(400) / 7), "g")}
    variables = {"File_Header": {"SampleFrequency": "1000", "NumberOfChannels": "2"}}
    for k, (name, (samples, unit)) in enumerate(signals.items(), 1):
        variables[f"Channel_{k}_{ends[0]}"] = {key: {"name": name, "unit": unit}[what] for key, what in facts.items()}
        variables[f"Channel_{k}_{ends[1]}" if ends[1] else f"Channel_{k}"] = samples
    return variables, signals


@pytest.mark.parametrize("facts", [{"SignalName": "name", "Unit": "unit"}, {"Name": "name", "Units": "unit"}])
@pytest.mark.parametrize("ends", [("Header", "Data"), ("Info", "Values"), ("header", "")])
@pytest.mark.parametrize("is_swapped", [False, True])
def test_a_vector_gets_the_name_and_the_unit_of_its_header_structure(ends, facts, is_swapped, tmp_path):
    variables, signals = with_headers(ends, facts)
    if is_swapped:
        variables = dict(reversed(variables.items()))
    scipy.io.savemat(tmp_path / "a.mat", variables)
    channels = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
    (recording,) = read("a.mat", tmp_path, RawDescription(channels, rate=1000.0)).recordings
    np.testing.assert_allclose(recording.signal("force"), signals["force"][0] * 1000.0)
    np.testing.assert_allclose(recording.signal("rail"), signals["rail"][0] * 9.80665)


def test_a_unit_of_a_header_structure_that_contradicts_the_layout_is_an_error(tmp_path):
    variables, _ = with_headers(("Header", "Data"), {"Unit": "unit"})
    scipy.io.savemat(tmp_path / "a.mat", variables)
    channels = (
        RawChannel("force", "Channel_2_Data", "force", unit="N"),
        RawChannel("rail", "Channel_1_Data", "acceleration", unit="m/s²"),
    )
    (error,) = read("a.mat", tmp_path, RawDescription(channels, rate=1000.0)).errors
    assert error.reason == "unit_unknown" and "the file says 'g', the layout 'N'" in str(error)


def test_the_error_of_groups_without_a_vector_lists_their_content(tmp_path):
    signal = {"clock": {"increment": 0.001}, "trace": {"values": np.arange(400.0)}}
    scipy.io.savemat(tmp_path / "a.mat", {"force": signal, "rail": signal})
    error, *_ = read("a.mat", tmp_path, RawDescription((RawChannel("f", "force", "force", "N"),), rate=1000.0)).errors
    assert "group 'force': it holds no vector of samples; in it are 'clock', 'trace'. Save each" in str(error)


VERSIONS = {
    ("raw", "filtered"): True, ("Rohdaten", "gefiltert"): True, ("data", "backup"): True, ("measured", "scaled"): True,
    ("hit 1 raw", "hit 1 filtered"): True, ("impact 1", "impact 1 copy"): True,
    ("A", "B"): False, ("raw 1", "raw 2"): False, ("rail left", "rail right"): False, ("filtered A", "raw B"): False,
    ("measurement", "samples"): False,
}  # fmt: skip


@pytest.mark.parametrize(
    ("format", "names"),
    [
        *(("tdms", names) for names in VERSIONS),
        *((f, n) for f in ("h5", "mat") for n in (("raw", "filtered"), ("A", "B"))),
    ],
)
def test_several_versions_of_one_recording_are_an_error(names, format, tmp_path):
    """Formerly, each impact was used twice, once as measured and once as processed."""
    samples = np.random.default_rng(5).normal(size=(2, 2, 50))
    groups = {name: dict(zip(("force", "rail"), pair)) for name, pair in zip(names, samples)}
    if format == "h5":
        with h5py.File(tmp_path / "a.h5", "w") as file:
            for name, channels in groups.items():
                file[f"{name}/force"], file[f"{name}/rail"] = channels.values()
    elif format == "mat":
        scipy.io.savemat(tmp_path / "a.mat", {name.replace(" ", "_"): channels for name, channels in groups.items()})
    else:
        with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
            for name, channels in groups.items():
                writer.write_segment([nptdms.ChannelObject(name, *item) for item in channels.items()])
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    description = RawDescription(sensors, rate=1e3)
    if not VERSIONS[names]:
        assert len(read(f"a.{format}", tmp_path, description).recordings) == 2
        return
    with pytest.raises(ReadError, match="have the same channels, and their names say that they are versions of one"):
        read(f"a.{format}", tmp_path, description)


DELAYS = {  # name: 12 of its units [s], and 0 for entries that are no delay of a channel
    "delay_samples": 0.012, "latency_us": 12e-6, "Verzögerung [ms]": 0.012, "time shift": 12.0, "group delay": 12.0,
    "start_offset": 12.0, "t0 [ms]": 0.012, "delay (s)": 12.0, "rail_delay_a": 12.0,
    "pre-trigger (samples)": 0.0, "pretrigger level": 0.0, "start_offset [mm]": 0.0, "phase delay (°)": 0.0,
    "start_offset_mm": 0.0,
    "trigger_delay": 0.0, "settling delay": 0.0, "delay unit": 0.0, "offset [V]": 0.0, "latency [ns]": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("name", DELAYS)
def test_a_delay_of_one_channel_is_an_error_and_a_delay_of_all_channels_is_accepted(name, tmp_path):
    """Formerly it was read without a message, and the phase between force and response was wrong."""
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    description = RawDescription((*sensors, RawChannel("aux", "aux", "ignored")), rate=1e3)

    def delays(of_channels, checked=()):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            for channel, samples in zip(("force", "rail", "aux"), np.random.default_rng(5).normal(size=(3, 50))):
                file[channel] = samples
                if channel in of_channels:
                    file[channel].attrs[name] = of_channels[channel]
        result = read("a.h5", tmp_path, replace(description, checked_entries=checked))
        return [str(error) for error in result.errors if error.reason == "clock_drift"]

    of_rail = delays({"rail": "12"})
    delay = DELAYS[name]
    assert bool(of_rail) == (delay > 0.0) and all(f"{name}: 'force' 0 s, 'rail' {delay:g} s" in t for t in of_rail)
    assert not delays({"rail": 12}, (name,)) and not delays({"force": 12, "rail": 12, "aux": 3})


@pytest.mark.parametrize("value", ["2024-05-13 10:00:00", "10:00:00", "13.05.2024", "12 mm", "12 %", "12 °"])
def test_a_date_or_another_quantity_of_one_channel_is_not_read_as_a_delay(value, tmp_path):
    """Formerly, the start date of one channel was read as a delay of 2024 s."""
    np.savez(tmp_path / "a.npz", force=np.arange(50) % 7.0, rail=np.arange(50) % 5.0, rail_t0=np.array(value))
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    assert len(read("a.npz", tmp_path, RawDescription(sensors, rate=1e3)).recordings) == 1


@pytest.mark.parametrize(("name", "is_error"), [("rail_start_offset [ms]", False), ("rail_delay [ms]", True)])
def test_a_start_half_a_sample_late_is_accepted_and_such_a_delay_is_an_error(name, is_error, tmp_path):
    """Multiplexed converters start within one sample; a stated delay has another cause."""
    samples = np.random.default_rng(5).normal(size=(2, 50))
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    np.savez(tmp_path / "a.npz", force=samples[0], rail=samples[1], **{name: 0.4})
    errors = read("a.npz", tmp_path, RawDescription(sensors, rate=1e3)).errors
    assert [error.reason for error in errors] == ["clock_drift"][: int(is_error)]


@pytest.mark.parametrize(
    "text", ["12;24", "0 ms;2 ms", "0;2;ms", "0\t2 samples", "0; 0,002 s", "1e-3 s;0", "0 ms, 2 ms"]
)
@pytest.mark.parametrize("format", ["csv", "npz"])
def test_the_units_of_a_list_of_delays_are_in_or_behind_its_cells(text, format, tmp_path):
    values = np.random.default_rng(5).normal(size=(50, 2))
    text = text.replace(", ", ";") if format == "csv" else text
    separator = "\t" if "\t" in text else ";"
    if format == "npz":
        np.savez(tmp_path / "a.npz", force=values[:, 0], rail=values[:, 1], delays=np.array(text))
    else:
        rows = [f"{a:.6f}{separator}{b:.6f}" for a, b in values]
        lines = [f"Delay{separator}{text}", f"force{separator}rail", *rows, ""]
        (tmp_path / "a.csv").write_text("\n".join(lines), encoding="utf-8")
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    result = read(f"a.{format}", tmp_path, RawDescription(sensors, rate=1e3))
    assert [error.reason for error in result.errors] == ["clock_drift"]


def test_different_pre_triggers_of_two_channels_are_an_error(tmp_path):
    """A pre-trigger of only one channel is a setting of the channel that triggers."""
    samples = np.random.default_rng(5).normal(size=(2, 50))
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    for of_rail, reasons in (({}, []), ({"rail_pretrigger_samples": 12}, ["clock_drift"])):
        np.savez(tmp_path / "a.npz", force=samples[0], rail=samples[1], force_pretrigger_samples=24, **of_rail)
        result = read("a.npz", tmp_path, RawDescription(sensors, rate=1e3))
        assert [error.reason for error in result.errors if error.reason == "clock_drift"] == reasons


OF_NAMES = {  # entries, and whether the channels differ by more than a hundredth of a step of 1 ms
    ("force_delay", 12.0, "rail_delay", 12.0): False, ("force_delay", 12.0, "rail_delay", 11.0): True,
    ("force delay", 0.0, "rail delay", 9e-6): False, ("force delay", 0.0, "rail delay", 11e-6): True,
    ("Vertragsnummer force", 1.0, "Vertragsnummer rail", 2.0): False,
    ("Ch1 delay", 12.0, "Ch2 delay", 12.0): False, ("Ch1 delay", 12.0, "Ch2 delay", 11.0): True,
    ("force delay", "12 µs", "rail delay", "11 µs"): False, ("force delay", "12 µs", "rail delay", "1 µs"): True,
}  # fmt: skip


@pytest.mark.parametrize("entries", OF_NAMES)
def test_delays_with_names_of_channels_are_compared_with_each_other(entries, tmp_path):
    """Formerly, each name was taken as the delay of one channel, with no delay of the others."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"] = np.random.default_rng(5).normal(size=(2, 50))
        file.attrs.update(dict(zip(entries[::2], entries[1::2])))
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    result = read("a.h5", tmp_path, RawDescription(sensors, rate=1e3))
    assert any(error.reason == "clock_drift" for error in result.errors) == OF_NAMES[entries]


@pytest.mark.parametrize("name", ["Delay", "Channel delay [samples]", "Start offset", "Time offset [ms]"])
@pytest.mark.parametrize("has_time", [False, True])
def test_a_line_of_delays_has_one_entry_per_column_with_or_without_the_time(name, has_time, tmp_path):
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="g"))
    rows = [[f"{k / 1e3:.4f}"][: int(has_time)] + [f"{x:.4f}" for x in pair] for k, pair in enumerate(PAIRS)]
    names = [*["time [s]"][: int(has_time)], "force", "rail"]
    for delays in (["0", "0,7"], ["0,7", "0,7"]):
        lines = [[name, *delays], names, *rows]
        (tmp_path / "a.csv").write_text("".join(";".join(line) + "\n" for line in lines), encoding="utf-8")
        result = read("a.csv", tmp_path, RawDescription(sensors, rate=1e3))
        assert [error.reason for error in result.errors] == ["clock_drift"][: int(delays[0] != delays[1])]


PAIRS = np.random.default_rng(6).normal(size=(50, 2))
