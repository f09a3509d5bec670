"""Every format with each place of a unit: right, wrong or overridden. A contradiction of the layout is an error."""

import json
from dataclasses import replace

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from tests.unit.readers.test_readers_rate_matrix import SAMPLES, SENSORS, TRUE, plain

from turnout.errors import ReadError
from turnout.readers import names_and_units, read
from turnout.records import RawChannel, RawDescription

KEYS = (
    "unit", "Units", "Unit_Label", "y_unit", "YUnit", "EU", "uom", "Einheit", "Messeinheit", "unité", "enhed",
    "unidad", "unità",
)  # fmt: skip
RIGHT = ("N", "m/s^2")


def write_tdms(path, key, units):
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("impact", s.name, x, {key: u}) for s, x, u in zip(SENSORS, SAMPLES, units)]
        )


def write_hdf5(path, key, units):
    with h5py.File(path, "w") as file:
        for sensor, x, unit in zip(SENSORS, SAMPLES, units):
            file[sensor.name] = x
            file[sensor.name].attrs[key] = unit


def write_parquet(path, key, units):
    fields = [pa.field(s.name, pa.float64(), metadata={key: u}) for s, u in zip(SENSORS, units)]
    pq.write_table(pa.table(list(SAMPLES), schema=pa.schema(fields)), path)


def write_npz(path, key, units):
    info = {"sensors": [{"name": s.name, key: u} for s, u in zip(SENSORS, units)]}
    np.savez(path, force=SAMPLES[0], rail=SAMPLES[1], info=np.array(json.dumps(info)))


def write_mat(path, key, units):
    variables = {"force": SAMPLES[0], "rail": SAMPLES[1]}
    scipy.io.savemat(path, variables | {"Info": {key: np.array(units, dtype=object)}})


def write_csv(path, key, units):
    rows = "\n".join(f"{f:.12g};{a:.12g}" for f, a in SAMPLES.T)
    path.write_text(f"{key};{';'.join(units)}\nforce;rail\n{rows}\n", encoding="utf-8")


FORMATS = {
    "tdms": (write_tdms, "a.tdms"), "hdf5": (write_hdf5, "a.h5"), "parquet": (write_parquet, "a.parquet"),
    "npz": (write_npz, "a.npz"), "mat": (write_mat, "a.mat"), "csv": (write_csv, "a.csv"),
}  # fmt: skip


def outcome(path, sensors=SENSORS):
    """Samples of the only record, or its error."""
    try:
        result = read(path.name, path.parent, RawDescription(sensors, rate=TRUE))
    except ReadError as error:
        return error
    return result.errors[0] if result.errors else result.recordings[0].samples


def is_read(found):
    return not isinstance(found, ReadError) and np.allclose(found, SAMPLES, rtol=1e-9, atol=1e-9)


def is_rejected(found, unit):
    return isinstance(found, ReadError) and found.reason == "unit_unknown" and repr(unit) in str(found)


@pytest.mark.parametrize("format", FORMATS)
def test_a_unit_under_any_name_is_compared_with_the_layout(format, tmp_path):
    write_file, name = FORMATS[format]
    path, failures = tmp_path / name, []
    for key in KEYS:
        if format == "mat" and not key.isascii():
            continue
        write_file(path, key, RIGHT)
        found = outcome(path)
        cases = {"right": is_read(found)}
        cases["shown"] = [u for _, u in names_and_units(path.name, tmp_path)] == list(RIGHT)
        unstated = outcome(path, tuple(replace(s, unit=None) for s in SENSORS))
        cases["no unit in the layout"] = not isinstance(unstated, ReadError)
        for wrong in ("g", "mg", "mm/s²", "V", "counts", "dB", "m/s"):
            write_file(path, key, ("N", wrong))
            cases[wrong] = is_rejected(outcome(path), wrong)
            overridden = outcome(path, (SENSORS[0], replace(SENSORS[1], unit="m/s²!")))
            cases[f"{wrong} overruled"] = not isinstance(overridden, ReadError)
        failures += [f"{key}: {case}" for case, ok in cases.items() if not ok]
    assert failures == []


NAMES = {  # name of the channel in the file: unit that it states
    "rail [g]": "g", "rail (mV)": "mV", "rail {mm/s²}": "mm/s²", "rail [dB]": "dB", "rail_g": "g", "rail_mV": "mV",
    "rail mm_s2": "mm/s2", "rail_counts": "counts", "rail [g] 2": "g", "(mg) rail": "mg", "rail|g": "g", "rail [g": "g",
    "rail_g_raw": "g", "rail_2_g_raw": "g", "A1 g 2": "g", "a=mg": "mg", "g": "g", "mm/s²": "mm/s²",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_unit_in_the_name_of_a_channel_is_compared_with_the_layout(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{"force": SAMPLES[0], name: SAMPLES[1]})
    sensor = replace(SENSORS[1], source=name)
    assert is_rejected(outcome(tmp_path / "a.npz", (SENSORS[0], sensor)), NAMES[name])
    overridden = outcome(tmp_path / "a.npz", (SENSORS[0], replace(sensor, unit="m/s²!")))
    assert is_read(overridden)


@pytest.mark.parametrize(
    "name",
    [
        "rail [m/s²]",
        "rail_left",
        "rail [10 g]",
        "rail (left)",
        "rail_m",
        "rail 2",
        "rail_C",
        "rail [m/s²] 2",
        "G 2 m",
        "rail G 2",
        "rail 50 g 2",
        "50g rail",
        "mV/g rail",
        "10 mV/g rail",
        "rail ±50,5 g left",
    ],
)
def test_a_name_without_another_unit_of_the_channel_is_accepted(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{"force": SAMPLES[0], name: SAMPLES[1]})
    assert is_read(outcome(tmp_path / "a.npz", (SENSORS[0], replace(SENSORS[1], source=name))))


@pytest.mark.parametrize("name", ["rail_{}", "{}", "rail {} 2"])
def test_letters_that_number_the_channels_are_not_read_as_units(name, tmp_path):
    names = [name.format(letter) for letter in "fg"]
    np.savez(tmp_path / "a.npz", **dict(zip(names, SAMPLES)))
    sensors = tuple(RawChannel(n, n, "acceleration", unit="m/s²") for n in names)
    assert is_read(outcome(tmp_path / "a.npz", sensors))


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("rail/(m/s^2)", "rail", "m/s^2"), ("a_z_(g)", "a_z_", "g"), ("rail / [g]", "rail", "g"),
        ("Rail [g] (ch 2)", "Rail [g] (ch 2)", "g"), ("[g] rail", "[g] rail", "g"), ("rail (ch 2)", "rail", "ch 2"),
    ],
)  # fmt: skip
def test_a_unit_in_brackets_anywhere_in_a_column_name_is_read(cell, name, unit, tmp_path):
    rows = "\n".join(f"{f:.12g};{a:.12g}" for f, a in SAMPLES.T)
    (tmp_path / "a.csv").write_text(f"force [N];{cell}\n{rows}\n", encoding="utf-8")
    assert names_and_units("a.csv", tmp_path) == (("force", "N"), (name, unit))


@pytest.mark.parametrize(
    ("entry", "unit"),
    [("unit", "g"), ("Einheit", "mm/s²"), ("unit", "dB"), ("unit", "V"), ("time unit", "g"), ("Sensitivity unit", "g"),
     ("Test unit", "B"), ("unit", "m/s²"), ("unit", "°C")],
)  # fmt: skip
def test_a_unit_without_a_channel_is_used_for_its_own_quantity(entry, unit, tmp_path):
    np.savez(tmp_path / "a.npz", force=SAMPLES[0], rail=SAMPLES[1], info=np.array(json.dumps({"setup": {entry: unit}})))
    found = outcome(tmp_path / "a.npz")
    if entry in ("unit", "Einheit") and unit in ("g", "mm/s²", "dB"):
        assert is_rejected(found, unit)
    elif (entry, unit) == ("unit", "V"):  # it may be the unit of the sensor signal
        assert found.reason == "entry_unknown"
    else:
        assert is_read(found)


def test_two_units_of_one_channel_are_reported(tmp_path):
    write_hdf5(tmp_path / "a.h5", "units", ("N", "m/s²"))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["force"].attrs["Einheit"] = "kN"
    found = outcome(tmp_path / "a.h5")
    assert is_rejected(found, "kN") and "'N'" in str(found)


QUANTITIES = {
    "Quantity": ("Force", "Acceleration"),
    "Messgröße": ("Kraft", "Beschleunigung"),
    "sensor_type": ("force", "IEPE accelerometer"),
    "grandeur": ("force", "accélération"),
}


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("key", QUANTITIES)
def test_a_stated_quantity_must_be_that_of_the_layout(format, key, tmp_path):
    """The quantity is right, a displacement, exchanged with the other sensor, or overridden."""
    writer, name = FORMATS[format]
    key_in_file = plain(key) if format == "mat" else key
    right = QUANTITIES[key]
    for texts, is_right in ((right, True), ((right[0], "Displacement"), False), (right[::-1], False)):
        writer(tmp_path / name, key_in_file, texts)
        found = outcome(tmp_path / name)
        if is_right:
            assert is_read(found), (key, texts)
        else:
            assert isinstance(found, ReadError) and found.reason == "unit_unknown" and "quantity" in str(found), texts
            assert is_read(outcome(tmp_path / name, tuple(replace(s, unit=f"{s.unit}!") for s in SENSORS)))
