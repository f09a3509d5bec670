"""A condition that is an array in a typed format is read as the value of its record, or reported."""

import dataclasses
import json

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from tests.unit.readers.test_readers_rate_matrix import SAMPLES, TRUE, UNITS, described

from turnout.readers import read
from turnout.records import RawChannel, RawDescription


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


IN_SI = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
    rate=20000.0,
)


def read_table(tmp_path, head, description=IN_SI):
    """(conditions, reasons of the errors) of a table under these lines."""
    rows = "".join(f"{f:.4f};{r:.4f}\n" for f, r in np.random.default_rng(5).normal(size=(200, 2)))
    (tmp_path / "a.csv").write_text(f"{head}\nforce;rail\n{rows}", encoding="utf-8")
    result = read("a.csv", tmp_path, description)
    return dict(result.recordings[0].conditions), [error.reason for error in result.errors]


@pytest.mark.parametrize("mark", ["", "# "])
@pytest.mark.parametrize(
    ("line", "condition", "value"),
    [
        ("speed: 80 km/h", "speed", pytest.approx(80 / 3.6)),
        ("speed [km/h]: 80", "speed", pytest.approx(80 / 3.6)),
        ("speed;80 km/h", "speed", pytest.approx(80 / 3.6)),
        ("train_type: ICE", "train_type", "ICE"),
        ("train_type;ICE", "train_type", "ICE"),
        ("Train ID = 4711", "train_id", 4711.0),
        ("operator: JH", "operator", "JH"),
        ("rail_temperature: 12,5", "rail_temperature", 12.5),
        ("rail temperature: 54.5 °F", "rail_temperature", pytest.approx(12.5)),
    ],
)
def test_a_condition_in_the_head_of_a_table_is_read_with_and_without_a_mark(mark, line, condition, value, tmp_path):
    conditions, reasons = read_table(tmp_path, mark + line)
    assert conditions == {condition: value} and reasons == []


def test_a_column_with_the_name_of_a_condition_is_no_condition(tmp_path):
    rows = "".join(f"{x:.4f};{y:.4f};{k}\n" for k, (x, y) in enumerate(np.random.default_rng(5).normal(size=(200, 2))))
    (tmp_path / "a.csv").write_text(f"force;rail;speed\n{rows}")
    description = dataclasses.replace(IN_SI, channels=(*IN_SI.channels, RawChannel("speed", "speed", "ignored")))
    assert dict(read("a.csv", tmp_path, description).recordings[0].conditions) == {}


@pytest.mark.parametrize("value", ["-999", "9999", "-273.15 °C", "999 °F", "-32768"])
def test_a_code_in_place_of_a_temperature_is_reported_and_not_used(value, tmp_path):
    conditions, reasons = read_table(tmp_path, f"rail_temperature: {value}")
    assert conditions == {} and "condition_lost" in reasons
    np.savez(tmp_path / "a.npz", force=np.arange(9.0) % 4, rail=np.arange(9.0) % 5, rail_temperature=value)
    result = read("a.npz", tmp_path, IN_SI)
    assert dict(result.recordings[0].conditions) == {}
    assert "condition_lost" in [error.reason for error in result.errors]


@pytest.mark.parametrize("value", ["-", "n/a", "unknown"])
def test_no_value_of_a_temperature_is_no_condition(value, tmp_path):
    assert read_table(tmp_path, f"rail_temperature: {value}") == ({}, [])


@pytest.mark.parametrize(
    ("line", "condition", "value"),
    [
        ("Schienentemperatur: 12,5 °C", "rail_temperature", 12.5),
        ("Schienentemperatur [°C]: 12.5", "rail_temperature", 12.5),
        ("rail_temperature_f: 54.5", "rail_temperature", pytest.approx(12.5)),
        ("rail temp: 12.5 °C", "rail_temperature", 12.5),
        ("Skinnetemperatur: 285.65 K", "rail_temperature", pytest.approx(12.5)),
        ("Température du rail: 31 °C", "rail_temperature", 31.0),
        ("Lufttemperatur: 20 °C", "air_temperature", 20.0),
    ],
)
def test_a_temperature_of_the_rail_or_the_air_in_other_words_is_read(line, condition, value, tmp_path):
    assert read_table(tmp_path, line) == ({condition: value}, [])


@pytest.mark.parametrize(
    "line",
    [
        *["Geschwindigkeit: 80 km/h", "Train speed: 80 km/h", "Schienentemperatur: 12 Grad Re"],
        "Schienentemperatur links: 12 °C\nSchienentemperatur rechts: 13 °C",
    ],
)
def test_a_condition_under_another_name_is_reported(line, tmp_path):
    conditions, reasons = read_table(tmp_path, line)
    assert conditions == {} and reasons == ["condition_lost"]
    names = tuple(entry.partition(":")[0] for entry in line.splitlines())
    checked = dataclasses.replace(IN_SI, checked_entries=names)
    assert read_table(tmp_path, line, checked) == ({}, [])


@pytest.mark.parametrize(
    "line",
    [
        *["Rail neutral temperature: 25 °C", "Line speed: 120 km/h", "Wind speed: 5 m/s", "Logger temperature: 31 °C"],
        *["Schienentemperatur: n/a", "Geschwindigkeit: hoch", "rail_temperature: 12 °C\nSchienentemperatur: 12 °C"],
    ],
)
def test_other_temperatures_and_speeds_are_not_reported(line, tmp_path):
    assert "condition_lost" not in read_table(tmp_path, line)[1]
