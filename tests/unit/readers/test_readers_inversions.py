"""Polarities and gains in words that no list has: they are reported, and those that change nothing are not."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.inversions import stated_sign
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
    *[
        "(-)",
        "-",
        "-1",
        "−1",
        "reversed",
        "normal, flipped for rail",
        "vertauscht",
        "swapped (2024)",
        "gedreht",
        "przeciwna",
    ],
    *[
        "not as usual: inverted",
        "not standard but inverted",
        "in reverse",
        "un canal inversé",
        "inverted (positive = down)",
    ],
]
UNCLEAR = [
    *["N", "wahr", "T", "Y", "enabled", "rail", "2", "obrnuto", "käännetty", "ters", "ISO", "see protocol"],
    *["not normal", "nicht geprüft", "逆", "see protocol no. 5", "positive down", "tension positive", "ne normální"],
]


@pytest.mark.parametrize("value", REVERSED)
def test_a_polarity_with_a_word_or_number_of_an_inversion_is_an_error(value, tmp_path):
    assert outcome(table(tmp_path, f"rail polarity: {value}"), tmp_path) == (0, ["scale_unknown"])


@pytest.mark.parametrize("value", UNCLEAR)
def test_a_polarity_that_is_not_understood_is_a_remark(value, tmp_path):
    """Formerly, it was refused, as many that mean the normal polarity."""
    assert outcome(table(tmp_path, f"rail polarity: {value}"), tmp_path) == (1, ["entry_unknown"])


@pytest.mark.parametrize("value", ["yes", "1", "true", "ja", "wahr", "vrai", "ano", "tak", "T", "Y", "enabled", "2"])
def test_a_channel_that_is_said_to_be_inverted_is_an_error(value, tmp_path):
    assert outcome(table(tmp_path, f"rail inverted: {value}"), tmp_path) == (0, ["scale_unknown"])


@pytest.mark.parametrize("line", ["Polarity: minus", "Polarity: ISO", "Inverted: yes", "Polarity: -1", "Sign: -"])
def test_a_polarity_that_the_layout_declares_checked_is_not_reported(line, tmp_path):
    name = table(tmp_path, line)
    checked = replace(IN_SI, checked_entries=(line.split(":")[0],))
    result = read(name, tmp_path, checked)
    assert len(result.recordings) == 1 and not result.errors


@pytest.mark.parametrize(
    "line",
    [
        *["Sign: JH", "Sign: N", "Sign: KN", "Segno: A", "Signo: A", "Sign-off: JH", "Sign convention: ISO 2041"],
        *["Sign convention: up is positive", "Road sign: 12", "Call sign: OE3", "Signal sign: V2", "Sign: +"],
        *["Note: polarity checked", "Note: polarity ok", "Polarität geprüft", "Note: power supply polarity checked"],
        *["Bemerkung: Polarität aller Kanäle kontrolliert", "Remark: all polarities verified before test"],
        *["Phase A: 180", "Phase reference: 180", "Start phase: 180°", "Inverted: N", "Inverted: -", "Inverted: +1"],
    ],
)
def test_initials_and_checks_are_no_statement_about_the_sign(line, tmp_path):
    assert outcome(table(tmp_path, line), tmp_path) == (1, [])


@pytest.mark.parametrize(
    "line", ["Note: Vorzeichen laut Anlage", "Remark: polarity ISO", "Sign convention: compression negative"]
)
def test_a_note_about_a_polarity_that_is_not_understood_is_a_remark(line, tmp_path):
    assert outcome(table(tmp_path, line), tmp_path) == (1, ["entry_unknown"])


@pytest.mark.parametrize("name", ["polarity", "inverted", "sign", "invert"])
@pytest.mark.parametrize("value", ["normal", "+", "no", False, [False, False], [b"normal", b"normal"]])
def test_a_data_set_of_hdf5_about_the_polarity_is_read(name, value, tmp_path):
    """Formerly, a file with one was always refused, for its attributes."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["fs"] = RATE
        file["force"], file["rail"] = FORCE, RAIL
        file[name] = value
    assert outcome("a.h5", tmp_path) == (1, [])
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.attrs["fs"] = RATE
        file["force"], file["rail"], file[name] = FORCE, RAIL, "-1"
    assert outcome("b.h5", tmp_path) == (0, ["scale_unknown"])


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
            "(+)",
            "OK",
            "checked",
            "verified",
            "Normal (not inverted)",
            "normal / positive",
            "norm",
            "Std",
            "as is",
            "as standard",
            "+Z",
            "up",
            "upwards",
            "positive up",
            "positive = up",
            "compression positive",
            "bipolar",
            "aucune inversion",
            "keine Umkehrung",
            "no phase inversion",
            "unipolar",
            "nicht umgekehrt",
            "unverändert",
            "tension negative, compression positive",
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


@pytest.mark.parametrize(("value", "is_reversed"), [("Minus", True), ("opposite", True), (-1.0, True), (True, False)])
def test_a_polarity_in_tdms_and_hdf5_is_reported(value, is_reversed, tmp_path):
    """A flag says that a channel is inverted only under such a name."""
    step = {"wf_increment": 1.0 / RATE}
    with TdmsWriter(str(tmp_path / "a.tdms")) as file:
        rail = ChannelObject("g", "rail", RAIL, step | {"Polarity": value})
        file.write_segment([ChannelObject("g", "force", FORCE, step), rail])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["fs"] = RATE
        file["force"], file["rail"] = FORCE, RAIL
        file["rail"].attrs["Inverted"] = value
    assert outcome("a.h5", tmp_path) == (0, ["scale_unknown"])
    assert outcome("a.tdms", tmp_path) == ((0, ["scale_unknown"]) if is_reversed else (1, ["entry_unknown"]))


def test_the_numbers_of_flags_channels_and_half_turns_are_not_neutral():
    signs = [stated_sign("Inverted", text) for text in ("1", "-1", "2", "64", "180", "-180", "1.0")]
    assert set(signs) == {-1.0}
    assert {stated_sign("Inverted", text) for text in ("0", "-0.0", "+1e3", "90.5", "25600", "-7")} == {1.0}
    assert [stated_sign("Polarity", text) for text in ("+1", "1", "-1", "180")] == [1.0, 0.0, -1.0, -1.0]


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
