"""Objects of MATLAB classes and of Python are never read as numbers: each is reported with a way to store it."""

import struct
from dataclasses import replace

import h5py
import numpy as np
import pytest
import scipy.io
from tests.unit.readers.test_readers_exports import FORCE, RAIL, RATE, layout

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

REFERENCE = np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32)
PLACEHOLDER = 7.25
PLAIN = {"force": FORCE, "rail": RAIL, "fs": RATE}
VERSIONS = ["5", "7.3"]


def part(kind, content):
    """An element of a version 5 file."""
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def opaque(name, class_name):
    """An object in a version 5 file: flags of class 17, three names, and the reference to its content."""
    flags = part(6, struct.pack("<II", 17, 0))
    names = b"".join(part(1, text.encode()) for text in (name, "MCOS", class_name))
    numbers = part(6, struct.pack("<II", 13, 0)) + part(5, struct.pack("<ii", 6, 1)) + part(1, b"")
    return part(14, flags + names + part(14, numbers + part(6, REFERENCE.tobytes())))


def write_5(path, plain, objects, nested):
    """A version 5 file of plain variables and objects; with ``nested`` all are fields of one structure."""
    if not nested:
        scipy.io.savemat(path, plain)
        path.write_bytes(path.read_bytes() + b"".join(opaque(name, kind) for name, kind in objects.items()))
        return
    scipy.io.savemat(path, {"data": plain | dict.fromkeys(objects, PLACEHOLDER)})
    data = path.read_bytes()
    for kind in objects.values():
        begin = data.index(struct.pack("<d", PLACEHOLDER)) - 56  # tag, flags, dimensions, name, tag
        element = opaque("", kind)
        data = data[:begin] + element + data[begin + 64 :]
        size = struct.unpack_from("<I", data, 132)[0] + len(element) - 64
        data = data[:132] + struct.pack("<I", size) + data[136:]
    path.write_bytes(data)


def write_73(path, plain, objects, nested):
    """A version 7.3 file of the same content."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("data") if nested else file
        for name, value in plain.items():
            group[name] = np.atleast_2d(value).T
            group[name].attrs["MATLAB_class"] = np.bytes_("double")
        for name, kind in objects.items():
            group[name] = REFERENCE
            group[name].attrs["MATLAB_class"] = np.bytes_(kind)
            group[name].attrs["MATLAB_object_decode"] = np.int32(3)
        file["#subsystem#/MCOS"] = np.arange(400, dtype=np.uint8)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


@pytest.fixture(params=VERSIONS)
def result_of(request, tmp_path):
    """Function that reads a file of plain variables and objects."""

    def result(objects, plain=PLAIN, nested=False, description=None):
        write = write_5 if request.param == "5" else write_73
        write(tmp_path / "A7_1.mat", plain, objects, nested)
        return read("A7_1.mat", tmp_path, description or layout("N", "m/s²"))

    return result


def only_remark(result):
    (recording,) = result.recordings
    np.testing.assert_allclose(recording.signal("force"), FORCE)
    np.testing.assert_allclose(recording.signal("rail"), RAIL)
    assert recording.started_at is None
    (error,) = result.errors
    return error


@pytest.mark.parametrize("nested", [False, True])
def test_a_start_time_that_is_an_object_is_reported_and_not_read_as_a_time(result_of, nested):
    error = only_remark(result_of({"start_time": "datetime"}, nested=nested))
    assert error.reason == "start_unknown"
    assert "'object of the MATLAB class datetime' cannot be read. Store it as text, in MATLAB by char(x" in str(error)


@pytest.mark.parametrize("name", ["AbsoluteTime", "note", "T", "rail_temperature"])
@pytest.mark.parametrize("nested", [False, True])
def test_an_object_beside_plain_samples_is_reported_by_its_name(result_of, name, nested):
    error = only_remark(result_of({name: "string"}, nested=nested))
    assert error.reason == "entry_unknown"
    assert f"{name}' is an object of the MATLAB class string, so its content is not read" in str(error)
    assert f"{name} = cellstr(" in str(error)
    assert f"'checked_entries: {name}'" in str(error)


def test_each_of_several_objects_is_reported(result_of):
    result = result_of({"operator": "string", "day": "datetime", "settings": "containers.Map"})
    assert sorted(str(e).split("'")[1] for e in result.errors) == ["day", "operator", "settings"]


def test_an_object_that_the_layout_declares_checked_is_not_reported(result_of):
    checked = layout("N", "m/s²")
    checked = type(checked)(**{**vars(checked), "checked_entries": ("note",)})
    assert not result_of({"note": "string"}, description=checked).errors


@pytest.mark.parametrize(
    ("name", "kind", "statement"),
    [
        ("units", "string", "cellstr(units)"),
        ("channels", "categorical", "cellstr(channels)"),
        ("time", "duration", "seconds(time)"),
        ("dt", "duration", "seconds(dt)"),
        ("fs", "MyClass", "struct(fs)"),
        ("n_records", "string", "cellstr(n_records)"),
    ],
)
@pytest.mark.parametrize("nested", [False, True])
def test_an_object_that_determines_the_reading_of_samples_is_an_error(result_of, name, kind, statement, nested):
    plain = {"force": FORCE, "rail": RAIL}
    path, variable = ("data/", "data.") if nested else ("", "")
    with pytest.raises(ReadError) as caught:
        result_of({name: kind}, plain, nested)
    expected = (
        f"A7_1.mat, variable '{path}{name}': it is an object of the MATLAB class {kind}, which only MATLAB can read"
    )
    assert expected in str(caught.value)
    assert statement.replace(name, variable + name) in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "statement"),
    [
        ("timetable", "x = table2struct(timetable2table(x), 'ToScalar', true); x.Time = seconds(x.Time - x.Time(1))"),
        ("table", "x = table2struct(x, 'ToScalar', true)"),
        ("timeseries", "x = struct('time', x.Time, 'data', x.Data)"),
    ],
)
@pytest.mark.parametrize("nested", [False, True])
def test_samples_in_an_object_are_an_error_that_states_how_to_store_them(result_of, kind, statement, nested):
    with pytest.raises(ReadError) as caught:
        result_of({"meas": kind}, {"fs": RATE}, nested)
    variable = "data.meas" if nested else "meas"
    assert caught.value.reason == "unreadable"
    assert f"(object of the MATLAB class {kind})" in str(caught.value)
    assert statement.replace("x.", f"{variable}.").replace("x ", f"{variable} ").replace("(x", f"({variable}") in str(
        caught.value
    )


def test_a_unit_of_a_channel_that_is_an_object_is_an_error(tmp_path):
    """Each channel is a structure with its samples and its unit."""
    path = tmp_path / "A7_1.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, samples in (("force", FORCE), ("rail", RAIL)):
            file[f"{name}/data"], file[f"{name}/unit"] = samples[:, None], REFERENCE
            file[f"{name}/unit"].attrs.update(
                {"MATLAB_class": np.bytes_("string"), "MATLAB_object_decode": np.int32(3)}
            )
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    with pytest.raises(ReadError, match=r"variable 'force/unit': it is an object of the MATLAB class string"):
        read(path.name, tmp_path, layout("N", "m/s²"))


def test_the_reference_to_an_object_in_a_cell_of_version_73_is_not_read_as_a_number(tmp_path):
    path = tmp_path / "A7_1.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in PLAIN.items():
            file[name] = np.atleast_2d(value).T
        file["#refs#/a"] = REFERENCE
        file["#refs#/a"].attrs["MATLAB_class"] = np.bytes_("datetime")
        file["start_time"] = np.array([[file["#refs#/a"].ref]], dtype=h5py.ref_dtype)
        file["start_time"].attrs["MATLAB_class"] = np.bytes_("cell")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    error = only_remark(read(path.name, tmp_path, layout("N", "m/s²")))
    assert "'MATLAB object' cannot be read" in str(error)


@pytest.mark.parametrize(
    ("name", "is_read"),
    [("meta", True), ("info", True), ("units", False), ("fs", False), ("names", False), ("gain", False)],
)
def test_a_pickled_variable_of_numpy_is_a_remark_unless_its_name_is_about_the_samples(name, is_read, tmp_path):
    samples = np.random.default_rng(5).normal(size=(2, 200))
    variables = {"force": samples[0], "rail": samples[1], name: np.array({"any": 1}, dtype=object)}
    np.savez(tmp_path / "a.npz", **variables)
    sensors = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²"))
    description = RawDescription(sensors, rate=20000.0)
    if not is_read:
        with pytest.raises(ReadError, match=f"variable '{name}': it holds objects of Python"):
            read("a.npz", tmp_path, description)
        return
    result = read("a.npz", tmp_path, description)
    np.testing.assert_allclose(result.recordings[0].samples, samples)
    assert [e.reason for e in result.errors] == ["entry_unknown"] and repr(name) in str(result.errors[0])
    assert not read("a.npz", tmp_path, replace(description, checked_entries=(name,))).errors
