"""A date without a time of day is not used as a start, as midnight would be a guess."""

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

FORCE = np.random.default_rng(5).normal(size=200)
DESCRIPTION = RawDescription(channels=(RawChannel("force", "force", "force", unit="N"),), rate=1000.0)
DATES = ("2024-05-13", "20240513", "2024/05/13", "13.05.2024", "2024-W20-1", 20240513)


def write_hdf5(path, start):
    with h5py.File(path, "w") as file:
        file["force"] = FORCE
        file.attrs["sampling_rate"], file.attrs["start_time"] = 1000.0, start


def write_npz(path, start):
    np.savez(path, force=FORCE, fs=1000.0, start_time=start)


def write_csv(path, start):
    rows = "".join(f"{k / 1000},{x}\n" for k, x in enumerate(FORCE))
    path.write_text(f"# start_time: {start}\ntime,force\n{rows}")


FORMS = {"h5": write_hdf5, "npz": write_npz, "csv": write_csv}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("start", DATES, ids=str)
def test_a_date_without_a_time_is_reported_and_not_used_as_a_start(start, form, tmp_path):
    FORMS[form](tmp_path / f"a.{form}", start)
    result = read(f"a.{form}", tmp_path, DESCRIPTION)
    assert [r.started_at for r in result.recordings] == [None]
    (remark,) = result.errors
    assert remark.reason == "start_unknown" and "has no time of day" in remark.problem


@pytest.mark.parametrize("unit", "YMWD")
def test_a_time_stamp_in_days_is_not_used_as_a_start(unit, tmp_path):
    write_npz(tmp_path / "a.npz", np.datetime64("2024-05-13", unit))
    result = read("a.npz", tmp_path, DESCRIPTION)
    assert [r.started_at for r in result.recordings] == [None]
    assert [e.reason for e in result.errors] == ["start_unknown"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("start", ["2024-05-13T00:00:00", "2024-05-13 00:00", "20240513T000000"])
def test_a_stated_midnight_is_used_as_a_start(start, form, tmp_path):
    FORMS[form](tmp_path / f"a.{form}", start)
    result = read(f"a.{form}", tmp_path, DESCRIPTION)
    assert [str(r.started_at) for r in result.recordings] == ["2024-05-13 00:00:00"] and not result.errors
