"""Files with the structures of other programs, written here with the libraries that those use."""

from dataclasses import replace

import h5py
import nptdms
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import soundfile

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.writing import mat73, write
from turnout.records import Channel, RawChannel, RawDescription, Recording

RATE = 51200.0
FORCE, RAIL = 900.0 * np.sin(np.arange(300) / 7), 20.0 * np.cos(np.arange(300) / 3) + 0.5


@pytest.fixture
def by_index():
    """Columns of numbers without names or units."""
    channels = (
        RawChannel("force", 0, "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N"),
        RawChannel("rail", 1, "acceleration", unit="V", sensitivity=87.9, sensitivity_unit="mV/g"),
    )
    return RawDescription(channels, rate=RATE)


@pytest.fixture
def by_name():
    return RawDescription((RawChannel("force", "Force", "force"), RawChannel("rail", "Acc", "acceleration")), rate=RATE)


def assert_both(recording):
    np.testing.assert_allclose(recording.signal("force"), FORCE, rtol=1e-14)
    np.testing.assert_allclose(recording.signal("rail"), RAIL, rtol=1e-14)


def test_a_matlab_matrix_of_columns_with_fs_is_read(by_index, tmp_path):
    volts = np.column_stack([FORCE * 0.23e-3, RAIL * 87.9e-3 / 9.80665])
    scipy.io.savemat(tmp_path / "a.mat", {"data": volts, "Fs": RATE, "operator": "NN"})
    (recording,) = read("a.mat", tmp_path, by_index).recordings
    assert_both(recording)
    assert recording.conditions["operator"] == "NN"
    (error,) = read("a.mat", tmp_path, replace(by_index, rate=25600.0)).errors
    assert error.reason == "wrong_rate"


def test_a_matlab_matrix_in_three_dimensions_is_read(by_index, tmp_path):
    """(sample, channel, record): users of MATLAB stack impacts in this way."""
    volts = np.column_stack([FORCE * 0.23e-3, RAIL * 87.9e-3 / 9.80665])
    scipy.io.savemat(tmp_path / "a.mat", {"y": np.stack([volts, 2 * volts, 3 * volts], axis=2), "dt": 1 / RATE})
    first, second, third = read("a.mat", tmp_path, by_index).recordings
    assert_both(first)
    np.testing.assert_allclose(second.signal("rail"), 2 * RAIL, rtol=1e-14)
    np.testing.assert_allclose(third.signal("rail"), 3 * RAIL, rtol=1e-14)
    scipy.io.savemat(tmp_path / "b.mat", {"y": np.stack([volts, 2 * volts], axis=2), "dt": 1 / RATE})
    result = read("b.mat", tmp_path, by_index)
    np.testing.assert_allclose(result.recordings[1].signal("rail"), 2 * RAIL, rtol=1e-14)
    assert [e.reason for e in result.errors] == ["entry_unknown"]


def test_matlab_structures_are_read(by_name, tmp_path):
    one = {"Force": FORCE, "Acc": RAIL, "fs": RATE, "units": np.array(["N", "m/s^2"], dtype=object)}
    scipy.io.savemat(tmp_path / "a.mat", {"measurement": one})
    (recording,) = read("a.mat", tmp_path, by_name).recordings
    assert_both(recording)
    scipy.io.savemat(tmp_path / "b.mat", {"hit_1": one, "hit_2": {**one, "Force": -FORCE, "Acc": -RAIL}})
    first, second = read("b.mat", tmp_path, by_name).recordings
    assert_both(first)
    np.testing.assert_array_equal(second.signal("force"), -FORCE)


def test_a_square_matrix_is_an_error(by_index, tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"data": np.random.default_rng(0).normal(size=(5, 5)), "fs": RATE})
    (error,) = _raised("a.mat", tmp_path, by_index)
    assert "(5, 5) samples do not match 5 channels" in str(error)


def _raised(name, root, description):
    try:
        return read(name, root, description).errors
    except ReadError as error:
        return (error,)


def test_two_matrices_are_an_error(by_index, tmp_path):
    np.savez(tmp_path / "a.npz", x=np.zeros((2, 9)), y=np.zeros((2, 9)), fs=RATE)
    (error,) = _raised("a.npz", tmp_path, by_index)
    assert "several arrays could be the samples: 'x', 'y'. Export one array or one per record." in str(error)


def test_hdf5_datasets_at_the_root_are_read(by_name, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, samples, unit in (("Force", FORCE, "N"), ("Acc", RAIL, "m/s2")):
            file[name] = samples
            file[name].attrs["units"] = unit
            file[name].attrs["sample_rate"] = RATE
    assert_both(read("a.h5", tmp_path, by_name).recordings[0])


def test_hdf5_with_a_group_per_impact_and_a_time_vector_is_read(by_name, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for impact in ("Impact 10", "Impact 9"):  # 9 comes before 10
            group = file.create_group(impact)
            group["time"] = np.arange(300) / RATE
            group["Force"], group["Acc"] = np.array([FORCE, RAIL]) * (1 if impact.endswith("9") else 3)
            group["Force"].attrs["unit"], group["Acc"].attrs["unit"] = "N", "m/s²"
    first, second = read("a.h5", tmp_path, by_name).recordings
    assert_both(first)
    np.testing.assert_allclose(second.signal("force"), 3 * FORCE)


def named_by_a_list(folder, **lists):
    """Groups of datasets, which HDF5 sorts by the alphabet, below lists in the order of the logger."""
    with h5py.File(folder / "a.h5", "w") as file:
        file.attrs.update({"rate": RATE, **lists})
        for impact in (1, 2):
            group = file.create_group(f"hit_{impact}")
            group["Sleeper"], group["Force"], group["Acc"] = np.array([RAIL[::-1], FORCE, RAIL]) * impact
    return "a.h5"


@pytest.fixture
def by_three_names(by_name):
    return replace(by_name, channels=(*by_name.channels, RawChannel("sleeper", "Sleeper", "acceleration")))


@pytest.mark.parametrize("names", [["Sleeper", "Force", "Acc"], ["SLEEPER", "Spare", "Force", "Acc"]])
def test_a_list_of_units_has_the_order_of_the_list_of_names(names, by_three_names, tmp_path):
    """By the alphabet, "Acc" would be in g and "Sleeper" in m/s², both wrong by a factor of 9.8."""
    units = [{"SLEEPER": "g", "FORCE": "kN", "ACC": "m/s²"}.get(name.upper(), "V") for name in names]
    result = read(named_by_a_list(tmp_path, channels=names, units=units), tmp_path, by_three_names)
    assert result.errors == ()
    for impact, recording in enumerate(result.recordings, start=1):
        np.testing.assert_allclose(recording.signal("force"), 1000 * FORCE * impact, rtol=1e-14)
        np.testing.assert_allclose(recording.signal("rail"), RAIL * impact, rtol=1e-14)
        np.testing.assert_allclose(recording.signal("sleeper"), 9.80665 * impact * RAIL[::-1], rtol=1e-14)


@pytest.mark.parametrize("lists", [{}, {"channels": ["a", "b", "c"]}])
def test_a_list_of_units_without_a_known_order_is_an_error(lists, by_three_names, tmp_path):
    result = read(named_by_a_list(tmp_path, units=["g", "N", "m/s²"], **lists), tmp_path, by_three_names)
    assert [e.reason for e in result.errors] == ["unit_unknown"] * 2
    assert result.errors[1].problem == "nothing says which of the units 'g', 'N', 'm/s²' are whose"
    assert result.errors[1].where == "record 2"
    remedy = "Write each dataset's unit beside it, or a list 'channels' of their names beside that of the units"
    assert result.errors[1].remedy == remedy
    accelerations = replace(
        by_three_names, channels=(*by_three_names.channels[1:], RawChannel("f", "Force", "ignored"))
    )
    same = read(named_by_a_list(tmp_path, units=["g"] * 3, **lists), tmp_path, accelerations)
    np.testing.assert_allclose(same.recordings[0].signal("rail"), 9.80665 * RAIL, rtol=1e-14)


def test_a_list_of_units_has_the_order_of_variables_if_the_file_stores_it(by_name, tmp_path):
    """Force before Acc: in HDF5 with track_order and in MATLAB 5; MATLAB 7.3 sorts by the alphabet."""
    with h5py.File(tmp_path / "a.h5", "w", track_order=True) as file:
        file["Force"], file["Acc"] = FORCE, RAIL
        file.attrs.update({"rate": RATE, "units": ["N", "m/s²"]})
    assert_both(read("a.h5", tmp_path, by_name).recordings[0])
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, numbers in (("Force", FORCE), ("Acc", RAIL), ("fs", RATE)):
            mat73._double(file, name, numbers)
        mat73._cell(file, "units", ["N", "m/s²"])
    with (tmp_path / "a.mat").open("r+b") as file:
        file.write(mat73.HEADER.ljust(116) + bytes(8) + b"\x00\x02IM")
    (error,) = _raised("a.mat", tmp_path, by_name)
    assert error.reason == "unit_unknown" and "which of the units 'N', 'm/s²' are whose" in error.problem


def test_tdms_of_one_group_with_scaled_integers_is_read(by_name, tmp_path):
    """LabVIEW stores converter steps and a linear scale: a step is 0.05 N."""
    steps = np.round(FORCE / 0.05).astype("int16")
    scale = {
        "NI_Number_Of_Scales": 1,
        "NI_Scaling_Status": "unscaled",
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.05,
        "NI_Scale[0]_Linear_Y_Intercept": 0.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,  # the raw numbers
    }
    wave = {"wf_increment": 1 / RATE, "wf_samples": 300}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("Untitled", "Force", steps, {**wave, **scale, "unit_string": "N"}),
                nptdms.ChannelObject("Untitled", "Acc", RAIL, {**wave, "unit_string": "m/s^2"}),
            ]
        )
    (recording,) = read("a.tdms", tmp_path, by_name).recordings
    assert np.abs(recording.signal("force") - FORCE).max() <= 0.0251  # half a step
    np.testing.assert_array_equal(recording.signal("rail"), RAIL)
    group = replace(by_name, channels=(replace(by_name.channels[0], source="Untitled/Force"), by_name.channels[1]))
    assert read("a.tdms", tmp_path, group).errors == ()


def left_in_hdf5(folder, steps, starts):
    """Write a file whose first dataset has a few samples of another rate and is no channel."""
    with h5py.File(folder / "a.h5", "w") as file:
        file["AMBIENT"] = np.arange(3.0)
        file["AMBIENT"].attrs["rate"] = 1.0
        for name, samples, unit, step in zip(("Force", "Acc"), (FORCE, RAIL), ("N", "m/s²"), steps):
            file[name] = samples
            file[name].attrs.update({"unit": unit, "dt": step} if name == "Acc" else {"unit": unit, "rate": 1 / step})
    return "a.h5"


def left_in_tdms(folder, steps, starts):
    with nptdms.TdmsWriter(str(folder / "a.tdms")) as writer:
        for k in range(2):  # half of the delay of the second channel is in its time stamp
            channels = [
                nptdms.ChannelObject(
                    f"impact {k}",
                    name,
                    samples,
                    {
                        "unit_string": unit,
                        "wf_increment": step,
                        "wf_start_offset": k * start / 2,
                        "wf_start_time": np.datetime64("2024-05-13T10:00:00")
                        + np.timedelta64(60_000_000 * k + round(k * start / 2 * 1e6), "us"),
                    },
                )
                for name, samples, unit, step, start in zip(
                    ("Force", "Acc"), (FORCE, RAIL), ("N", "m/s²"), steps if k else (1 / RATE, 1 / RATE), starts
                )
            ]
            writer.write_segment(channels)
    return "a.tdms"


def left_in_lvm(folder, steps, starts):
    rows = "".join(f"\t{f:.17g}\t{a:.17g}\n" for f, a in zip(FORCE, RAIL))
    text = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\t\n\t\n"
    for k in range(2):
        clocks = [f"10:0{k}:00.{round(k * start / 2 * 1e7):07d}" for start in starts]
        columns = [("Channels", 2), ("Samples", 300, 300), ("Date", "2024/05/13", "2024/05/13"), ("Time", *clocks)]
        columns += [("Y_Unit_Label", "N", "m/s^2"), ("X0", *(k * start / 2 for start in starts))]
        columns += [("Delta_X", *(steps if k else (1 / RATE, 1 / RATE)))]
        head = "".join("\t".join(map(str, row)) + "\n" for row in columns)
        text += f"{head}***End_of_Header***\t\t\nX_Value\tForce\tAcc\tComment\n{rows}\n"
    (folder / "a.lvm").write_text(text)
    return "a.lvm"


def left_in_uff(folder, steps, starts):
    channels = (Channel("Force", "force"), Channel("Acc", "acceleration"))
    whole = [Recording(np.vstack([FORCE, RAIL]), RATE, channels)] * 2
    data = write(whole, folder / "a.uff", "uff58b").read_bytes()
    axis = f"{0.0:13.5e}{1 / RATE:13.5e}".encode()
    parts = data.split(axis)
    assert len(parts) == 5
    axes = [axis, axis, *(f"{start:13.5e}{step:13.5e}".encode() for step, start in zip(steps, starts))]
    (folder / "a.uff").write_bytes(b"".join(x for pair in zip(parts, [*axes, b""]) for x in pair))
    return "a.uff"


LEFT = {"hdf5": left_in_hdf5, "tdms": left_in_tdms, "lvm": left_in_lvm, "uff": left_in_uff}


@pytest.mark.parametrize("format", LEFT)
def test_channels_of_one_record_with_different_rates_are_an_error(format, by_name, tmp_path):
    """The fault is in the last of two records; the HDF5 file has only one record."""
    name = LEFT[format](tmp_path, (1 / RATE, 1 / 20000), (0.0, 0.0))
    (error,) = _raised(name, tmp_path, by_name)
    if format != "hdf5":
        assert_both(read(name, tmp_path, by_name).recordings[0])
        assert error.where == "record 2 of 2" + " (group 'impact 1')" * (format == "tdms")
    assert error.reason == "wrong_rate" and ("20000 Hz" in error.problem or "5e-05" in error.problem)


@pytest.mark.parametrize("format", ["tdms", "lvm", "uff"])
@pytest.mark.parametrize("start", [5e-4, -6e-5])
def test_channels_of_one_record_with_different_starts_are_an_error(format, start, by_name, tmp_path):
    """0.5 ms are 72° at 400 Hz. A part of a sample is accepted, as multiplexed converters differ by that."""
    name = LEFT[format](tmp_path, (1 / RATE, 1 / RATE), (1e-3, 1e-3 + start))
    result = read(name, tmp_path, by_name)
    (error,) = result.errors
    assert_both(result.recordings[0])
    assert error.reason == "clock_drift" and "record 2 of 2" in error.where
    late, early = ("Acc", "Force") if start > 0 else ("Force", "Acc")
    assert error.problem == f"channel {late!r} begins {abs(start):.6g} s after channel {early!r}"
    name = LEFT[format](tmp_path, (1 / RATE, 1 / RATE), (1e-3, 1e-3 + 8e-6))
    assert read(name, tmp_path, by_name).errors == ()


def test_hdf5_channels_can_state_one_rate_in_different_ways(by_name, tmp_path):
    result = read(left_in_hdf5(tmp_path, (1 / RATE, 1 / RATE), (0.0, 0.0)), tmp_path, by_name)
    assert_both(result.recordings[0])


@pytest.mark.parametrize(
    ("head", "separator", "comma"),
    [
        ("Force,Acc\n", ",", False),
        ("Force [N];Acc [m/s²]\n", ";", True),
        ("fs;51200\nForce;Acc\n(N);(m/s²)\n", ";", True),
        ("# sampled at site 7\nForce (N)\tAcc (m/s^2)\n", "\t", False),
    ],
)
def test_text_with_any_separator_and_decimal_mark_is_read(head, separator, comma, by_name, tmp_path):
    rows = "".join(f"{f:.17g}{separator}{a:.17g}\n" for f, a in zip(FORCE, RAIL))
    rows = rows.replace(".", ",") if comma else rows
    (tmp_path / "a.csv").write_text(head + rows, encoding="utf-8")
    named = tuple(replace(c, unit=u) for c, u in zip(by_name.channels, ("N", "m/s²")))
    assert_both(read("a.csv", tmp_path, replace(by_name, channels=named)).recordings[0])


def test_text_with_a_printed_time_column_gives_the_rate(by_name, tmp_path):
    """A time in whole microseconds deviates by up to half of one: the rate is known to 2 * 0.5 us / 5.8 ms."""
    frame = pd.DataFrame({"time": (np.arange(300) / RATE).round(6), "Force [N]": FORCE, "Acc [m/s²]": RAIL})
    frame.to_csv(tmp_path / "a.csv", index=False)
    assert_both(read("a.csv", tmp_path, by_name).recordings[0])
    assert read("a.csv", tmp_path, by_name).recordings[0].rate == RATE
    assert read("a.csv", tmp_path, replace(by_name, rate=51300.0)).errors[0].reason == "wrong_rate"


def test_text_without_names_is_mapped_by_index(by_index, tmp_path):
    np.savetxt(tmp_path / "a.txt", np.column_stack([FORCE, RAIL]), delimiter=",")
    (recording,) = read("a.txt", tmp_path, by_index).recordings
    np.testing.assert_allclose(recording.signal("force"), FORCE / 0.23e-3, rtol=1e-14)


def test_the_error_of_a_word_among_numbers_states_its_place(by_index, tmp_path):
    np.savetxt(tmp_path / "a.csv", np.column_stack([FORCE, RAIL]), delimiter=",")
    text = (tmp_path / "a.csv").read_text().splitlines()
    text[100] = "overload,0.5"
    (tmp_path / "a.csv").write_text("\n".join(text) + "\n")
    (error,) = _raised("a.csv", tmp_path, by_index)
    assert error.reason == "unreadable"
    assert str(error).startswith("a.csv, line 101, column '0': 'overload' is no number")


def test_parquet_of_a_data_frame_with_time_stamps_is_read(by_name, tmp_path):
    stamps = pd.Timestamp("2024-05-13") + pd.to_timedelta(np.arange(300) / RATE, unit="s")
    pd.DataFrame({"time": stamps, "Force": FORCE, "Acc": RAIL}).to_parquet(tmp_path / "a.parquet")
    named = tuple(replace(c, unit=u) for c, u in zip(by_name.channels, ("N", "m/s²")))
    assert_both(read("a.parquet", tmp_path, replace(by_name, channels=named)).recordings[0])
    table = pa.table({"Force": FORCE, "Acc": RAIL}).replace_schema_metadata({"rate": "51200.0", "units": "[]"})
    pq.write_table(table, tmp_path / "b.parquet")
    assert_both(read("b.parquet", tmp_path, replace(by_name, channels=named)).recordings[0])


def test_wav_and_flac_are_read_to_their_resolution(by_index, tmp_path):
    rng = np.random.default_rng(3)
    samples = rng.uniform(-0.9, 0.9, size=(300, 2))
    of_one_volt = replace(by_index, channels=tuple(replace(c, unit="1 V") for c in by_index.channels))
    for name, subtype in (("a.wav", "PCM_16"), ("a.flac", "PCM_16"), ("b.wav", "FLOAT")):
        soundfile.write(tmp_path / name, samples, int(RATE), subtype)
        (recording,) = read(name, tmp_path, of_one_volt).recordings
        half_step = 1.01 / 2**15 if subtype == "PCM_16" else 2**-24
        assert np.abs(recording.signal("force") * 0.23e-3 - samples[:, 0]).max() <= half_step
        assert np.abs(recording.signal("rail") * 87.9e-3 / 9.80665 - samples[:, 1]).max() <= half_step


def test_the_real_hammer_test_of_five_impacts_is_read(shared_data):
    """The true values are printed in the header of the file; the samples are those in the file."""
    channels = (
        RawChannel("force", "Force (Trigger)", "force"),
        RawChannel("response", "Acceleration (Trigger)", "acceleration"),
    )
    description = RawDescription(channels, rate=RATE, n_records=5, n_samples=51200)
    result = read("impact2_response0.lvm", shared_data / "hammer_pyfrf", description)
    assert result.errors == () and len(result.recordings) == 5
    first, second = result.recordings[:2]
    np.testing.assert_array_equal(first.samples[:, :2], [[-0.158373, -0.133621], [0.059175, 0.062299]])
    np.testing.assert_array_equal(second.samples[:, 0], [-0.102166, 0.058501])
    assert f"{first.started_at:%Y-%m-%d %H:%M:%S.%f}" == "2019-03-11 08:42:44.605411"
    assert result.sha256 == "473b6380" + result.sha256[8:]


def test_a_row_of_lvm_may_contain_a_comment(shared_data, tmp_path):
    """Only some rows have the additional field; lvm_read pads the others, and the numbers do not change."""
    text = (shared_data / "hammer_pyfrf" / "impact2_response0.lvm").read_text().splitlines()[:40]
    text[14] = text[14].replace("51200", "17")
    text[24] += "\tovershoot"
    (tmp_path / "a.lvm").write_text("\n".join(text) + "\n")
    channels = (RawChannel("f", 0, "force"), RawChannel("a", 1, "acceleration"))
    (recording,) = read("a.lvm", tmp_path, RawDescription(channels)).recordings
    assert recording.n_sample == 17
    assert recording.samples[0, 0] == -0.158373


def test_structured_arrays_are_read_by_their_fields(tmp_path):
    """In HDF5 and npz: fields of a time axis and of channels."""
    x = np.random.default_rng(1).normal(size=(2, 60))
    rows = np.zeros(60, dtype=[("time", "f8"), ("force", "f8"), ("rail", "f4")])
    rows["time"], rows["force"], rows["rail"] = np.arange(60) / 5000, *x
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["table"] = rows
    np.savez(tmp_path / "a.npz", table=rows)
    layout = RawDescription(
        (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "g"))
    )
    for name in ("a.h5", "a.npz"):
        (recording,) = read(name, tmp_path, layout).recordings
        assert recording.rate == 5000 and np.array_equal(recording.signal("force"), x[0])


@pytest.mark.parametrize("kind", ["channels", "records", "cell"])
def test_structure_arrays_and_cells_of_matlab_are_read(kind, tmp_path):
    x = np.random.default_rng(2).normal(size=(2, 60))
    layout = RawDescription(
        (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
    )
    if kind == "channels":
        array = np.zeros(2, dtype=[(n, object) for n in ("label", "unit", "values", "fs")])
        array[0], array[1] = ("force", "N", x[0], 5000.0), ("rail", "m/s^2", x[1], 5000.0)
        variables = {"ch": array}
    elif kind == "records":
        array = np.zeros(3, dtype=[(n, object) for n in ("force", "rail")])
        for k in range(3):
            array[k] = (x[0] + k, x[1] + k)
        variables = {"rec": array, "fs": 5000.0}
    else:
        variables = {"data": np.array(list(x), dtype=object), "channels": ["force", "rail"], "fs": 5000.0}
        variables["data"] = np.empty(2, dtype=object)
        variables["data"][0], variables["data"][1] = x
    scipy.io.savemat(tmp_path / "a.mat", variables)
    recordings = read("a.mat", tmp_path, layout).recordings
    assert len(recordings) == (3 if kind == "records" else 1)
    for k, recording in enumerate(recordings):
        assert recording.rate == 5000 and np.array_equal(recording.samples, x + k)


def test_the_error_of_a_file_without_samples_states_its_content(tmp_path):
    np.savez(tmp_path / "a.npz", spectrum=np.ones(50) + 1j)
    pq.write_table(pa.table({"force": [{"x": 1.0}], "rail": [["1.0", "2.0"]]}), tmp_path / "a.parquet")
    layout = RawDescription((RawChannel("force", "force", "force", "N"),), rate=5000.0)
    for name, words in (("a.npz", "'spectrum' (complex128 of shape (50,))"), ("a.parquet", "'force' (struct")):
        with pytest.raises(ReadError) as caught:
            read(name, tmp_path, layout)
        assert words in str(caught.value) and "Copy the file again" not in str(caught.value)


@pytest.mark.parametrize("extension", [".tdms", ".mat", ".h5", ".npz", ".parquet", ".wav", ".rcmdx"])
def test_a_text_with_the_extension_of_binary_numbers_is_reported_as_text(extension, tmp_path):
    (tmp_path / f"a{extension}").write_text("force [N];rail [m/s²]\n" + "1.5;2.5\n3.5;-4.5\n" * 9, encoding="utf-8")
    with pytest.raises(ReadError, match=r"first bytes are text \(b'force .*\.csv or \.txt"):
        read(f"a{extension}", tmp_path, RawDescription(()))
