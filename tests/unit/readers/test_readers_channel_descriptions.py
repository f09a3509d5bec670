"""Channels that a layout exchanges: the file's names and descriptions of its sensors say so."""

import nptdms
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

SAMPLES = np.random.default_rng(7).normal(size=(2, 40)).round(4) * [[900.0], [30.0]]


def outcome(path, first=0, second=1, unit="N"):
    """Problem of a layout that takes the first channel for the force, "" if the file is read."""
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
def test_names_that_exchange_force_and_response_contradict_a_layout_by_numbers(names, tmp_path):
    """Before, the response was read as the force without a message."""
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
def test_a_table_of_channels_contradicts_a_layout_that_exchanges_them(head, tmp_path):
    rows = "".join(f"{f};{a}\n" for f, a in SAMPLES.T)
    (tmp_path / "a.csv").write_text(f"{head}\nCH1;CH2\n{rows}", encoding="utf-8")
    assert bool(outcome(tmp_path / "a.csv", "CH1", "CH2")) == HEADS[head]


@pytest.mark.parametrize("name", ["description", "NI_ChannelName", "comment", "serial"])
def test_properties_of_a_channel_describe_it(name, tmp_path):
    for texts in (("accelerometer", "impact hammer"), ("impact hammer", "accelerometer")):
        with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
            properties = [{name: text} for text in texts]
            channels = zip(("CH1", "CH2"), SAMPLES, properties)
            writer.write_segment([nptdms.ChannelObject("g", *channel) for channel in channels])
        is_exchanged = texts[0].startswith("acc") and name != "serial"
        assert bool(outcome(tmp_path / "a.tdms", "CH1", "CH2")) == is_exchanged
