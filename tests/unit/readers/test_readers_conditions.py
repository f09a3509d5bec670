"""A condition that is an array in a typed format is read as the value of its record, or reported."""

import json

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from tests.unit.readers.test_readers_rate_matrix import SAMPLES, TRUE, UNITS, described

from turnout.readers import read


def write_hdf5(path, value):
    with h5py.File(path, "w") as file:
        for name, x in zip(UNITS, SAMPLES):
            file[name] = x
        file.attrs["rail_temperature"] = value


def write_npz(path, value):
    np.savez(path, rail_temperature=np.array(value), **dict(zip(UNITS, SAMPLES)))


def write_mat(path, value):
    scipy.io.savemat(path, {"rail_temperature": value, **dict(zip(UNITS, SAMPLES))})


def write_parquet(path, value):
    notes = {"notes": json.dumps({"rail_temperature": value}), "rail_temperature": json.dumps(value)}
    pq.write_table(pa.table(dict(zip(UNITS, SAMPLES))).replace_schema_metadata(notes), path)


WRITERS = {"a.h5": write_hdf5, "a.npz": write_npz, "a.mat": write_mat, "a.parquet": write_parquet}


@pytest.mark.parametrize("name", [n for n in WRITERS if n != "a.parquet"])
@pytest.mark.parametrize("value", [12.5, [12.5], [[12.5]], [12.5, 12.5, 12.5]])
def test_an_array_of_equal_values_is_one_number(name, value, tmp_path):
    WRITERS[name](tmp_path / name, value)
    result = read(name, tmp_path, described(TRUE))
    assert result.errors == () and result.recordings[0].conditions["rail_temperature"] == 12.5


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("value", [[12.5, 30.0, 4.0], [73, 67, 52]])
def test_different_values_are_reported_and_not_used(name, value, tmp_path):
    WRITERS[name](tmp_path / name, value)
    result = read(name, tmp_path, described(TRUE))
    found = result.recordings[0].conditions.get("rail_temperature")
    assert found is None or isinstance(found, str)
    if found is None:
        (error,) = result.errors
        assert error.reason == "condition_lost" and "rail_temperature is 3 different values" in error.problem


def test_a_value_of_one_record_with_another_type_is_reported(tmp_path):
    texts = np.empty(3, dtype=object)
    texts[:] = ["IC4", np.array([73, 67, 52], dtype=np.uint16), "IC4"]
    variables = {f"record_{k}": dict(zip(UNITS, SAMPLES * (1 + k))) for k in range(3)}
    scipy.io.savemat(tmp_path / "a.mat", {"train_type": texts, **variables})
    result = read("a.mat", tmp_path, described(TRUE))
    assert [r.conditions.get("train_type") for r in result.recordings] == ["IC4", None, "IC4"]
    assert [(e.reason, e.where) for e in result.errors] == [("condition_lost", "record 2")]
