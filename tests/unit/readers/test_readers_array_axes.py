"""Axes of an array of three dimensions: which of them is that of the records, the channels and the samples."""

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N = 2e4, 300
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
AXES = ("record", "channel", "sample")
ORDERS = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]


def samples_of(n_record):
    """(record, channel, sample) array."""
    return np.random.default_rng(14).normal(size=(n_record, 2, N)) * [[900.0], [30.0]]


def outcome(folder, array, dims=None, format="npz", sensors=SENSORS, **variables):
    variables = {"data": array, "fs": RATE, **variables} | ({} if dims is None else {"dims": dims})
    if format == "npz":
        np.savez(folder / "a.npz", **variables)
    else:
        scipy.io.savemat(folder / "a.mat", variables)
    return read(f"a.{format}", folder, RawDescription(sensors, rate=RATE))


@pytest.mark.parametrize("format", ["npz", "mat"])
@pytest.mark.parametrize("n_record", [1, 3, 5])
@pytest.mark.parametrize("order", ORDERS)
def test_the_number_of_channels_and_the_longest_axis_decide(order, n_record, format, tmp_path):
    samples = samples_of(n_record)
    result = outcome(tmp_path, samples.transpose(order), format=format, channels=["force", "rail"])
    assert [r.samples.tolist() for r in result.recordings] == [x.tolist() for x in samples]


@pytest.mark.parametrize("order", ORDERS)
def test_the_file_states_the_axes_of_as_many_records_as_channels(order, tmp_path):
    samples = samples_of(2)
    array = samples.transpose(order)
    for words in (AXES, ("impacts", "Kanal", "time"), ("hit no", "Channels", "samples")):
        stated = [words[i] for i in order]
        for dims in (stated, ",".join(stated)):
            result = outcome(tmp_path, array, dims, channels=["force", "rail"])
            assert [r.samples.tolist() for r in result.recordings] == [x.tolist() for x in samples]


def test_stated_axes_that_contradict_the_names_of_the_channels_are_rejected(tmp_path):
    with pytest.raises(Exception, match="it has 3 channels, and 2 have a name"):
        outcome(tmp_path, samples_of(3), ("channel", "record", "sample"), channels=["force", "rail"])


def test_without_names_of_channels_the_records_come_first(tmp_path):
    sensors = (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", unit="m/s²"))
    samples = samples_of(4)
    for array in (samples, samples.transpose(2, 1, 0)):
        result = outcome(tmp_path, array, sensors=sensors)
        assert [r.samples.tolist() for r in result.recordings] == [x.tolist() for x in samples]
    for array in (samples_of(2), samples_of(2).transpose(2, 1, 0)):
        result = outcome(tmp_path, array, sensors=sensors)
        assert [r.samples.tolist() for r in result.recordings] == [x.tolist() for x in samples_of(2)]
        assert [e.reason for e in result.errors] == ["entry_unknown"]


@pytest.mark.parametrize("format", ["npz", "mat"])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0)])
def test_as_many_records_as_channels_in_the_usual_order_are_a_remark(order, format, tmp_path):
    array = samples_of(2).transpose(order)
    result = outcome(tmp_path, array, format=format, channels=["force", "rail"])
    assert [r.samples.tolist() for r in result.recordings] == [x.tolist() for x in samples_of(2)]
    assert [e.reason for e in result.errors] == ["entry_unknown"]
    order_text = "(record, channel, sample)" if order[0] == 0 else "(sample, channel, record)"
    assert order_text in str(result.errors[0]) and "checked_entries: data" in str(result.errors[0])
    description = RawDescription(SENSORS, rate=RATE, checked_entries=("Data",))
    assert not read(f"a.{format}", tmp_path, description).errors


@pytest.mark.parametrize("order", [(0, 2, 1), (1, 2, 0)])
def test_samples_between_as_many_records_as_channels_are_rejected(order, tmp_path):
    with pytest.raises(Exception, match=r"nothing says which axis is that of the records.*dims"):
        outcome(tmp_path, samples_of(2).transpose(order), channels=["force", "rail"])


@pytest.mark.parametrize("dtype", ["S1", "f8", "i4", h5py.string_dtype()])
@pytest.mark.parametrize("name", ["note", "started_at", "rate", "units", "rail_temperature", "time"])
@pytest.mark.parametrize("is_grouped", [False, True])
def test_a_dataset_without_a_value_does_not_cost_the_file(is_grouped, name, dtype, tmp_path):
    samples = samples_of(2)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(2 if is_grouped else 1):
            group = file.create_group(f"record_{k:03d}") if is_grouped else file
            group["force"], group["rail"] = samples[k]
            group[name] = h5py.Empty(dtype)
        file[f"{name}2"] = h5py.Empty(dtype)
    result = read("a.h5", tmp_path, RawDescription(SENSORS, rate=RATE))
    assert [r.samples.tolist() for r in result.recordings] == samples[: 2 if is_grouped else 1].tolist()
    assert result.errors == ()


def test_attributes_of_a_dataset_without_a_value_count(tmp_path):
    """A dataset without a value is a common place for attributes: its rate is compared with that of the layout."""
    force, rail = samples_of(1)[0]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"], file["settings"] = force, rail, h5py.Empty("f8")
        file["settings"].attrs["sampling rate [Hz]"] = 2.0 * RATE
    (error,) = read("a.h5", tmp_path, RawDescription(SENSORS, rate=RATE)).errors
    assert error.reason == "wrong_rate"


@pytest.mark.parametrize("name", ["scale_factor", "add_offset", "_FillValue", "valid_range", "unit"])
def test_packing_without_a_value_is_none(name, tmp_path):
    force, rail = samples_of(1)[0]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"] = force, rail
        file["force"].attrs[name] = h5py.Empty("f8")
    result = read("a.h5", tmp_path, RawDescription(SENSORS, rate=RATE))
    assert [r.samples.tolist() for r in result.recordings] == samples_of(1).tolist() and not result.errors


@pytest.mark.parametrize("place", ["file", "rail", "both"])
@pytest.mark.parametrize("dtype", ["S1", "f8"])
def test_an_attribute_without_a_value_does_not_cost_the_file(place, dtype, tmp_path):
    force, rail = samples_of(1)[0]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"] = force, rail
        for owner in {"file": [file], "rail": [file["rail"]], "both": [file, file["rail"]]}[place]:
            owner.attrs["note"] = h5py.Empty(dtype)
        file["nothing"] = h5py.Empty("f8")
    result = read("a.h5", tmp_path, RawDescription(SENSORS, rate=RATE))
    assert [r.samples.tolist() for r in result.recordings] == samples_of(1).tolist() and not result.errors


@pytest.mark.parametrize("form", ["npz", "npz, samples first", "npz, other order", "npz, like names", "mat", "hdf5"])
def test_a_list_of_the_names_of_matrices_says_that_each_is_a_channel(form, tmp_path):
    names, units = ["ch1", "ch2"] if "like" in form else ["force", "rail"], ["N", "m/s²"]
    matrices = dict(zip(names, np.random.default_rng(3).normal(size=(2, 3, 200))))
    stored = {name: matrix.T if "first" in form else matrix for name, matrix in matrices.items()}
    lists = {"channels": names, "units": units}
    if "other order" in form:
        lists = {name: texts[::-1] for name, texts in lists.items()}
    path = tmp_path / f"a.{form[:3].replace('hdf', 'h5')}"
    if form == "mat":
        scipy.io.savemat(path, stored | {"fs": 20000.0} | {k: np.array(v, dtype=object) for k, v in lists.items()})
    elif form == "hdf5":
        with h5py.File(path, "w") as file:
            file.update(stored)
            file.attrs.update(lists | {"fs": 20000.0})
    else:
        np.savez(path, **stored, **lists, fs=20000.0)
    channels = tuple(map(RawChannel, ("force", "rail"), names, ("force", "acceleration")))
    result = read(path.name, tmp_path, RawDescription(channels))
    assert result.errors == ()
    expected = np.stack([matrices[name] for name in names], axis=1)
    np.testing.assert_allclose([r.samples for r in result.recordings], expected, atol=1e-12)


def test_a_list_of_other_names_is_that_of_one_matrix(tmp_path):
    matrices = np.random.default_rng(3).normal(size=(2, 2, 200))
    np.savez(tmp_path / "a.npz", force=matrices[0], rail=matrices[1], channels=["left", "right"], fs=20000.0)
    channels = (RawChannel("left", "left", "acceleration", unit="m/s²"),)
    with pytest.raises(ReadError, match="several arrays could be the samples: 'force', 'rail'"):
        read("a.npz", tmp_path, RawDescription(channels))
