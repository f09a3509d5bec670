"""Responses that were measured against an axis, as the file states, are reported unless the layout has their sign."""

from dataclasses import replace

import h5py
import nptdms
import numpy as np
import pytest
from tests.unit.readers.test_readers_uff import universal_file

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

FORCE = RawChannel("force", "force", "force", unit="N")
RAIL = RawChannel("rail", "rail", "acceleration", unit="m/s²")
SAMPLES = np.random.default_rng(4).normal(size=(2, 64)) * [[900.0], [30.0]]


def remarks(path, rail=RAIL, checked=()):
    result = read(path.name, path.parent, RawDescription((FORCE, rail), rate=25600.0, checked_entries=checked))
    assert result.recordings[0].n_sample == 64
    assert all(error.reason == "entry_unknown" for error in result.errors)
    return [str(error) for error in result.errors]


def test_a_response_in_minus_z_of_a_universal_file_is_reported_once(tmp_path):
    universal_file(tmp_path, (f"rail      {2:10d}{0:4d}", f"rail      {2:10d}{-3:4d}"))
    (remark,) = remarks(tmp_path / "a.uff")
    assert "channel 'rail': its 'response direction' is '2 -Z'" in remark and "Set 'sign: -1'" in remark
    assert remarks(tmp_path / "a.uff", replace(RAIL, sign=-1)) == []
    assert remarks(tmp_path / "a.uff", checked=("response direction",)) == []


ENTRIES = {
    ("direction", "-Z"): True, ("Orientation", "Z-"): True, ("dof", "12:-Z"): True, ("mounting", "upside down"): True,
    ("Messrichtung", "nach unten"): True, ("axis", "neg_z"): True, ("Direction", "\u2212Y"): True,
    ("direction", "+Z"): False, ("axis", "z"): False, ("mounting", "web of rail"): False, ("direction", "south"): False,
    ("Impact direction", "-Z"): False, ("Anregungsrichtung", "-Z"): False, ("Driving direction", "-X"): False,
    ("direction", "1 - Z"): False, ("direction", "X-/Z-Achse"): False, ("direction", "X- und Z-Achse"): False,
    ("Train direction", "-Z"): False, ("Z axis", "-Z"): False, ("comment", "-Z"): False,
}  # fmt: skip


@pytest.mark.parametrize("name, value", ENTRIES)
@pytest.mark.parametrize("format", ["h5", "tdms"])
def test_a_direction_in_the_metadata_is_reported_for_its_channel(format, name, value, tmp_path):
    path = tmp_path / f"a.{format}"
    if format == "h5":
        with h5py.File(path, "w") as file:
            file["force"], file["rail"] = SAMPLES
            file["force"].attrs[name], file["rail"].attrs[name] = "-Z", value
    else:
        with nptdms.TdmsWriter(str(path)) as writer:
            properties = ({name: "-Z"}, {name: value})
            channels = zip(("force", "rail"), SAMPLES, properties)
            writer.write_segment([nptdms.ChannelObject("impact", *channel) for channel in channels])
    texts = remarks(path)
    assert [f"channel 'rail': its {name!r} is {value!r}" in text for text in texts] == [True] * ENTRIES[name, value]


@pytest.mark.parametrize(
    "name", ["rail -Z", "Rail:12:-Z", "rail_-z", "rail (-Z)", "rail Z-", "neg Z rail", "rail inverted"]
)
def test_a_direction_in_the_name_of_a_channel_is_reported(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{"force": SAMPLES[0], name: SAMPLES[1]})
    (remark,) = remarks(tmp_path / "a.npz", replace(RAIL, source=name))
    assert "its direction is" in remark
    assert remarks(tmp_path / "a.npz", replace(RAIL, source=name, sign=-1)) == []


@pytest.mark.parametrize(
    "name",
    [
        "rail-Z",
        "rail_z",
        "rail +Z",
        "Z-axis",
        "a-x-2",
        "rail non-inverted",
        "rail uninverted",
        "Schiene nicht invertiert",
    ],
)
def test_a_hyphen_in_a_name_is_not_read_as_a_minus(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{"force": SAMPLES[0], name: SAMPLES[1]})
    assert remarks(tmp_path / "a.npz", replace(RAIL, source=name)) == []
