"""RCM-DX by its specification 2.0.2: written files have its groups and types; files of other programs are read."""

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import RawChannel, RawDescription

START = 1_715_594_401_250_000_000  # ns since 1970: 2024-05-13 10:00:01.25 UTC

# Group (path pattern by element) -> attribute -> kind and bytes, from the tables of the specification.
CHANNEL_ATTRIBUTES = {
    "TriggerMode": "text", "CommonTriggerDistance": "f8", "CommonTriggerFrequency": "f8", "ChannelBasis": "text",
    "MoveDirAutoInvert": "i1", "MeasurementType": "text", "Neighbor": "text", "PositionOffset": "f4", "Element": "text",
}  # fmt: skip


def kind_of(value):
    return "text" if isinstance(value, (str, bytes)) else np.asarray(value).dtype.str[1:]


def test_the_groups_and_types_are_those_of_the_specification(hammer_test, in_si, tmp_path):
    write(hammer_test, tmp_path / "a.rcmdx", "rcmdx", in_si)
    with h5py.File(tmp_path / "a.rcmdx") as file:
        root = file["RCMDX"]
        assert {k: kind_of(root.attrs[k]) for k in ("Major", "Minor", "Feature")} == dict.fromkeys(
            ("Major", "Minor", "Feature"), "i2"
        )
        assert root["FILE"].attrs["Element"] == b"File" and "StructureVersion" in root["FILE"].attrs
        (platform,) = [g for g in root.values() if g.attrs.get("Element") == b"Platform"]
        (session,) = platform.values()  # exactly one session in a file
        assert session.name.endswith("/20240513_100001.250")
        assert kind_of(session.attrs["StartTime"]) == kind_of(session.attrs["EndTime"]) == "u8"
        assert session.attrs["StartTime"] == START and {"CONFIGURATION", "SECTIONS"} <= set(session)
        (system,) = [g for g in session.values() if g.attrs.get("Element") == b"System"]
        assert len(system) == len(hammer_test)
        for source in system.values():
            assert source.attrs["Element"] == b"Datasource" and source["timestamp"].dtype == "u8"
            for channel in (source["force"], source["rail"]):
                assert {k: kind_of(channel.attrs[k]) for k in CHANNEL_ATTRIBUTES} == CHANNEL_ATTRIBUTES
                assert len(channel["data"]) == len(source["timestamp"]) and "Unit" in channel["data"].attrs


def file_of_others(path, stamps, feature=4):
    """A file as the specification shows it, with a group and an attribute that a later release might add."""
    with h5py.File(path, "w") as file:
        root = file.create_group("RCMDX")
        root.attrs.update({"Major": np.int16(2), "Minor": np.int16(0), "Feature": np.int16(feature)})
        root.create_group("FILE").attrs["Element"] = "File"
        session = root.create_group("DFZ00/20240513_100001.250")
        session.attrs.update({"Element": "Session", "StartTime": np.uint64(START), "SessionAlias": "x"})
        session.create_group("FUTURE").attrs["Element"] = "Future"
        source = session.create_group("TGMS/ACC")
        source.create_dataset("timestamp", data=np.asarray(stamps, dtype="u8"))
        for name, unit in (("HAMMER", "N"), ("RAIL_L", "m/s^2")):
            channel = source.create_group(name)
            channel.attrs.update({
                "Element": "Channel", "TriggerMode": "TIME", "CommonTriggerDistance": 0.0,
                "CommonTriggerFrequency": 1000.0, "ChannelBasis": "TOTAL", "Neighbor": "",
            })  # fmt: skip
            data = channel.create_dataset("data", data=np.arange(1.0, len(stamps) + 1.0) * (1 + len(name)))
            data.attrs["Unit"] = unit
        distance = session.create_group("TGMS/GAUGE")
        distance.create_dataset("timestamp", data=np.asarray(stamps[:3], dtype="u8"))
        channel = distance.create_group("GAUGE")
        channel.attrs.update({"TriggerMode": "DISTANCE", "CommonTriggerDistance": 0.25})
        channel.create_dataset("data", data=np.ones(3))


IN_FILE = RawDescription(
    (RawChannel("force", "HAMMER", "force"), RawChannel("rail", "RAIL_L", "acceleration")), rate=1000.0
)


def test_a_file_of_a_later_release_is_read(tmp_path):
    file_of_others(tmp_path / "a.rcmdx", START + 1_000_000 * np.arange(50))
    (recording,) = read("a.rcmdx", tmp_path, IN_FILE).recordings
    assert recording.rate == 1000.0 and recording.n_sample == 50
    assert recording.signal("force")[:3] == pytest.approx([7.0, 14.0, 21.0])
    assert f"{recording.started_at:%Y-%m-%d %H:%M:%S.%f}" == "2024-05-13 10:00:01.250000"


def test_unsigned_time_stamps_that_run_backwards_are_an_error(tmp_path):
    stamps = START + 1_000_000 * np.arange(50)
    stamps[30:] -= 40_000_000
    file_of_others(tmp_path / "a.rcmdx", stamps)
    result = read("a.rcmdx", tmp_path, IN_FILE)
    assert result.recordings == () and result.errors[0].reason == "clock_backwards"
