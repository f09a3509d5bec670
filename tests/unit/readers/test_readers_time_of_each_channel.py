"""Columns that rise evenly under any name are times: they need no entry in the layout, and must begin together."""

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
N = 400
FORCE, RAIL = np.random.default_rng(1).normal(size=(2, N)).round(4)
TIME = np.arange(N) / RATE
CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))


def write_csv(path, columns):
    rows = "".join(";".join(f"{x:.6f}" for x in row) + "\n" for row in zip(*columns.values()))
    path.write_text(";".join(columns) + "\n" + rows)


def write_mat(path, columns):
    scipy.io.savemat(path, {name or "x": x for name, x in columns.items()})


def write_h5(path, columns):
    with h5py.File(path, "w") as file:
        file.update({name or "x": x for name, x in columns.items()})


WRITERS = {"a.csv": write_csv, "a.mat": write_mat, "a.h5": write_h5}


def read_columns(tmp_path, name, columns, ignored=()):
    WRITERS[name](tmp_path / name, columns)
    channels = (*CHANNELS, *(RawChannel(f"ignored_{k}", k, "ignored") for k in ignored))
    return read(name, tmp_path, RawDescription(channels, rate=RATE))


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize("names", [("", ""), ("Data1_time_force", "Data1_time_rail"), ("x1", "x2")])
def test_a_column_that_rises_evenly_needs_no_entry(name, unit, names, tmp_path):
    columns = {names[0]: TIME * unit, "force": FORCE, names[1]: TIME * unit, "rail": RAIL}
    result = read_columns(tmp_path, name, columns)
    np.testing.assert_allclose(result.recordings[0].samples, [FORCE, RAIL], atol=1e-6)
    assert not result.errors


@pytest.mark.parametrize("name", WRITERS)
def test_its_rate_is_checked(name, tmp_path):
    result = read_columns(tmp_path, name, {"x1": 2.0 * TIME, "force": FORCE, "rail": RAIL})
    assert not result.recordings and result.errors[0].reason == "wrong_rate"


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("names", [("u1", "u2"), ("time", "u2"), ("Data1_time_force", "Data1_time_rail")])
@pytest.mark.parametrize("is_ignored", [False, True])
def test_columns_of_times_that_begin_apart_are_an_error(name, names, is_ignored, tmp_path):
    """Also where the layout ignores them, and where one of them proves the order of the samples."""
    columns = {names[0]: TIME, "force": FORCE, names[1]: TIME + 30 / RATE, "rail": RAIL}
    ignored = [n for n in names if n != "time"] if is_ignored else ()
    result = read_columns(tmp_path, name, columns, ignored)
    assert not result.recordings and result.errors[0].reason == "clock_drift"
    assert "begins 30 samples after" in result.errors[0].problem


def test_a_text_and_a_position_need_an_entry(tmp_path):
    columns = {"force": FORCE, "rail": RAIL, "odometer [km]": 5.0 + TIME}
    result = read_columns(tmp_path, "a.csv", columns)
    assert not result.recordings and result.errors[0].reason == "channel_unknown"


def test_a_time_since_the_trigger_beside_that_since_the_start_may_be_checked(tmp_path):
    write_csv(tmp_path / "a.csv", {"time": TIME, "force": FORCE, "rail": RAIL, "since_trigger": TIME - 50 / RATE})
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=RATE))
    assert result.errors[0].reason == "clock_drift" and "'checked_entries'" in str(result.errors[0])
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=RATE, checked_entries=("since_trigger",)))
    assert len(result.recordings) == 1 and not result.errors
