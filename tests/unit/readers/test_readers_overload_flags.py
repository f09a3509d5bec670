"""An overload that the logger recorded in the file is reported, whatever the samples are."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.readers.entries import Entry
from turnout.readers.overload_flags import overload_entries
from turnout.records import RawChannel, RawDescription

SAMPLES = np.sin(np.arange(400) / 9)


def remarks(tmp_path, name, value, checked=()):
    np.savez(tmp_path / "a.npz", force=SAMPLES, rate=1000.0, **{name: value})
    channel = RawChannel("force", "force", "force", unit="N")
    result = read("a.npz", tmp_path, RawDescription((channel,), rate=1000.0, checked_entries=checked))
    assert len(result.recordings) == 1
    return [error for error in result.errors if "left its range" in str(error)]


@pytest.mark.parametrize("name", ["Overload", "overflow", "ADC_overrange", "Clipped", "uebersteuert", "Übersteuerung"])
@pytest.mark.parametrize("value", [True, 1.0, 3, "yes", np.array([False, True])])
def test_an_overload_that_the_file_states_is_reported(name, value, tmp_path):
    (error,) = remarks(tmp_path, name, value)
    assert error.reason == "entry_unknown" and f"'{name}: " in str(error)
    assert not remarks(tmp_path, name, value, checked=(name,))


@pytest.mark.parametrize(
    ("name", "value"),
    [("Overload", False), ("Overload", 0), ("Overload", "no"), ("overload_level", 10.0), ("clipping_detection", True)],
)
def test_no_overload_is_reported_if_the_file_states_none(name, value, tmp_path):
    assert not remarks(tmp_path, name, value)


STATEMENTS = [
    ("Overload", "CH2"),
    ("Overload", "ch 1, ch 2"),
    ("Overload", "0,1"),
    ("Overflow", "force"),
    ("Status", "overload"),
    ("Status", "OVLD channel 2"),
    ("Quality", np.array("Übersteuerung Kanal 1")),
    ("Status", "CH1 ok, CH2 overload"),
    ("Overload", "CH1 no, CH2 yes"),
    ("Overload", "rail, force"),
    ("Overload", "channel force"),
    ("Overload", "1.0"),
    ("Overload", "ch1=0 ch2=1"),
    ("Remark", "signal clipped"),
    ("Remark", "force saturated"),
]


@pytest.mark.parametrize(("name", "value"), STATEMENTS)
def test_an_overload_of_a_channel_and_one_in_a_value_are_reported(name, value, tmp_path):
    (error,) = remarks(tmp_path, name, value)
    assert error.reason == "entry_unknown"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Overload", "0,0"),
        ("Overload", "none"),
        ("Overload", "no channel"),
        ("Status", "no overload"),
        ("Status", "Overload limit 10 V"),
        ("Status", "0 overloads"),
        ("Overload", "0.0"),
        ("Overload", ""),
        ("Overload", "sensor"),
        ("Status", "overload 5 kN"),
        ("Overload", "ch1: 0, ch2: 0"),
        ("Overload", "force ok"),
        ("Mounting", "clipped to rail foot"),
        ("Ballast", "saturated"),
        ("Comment", "ballast saturated with water"),
        ("Train", "freight, overloaded"),
        ("Sensor", "overload protected accelerometer"),
        ("Overload protection", "on"),
        ("Overload factor", 1.5),
        ("Comment", "the sensor that showed an overload last year was replaced"),
    ],
)
def test_a_text_that_denies_an_overload_or_concerns_something_else_is_not_reported(name, value, tmp_path):
    assert not remarks(tmp_path, name, value)


def test_a_number_or_a_missing_value_is_not_read_as_the_name_of_a_channel():
    for value, names in (("0", ("0", "1")), ("0;0", ("0", "1")), ("n/a", ("n", "a"))):
        assert not list(overload_entries([Entry("head", "Overload", value)], names))


@pytest.mark.parametrize(
    ("line", "is_above"),
    [
        ("CH2 overload", True),
        ("Overload: CH2", False),
        ("OVLD ch 2", False),
        ("Overload;0;1", True),
        ("Overload;0.0;1.0", True),
    ],
)
def test_an_overload_above_or_below_the_numbers_of_a_text_is_reported(line, is_above, tmp_path):
    lines = ["force [N]", *(f"{x:.6f}" for x in SAMPLES)]
    lines.insert(0 if is_above else len(lines), line)
    if ";" in line:
        lines = [text if text == line else f"{text};{text}".replace("N];force", "N];rail") for text in lines]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    channels = [RawChannel(name, name, "force", unit="N") for name in ("force", "rail")[: 1 + (";" in line)]]
    result = read("a.csv", tmp_path, RawDescription(tuple(channels), rate=1000.0))
    assert [error.reason for error in result.errors] == ["entry_unknown"]
    assert "left its range" in str(result.errors[0])
