"""Polarities and gains in words that no list has: they are reported, and those that change nothing are not."""

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.inversions import leaves_sign
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
FORCE, RAIL = np.random.default_rng(11).normal(size=(2, 400))
IN_SI = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
    rate=RATE,
)


def outcome(name, root):
    """(number of records, reasons of the errors)."""
    try:
        result = read(name, root, IN_SI)
    except ReadError as error:
        return 0, [error.reason]
    return len(result.recordings), [error.reason for error in result.errors]


def table(tmp_path, head):
    rows = "".join(f"{f:.5f};{r:.5f}\n" for f, r in zip(FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"{head}\nforce;rail\n{rows}", encoding="utf-8")
    return "a.csv"


REVERSED = [
    *["minus", "opposite", "180", "180°", "-180 deg", "umgepolt", "verpolt", "négatif", "omvendt", "záporná", "ujemna"],
    *["(-)", "N", "wahr", "vrai", "ano", "tak", "T", "Y", "enabled", "rail", "2", "obrnuto", "käännetty", "逆", "ters"],
]


@pytest.mark.parametrize("value", REVERSED)
def test_a_polarity_that_is_not_known_as_the_normal_one_is_reported(value, tmp_path):
    assert outcome(table(tmp_path, f"rail polarity: {value}"), tmp_path) == (0, ["scale_unknown"])


@pytest.mark.parametrize(
    "value",
    [
        *["normal", "Normalna", "+", "+1", "positive", "Positiv", "kladná", "no", "Nein", "non", "false", "0", "0.0"],
        *[
            "off",
            "none",
            "0°",
            "not inverted",
            "nicht invertiert",
            "non-inverting",
            "in phase",
            "n/a",
            "unknown",
            "12.7",
        ],
    ],
)
def test_a_polarity_that_changes_nothing_is_not_reported(value, tmp_path):
    assert outcome(table(tmp_path, f"rail polarity: {value}"), tmp_path) == (1, [])


@pytest.mark.parametrize(
    "line",
    [
        *["Inverted channels: rail", "Channels inverted: 2", "rail: umgepolt", "rail umgepolt", "Phase rail: 180"],
        *["Phasenlage rail: 180°", "Vorzeichen umgekehrt", "Vorzeichen des Sensors anders", "rail x -1", "rail × -1"],
        *["Polaryzacja: odwrócona", "Inverze: ano", "rail opposite polarity"],
    ],
)
def test_a_line_about_a_reversed_channel_is_reported(line, tmp_path):
    assert outcome(table(tmp_path, line), tmp_path) == (0, ["scale_unknown"])


@pytest.mark.parametrize(
    "line",
    [
        *[
            "Inverted channels: none",
            "Phase: 2",
            "Phase of works: tamping",
            "Vorzeichen normal",
        ],
        *["sensor on the opposite rail", "sensor at x -1 m", "Trigger polarity: negative"],
    ],
)
def test_a_line_about_something_else_is_not_reported(line, tmp_path):
    assert outcome(table(tmp_path, line), tmp_path) == (1, [])


@pytest.mark.parametrize("value", ["Minus", "opposite", "ano", -1.0, True])
def test_a_polarity_in_tdms_and_hdf5_is_reported(value, tmp_path):
    step = {"wf_increment": 1.0 / RATE}
    with TdmsWriter(str(tmp_path / "a.tdms")) as file:
        rail = ChannelObject("g", "rail", RAIL, step | {"Polarity": value})
        file.write_segment([ChannelObject("g", "force", FORCE, step), rail])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["fs"] = RATE
        file["force"], file["rail"] = FORCE, RAIL
        file["rail"].attrs["Inverted"] = value
    assert outcome("a.tdms", tmp_path) == outcome("a.h5", tmp_path) == (0, ["scale_unknown"])


def test_the_numbers_of_flags_channels_and_half_turns_are_not_neutral():
    assert not any(map(leaves_sign, ("1", "-1", "2", "64", "180", "-180", "1.0")))
    assert all(map(leaves_sign, ("0", "-0.0", "+1", "90.5", "25600", "-7")))


@pytest.mark.parametrize(
    "value",
    [
        "10 (auto)",
        "10 fach",
        "10 nominal",
        "HIGH (10)",
        "ein (10)",
        "on, 10",
        "ten",
        "hoch",
        "zehn",
        "poz. 3",
        "stufe B",
    ],
)
@pytest.mark.parametrize("name", ["Gain rail", "Verstärkung rail", "Zesílení rail"])
def test_a_gain_that_is_not_understood_is_reported(name, value, tmp_path):
    assert outcome(table(tmp_path, f"{name}: {value}"), tmp_path) == (0, ["scale_unknown"])


@pytest.mark.parametrize(
    "line",
    [
        *["Gain rail: 1", "Gain rail: 1 (fixed)", "Gain rail: 0 dB, fest", "Gain rail: x1", "Gain rail: off"],
        *["Gain rail: n/a", "Gain unit: dB", "Verstärker: Nexus", "Amplificateur: type B", "Gain control: manual"],
    ],
)
def test_a_gain_of_one_and_the_amplifier_itself_are_not_reported(line, tmp_path):
    assert outcome(table(tmp_path, line), tmp_path) == (1, [])
