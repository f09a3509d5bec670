"""Channels that a layout exchanges are found by the names and descriptions of the sensors in the file."""

import h5py
import nptdms
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

SAMPLES = np.random.default_rng(7).normal(size=(2, 40)).round(4) * [[900.0], [30.0]]


def outcome(path, first=0, second=1, unit="N"):
    """Message for a layout that uses the first channel as the force, "" if the file is read."""
    sensors = (RawChannel("force", first, "force", unit=unit), RawChannel("rail", second, "acceleration", unit="m/s²"))
    result = read(path.name, path.parent, RawDescription(sensors, rate=1e3))
    assert len(result.recordings) + len(result.errors) == 1
    if result.errors:
        assert result.errors[0].reason == "unit_unknown" and "the file describes them as" in str(result.errors[0])
    else:
        assert result.recordings[0].samples == pytest.approx(SAMPLES)
    return str(*result.errors)


NAMES = {
    "force;rail": False, "Kraft;Beschleunigung": False, "CH1;CH2": False, "hammer acc;acc": False, "rail;web": False,
    "force;force 2": False, "Volt 1;Volt 2": False, "rail;force": True, "Beschleunigung;Kraft": True,
    "Acc rail;Hammer": True, "acc;hammer acc": False, "Acc;Velocity": False,
}  # fmt: skip


@pytest.mark.parametrize("names", NAMES)
def test_names_of_exchanged_force_and_response_contradict_a_layout_by_numbers(names, tmp_path):
    """Formerly, the response was read as the force without a message."""
    rows = "".join(f"{f};{a}\n" for f, a in SAMPLES.T)
    (tmp_path / "a.csv").write_text(f"{names}\n{rows}", encoding="utf-8")
    assert bool(outcome(tmp_path / "a.csv")) == NAMES[names]
    assert not outcome(tmp_path / "a.csv", unit="N!")


HEADS = {
    "CH1: hammer\nCH2: rail": False, "CH1: rail\nCH2: rail 2": False, "CH1: rail": False,
    "CH1: rail\nCH2: force": True, "CH1 sensor: accelerometer\nCH2 sensor: hammer": True,
    "Channel;CH1;CH2\nSensor;Accelerometer;Hammer": True, "Channel;CH1;CH2\nSensor;Hammer;Accelerometer": False,
    "CH1 name: Beschleunigung\nCH2 name: Kraft": True, "CH1 range: acceleration\nCH2 range: force": False,
}  # fmt: skip


@pytest.mark.parametrize("head", HEADS)
def test_a_table_of_channels_contradicts_a_layout_with_exchanged_channels(head, tmp_path):
    rows = "".join(f"{f};{a}\n" for f, a in SAMPLES.T)
    (tmp_path / "a.csv").write_text(f"{head}\nCH1;CH2\n{rows}", encoding="utf-8")
    assert bool(outcome(tmp_path / "a.csv", "CH1", "CH2")) == HEADS[head]


def test_two_channels_of_one_quantity_are_not_reported_as_exchanged(tmp_path):
    (tmp_path / "a.csv").write_text("acc 1;acc 2\n" + "".join(f"{a};{b}\n" for a, b in SAMPLES.T))
    sensors = tuple(RawChannel(f"rail{i}", i, "acceleration", "m/s²") for i in (1, 0))
    assert not read("a.csv", tmp_path, RawDescription(sensors, rate=1e3)).errors


@pytest.mark.parametrize("label", ["Sensor;", "Sensor;clock;"])
@pytest.mark.parametrize("texts", ["Accelerometer;Hammer", "Hammer;Accelerometer"])
def test_a_line_of_sensors_has_one_entry_per_column_with_or_without_the_time(label, texts, tmp_path):
    rows = "".join(f"{k / 1e3};{f};{a}\n" for k, (f, a) in enumerate(SAMPLES.T))
    (tmp_path / "a.csv").write_text(f"{label}{texts}\ntime [s];CH1;CH2\n{rows}", encoding="utf-8")
    assert bool(outcome(tmp_path / "a.csv", "CH1", "CH2")) == texts.startswith("Acc")


@pytest.mark.parametrize("is_bytes", [False, True])
def test_an_array_of_texts_describes_the_channels(is_bytes, tmp_path):
    for texts in (["accelerometer", "hammer"], ["hammer", "accelerometer"]):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["CH1"], file["CH2"] = SAMPLES
            file.attrs["sensors"] = np.array(texts, dtype="S") if is_bytes else texts
        assert bool(outcome(tmp_path / "a.h5", "CH1", "CH2")) == texts[0].startswith("acc")


def test_each_record_is_compared_with_its_own_descriptions(tmp_path):
    """Formerly, those of the first record were used for all records with the same names and units."""
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        for group, texts in (("1", ("hammer", "accelerometer")), ("2", ("accelerometer", "hammer"))):
            channels = zip(("CH1", "CH2"), SAMPLES, texts)
            writer.write_segment([nptdms.ChannelObject(group, c, x, {"sensor": text}) for c, x, text in channels])
    sensors = RawChannel("force", "CH1", "force", "N"), RawChannel("rail", "CH2", "acceleration", "m/s²")
    result = read("a.tdms", tmp_path, RawDescription(sensors, rate=1e3))
    assert len(result.recordings) == 1 and "record 2 of 2: the layout takes" in str(*result.errors)


@pytest.mark.parametrize("name", ["description", "NI_ChannelName", "comment", "serial"])
def test_properties_of_a_channel_are_used_as_its_description(name, tmp_path):
    for texts in (("accelerometer", "impact hammer"), ("impact hammer", "accelerometer")):
        with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
            properties = [{name: text} for text in texts]
            channels = zip(("CH1", "CH2"), SAMPLES, properties)
            writer.write_segment([nptdms.ChannelObject("g", *channel) for channel in channels])
        is_exchanged = texts[0].startswith("acc") and name != "serial"
        assert bool(outcome(tmp_path / "a.tdms", "CH1", "CH2")) == is_exchanged
