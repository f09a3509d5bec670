"""An entry that lists as many starts as the file has records states the start of each of them."""

from datetime import datetime

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
SAMPLES = np.random.default_rng(1).normal(size=(6, 2, 300)).round(4)
STARTS = [datetime(2026, 5, 13, 8, 20 + k, 30, 250_000) for k in range(6)]


def write_h5(path, n, starts):
    with h5py.File(path, "w") as file:
        for k in range(n):
            file[f"impact_{k + 1}/force"], file[f"impact_{k + 1}/rail"] = SAMPLES[k]
        file.attrs.update(start_times=starts, fs=5000.0)


def write_mat(path, n, starts):
    force, rail = SAMPLES[:n].transpose(1, 2, 0)
    scipy.io.savemat(path, {"force": force, "rail": rail, "fs": 5000.0, "start_times": np.array(starts, dtype=object)})


def seconds_since_1970(time):
    return (time - datetime(1970, 1, 1)).total_seconds()


@pytest.mark.parametrize("n", [2, 3, 6])
@pytest.mark.parametrize(("writer", "form"), [(write_h5, str), (write_h5, seconds_since_1970), (write_mat, str)])
def test_each_record_has_its_own_of_the_listed_starts(writer, n, form, tmp_path):
    """Also where the file has as many channels as records."""
    name = f"a.{writer.__name__.removeprefix('write_')}"
    writer(tmp_path / name, n, [form(time) for time in STARTS[:n]])
    result = read(name, tmp_path, RawDescription(CHANNELS, rate=5000.0))
    np.testing.assert_array_equal([recording.samples for recording in result.recordings], SAMPLES[:n])
    assert [recording.started_at for recording in result.recordings] == STARTS[:n] and result.errors == ()


def test_starts_of_the_channels_of_each_record_must_agree(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(2):
            file[f"impact_{k + 1}/force"], file[f"impact_{k + 1}/rail"] = SAMPLES[k]
            file[f"impact_{k + 1}"].attrs["start_times"] = [str(STARTS[2 * k]), str(STARTS[2 * k + 1])]
        file.attrs["fs"] = 5000.0
    result = read("a.h5", tmp_path, RawDescription(CHANNELS, rate=5000.0))
    assert not result.recordings and "clock_drift" in [error.reason for error in result.errors]


def test_several_starts_of_a_single_record_are_reported(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"] = SAMPLES[0]
        file.attrs.update(start_times=[str(time) for time in STARTS[:3]], fs=5000.0)
    result = read("a.h5", tmp_path, RawDescription(CHANNELS, rate=5000.0))
    assert [error.reason for error in result.errors] == ["start_unknown"] and len(result.recordings) == 1


def datenum(time):
    return time.toordinal() + 366 + (time - datetime(time.year, time.month, time.day)).total_seconds() / 86400


@pytest.mark.parametrize("name", ["start", "t0", "start_times", "started_at", "Start time"])
@pytest.mark.parametrize("form", [datenum, seconds_since_1970])
@pytest.mark.parametrize("is_column", [True, False])
def test_a_vector_of_numbers_beside_matrices_lists_the_starts(is_column, form, name, tmp_path):
    force, rail = SAMPLES[:4].transpose(1, 0, 2)
    starts = np.array([form(time) for time in STARTS[:4]])
    if " " in name:
        np.savez(tmp_path / "a.npz", force=force, rail=rail, fs=5000.0, **{name: starts})
    else:
        starts = starts[:, None] if is_column else starts[None]
        scipy.io.savemat(tmp_path / "a.mat", {"force": force, "rail": rail, "fs": 5000.0, name: starts})
    (path,) = tmp_path.iterdir()
    result = read(path.name, tmp_path, RawDescription(CHANNELS, rate=5000.0))
    np.testing.assert_array_equal([recording.samples for recording in result.recordings], SAMPLES[:4])
    offsets = [(r.started_at - time).total_seconds() for r, time in zip(result.recordings, STARTS)]
    assert max(map(abs, offsets)) < 1e-3 and not result.errors
