"""Usual codes for missing samples are found in packed numbers, although they look like measured values."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

DESCRIPTION = RawDescription(channels=(RawChannel("force", "force", "force", unit="N"),), rate=1000.0)
SMOOTH = np.round(1000 * np.sin(np.arange(400) / 9))


def outcome(numbers, factor, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["sampling_rate"] = 1000.0
        file["force"] = numbers
        file["force"].attrs.update({"unit": "N", "scale_factor": factor})
    return read("a.h5", tmp_path, DESCRIPTION)


@pytest.mark.parametrize("factor", [0.125, 1.0, -0.5])
@pytest.mark.parametrize(
    ("code", "type"),
    [
        (-32768, "i2"), (-32768, "i4"), (32767, "i2"), (-9999, "i2"), (-9999, "f4"), (-(2**23), "i4"), (-(2**31), "i4"),
    ],
)  # fmt: skip
def test_a_code_in_packed_numbers_is_reported(code, type, factor, tmp_path):
    numbers = SMOOTH.copy()
    numbers[100:150] = code
    result = outcome(numbers.astype(type), factor, tmp_path)
    if code == 32767:  # no code by itself: the highest number of a converter is clipping
        assert len(result.recordings) == 1
    else:
        assert not result.recordings and [e.reason for e in result.errors] == ["not_finite"]


def test_packed_numbers_without_a_code_are_read(tmp_path):
    (recording,) = outcome(SMOOTH.astype("i2"), 0.125, tmp_path).recordings
    np.testing.assert_allclose(recording.signal("force"), SMOOTH * 0.125)


@pytest.mark.parametrize("shape", ["vector", "columns", "rows"])
@pytest.mark.parametrize("is_in_file", [False, True])
def test_a_code_is_found_in_each_shape_and_in_a_record_that_is_read_in_parts(shape, is_in_file, tmp_path):
    n = 300_000
    rng = np.random.default_rng(1)
    rail, other = np.round(rng.normal(0.0, 100.0, (2, n))).astype("i2")
    rail[262_144] = -32768  # in the second block
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = 20000.0
        if shape == "vector":
            file["rail"], file["other"] = rail, other
        else:
            file["data"] = np.array([rail, other]) if shape == "rows" else np.column_stack([rail, other])
            file.attrs["channels"] = ["rail", "other"]
        for dataset in file.values():
            dataset.attrs.update({"units": "m/s²", "scale_factor": 0.01})
    channels = tuple(RawChannel(name, name, "acceleration", unit="m/s²") for name in ("rail", "other"))
    options = {"max_duration": 1.0, "max_whole_file_size": 0} if is_in_file else {}
    result = read("a.h5", tmp_path, RawDescription(channels, "passage", rate=20000.0), **options)
    (error,) = result.errors
    assert error.reason == "not_finite" and f"'rail': 1 of {n} samples are missing" in str(error)
    (recording,) = (*result.recordings, *result.long_recordings)
    assert [c.name for c in recording.channels] == ["other"]


@pytest.mark.parametrize("shape", [(2, 400), (400, 2), (1, 400), (400,)])
def test_the_unit_of_a_matrix_is_used_for_its_channels(shape, tmp_path):
    names = ["rail", "other"]
    samples = np.random.default_rng(1).normal(size=(2, 400))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = 20000.0
        if 2 in shape:
            file["data"] = samples if shape[0] == 2 else samples.T
            file.attrs["channels"] = names
            file["data"].attrs["unit"] = "g"
        else:
            for name, x, unit in zip(names, samples, ("g", "m/s²")):
                file[name] = x.reshape(shape)
                file[name].attrs["unit"] = unit
    channels = tuple(RawChannel(name, name, "acceleration") for name in names)
    (recording,) = read("a.h5", tmp_path, RawDescription(channels, "passage", rate=20000.0)).recordings
    np.testing.assert_allclose(recording.signal("rail"), samples[0] * 9.80665)
    np.testing.assert_allclose(recording.signal("other"), samples[1] * (9.80665 if 2 in shape else 1.0))


@pytest.mark.parametrize("is_in_file", [False, True])
@pytest.mark.parametrize(
    ("type", "facts"),
    [
        ("f4", {"valid_max": 1500.0}),
        ("f8", {"valid_range": [-1500.0, 1500.0]}),
        ("i2", {"valid_range": np.array([-1500, 1500], "i2")}),
        ("i2", {"valid_range": [-750.0, 750.0]}),  # floating-point numbers beside whole ones are unpacked ones
    ],
)
def test_a_sample_outside_the_valid_range_is_reported_as_missing(type, facts, is_in_file, tmp_path):
    factor = 0.5 if type == "i2" else 1.0
    numbers = np.resize(SMOOTH, 80_000).astype(type)
    for is_outside in (False, True):
        numbers[100] = 2000 if is_outside else 20
        name = f"{is_outside}.h5"
        with h5py.File(tmp_path / name, "w") as file:
            file.attrs["sampling_rate"] = 1000.0
            file["force"] = numbers
            file["force"].attrs.update({"unit": "N", "scale_factor": factor, **facts})
        size = {"max_duration": 1.0, "max_whole_file_size": 0} if is_in_file else {}
        result = read(name, tmp_path, replace(DESCRIPTION, kind="passage"), **size)
        assert [e.reason for e in result.errors] == ["not_finite"] * is_outside
        assert len(result.recordings) + len(result.long_recordings) == (not is_outside)
