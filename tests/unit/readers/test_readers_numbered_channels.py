"""Units under the name or the number of a channel are used for that channel in every format."""

import json

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

FORCE, RAIL = np.random.default_rng(20261128).normal(size=(2, 60)).round(6)
FORMS = {
    "{} [{}]": ("CH1", "CH2"),
    "{}: {}": ("Ch 1", "Ch 2"),
    "{};{}": ("Kanal 0", "Kanal 1"),
    "{} ({})": ("force", "rail"),
    "{} unit: {}": ("Channel 1", "Channel 2"),
}


def layout(units, sources=("force", "rail")):
    quantities = ("force", "acceleration")
    channels = (RawChannel(n, s, q, unit=u) for n, s, q, u in zip(("force", "rail"), sources, quantities, units))
    return RawDescription(tuple(channels), rate=1000.0)


def read_text(tmp_path, form, units, description):
    lines = [form.format(name, unit) for name, unit in zip(FORMS[form], units)]
    rows = [f"{a};{b}" for a, b in zip(FORCE, RAIL)]
    (tmp_path / "a.csv").write_text("\n".join([*lines, "force;rail", *rows, ""]), encoding="utf-8")
    return read("a.csv", tmp_path, description)


@pytest.mark.parametrize("form", FORMS)
def test_units_of_numbered_channels_are_those_of_the_columns(form, tmp_path):
    result = read_text(tmp_path, form, ("kN", "g"), layout((None, None)))
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].samples, [1e3 * FORCE, 9.80665 * RAIL], rtol=1e-12)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("units", [("m/s²", "N"), ("N", "g"), ("kN", "m/s²")])
def test_exchanged_or_other_units_contradict_the_layout(form, units, tmp_path):
    result = read_text(tmp_path, form, units, layout(("N", "m/s²")))
    assert [error.reason for error in result.errors] == ["unit_unknown"]
    assert not read_text(tmp_path, form, ("N", "m/s²"), layout(("N", "m/s²"))).errors
    assert not read_text(tmp_path, form, units, layout(("N!", "m/s²!"))).errors


@pytest.mark.parametrize("line", ["Ch2 delay: 2 ms", "Kanal 2 Verzögerung: 0,002 s", "delay ch2: 2 samples"])
def test_a_delay_of_one_numbered_channel_is_used_for_its_column(line, tmp_path):
    rows = [f"{a};{b}" for a, b in zip(FORCE, RAIL)]
    (tmp_path / "a.csv").write_text("\n".join([line, "force;rail", *rows, ""]), encoding="utf-8")
    assert [error.reason for error in read("a.csv", tmp_path, layout(("N", "m/s²"))).errors] == ["clock_drift"]


@pytest.mark.parametrize("lines", [("CH2: N", "CH3: m/s²"), ("Trigger: CH0", "CH1: N", "CH2: m/s²")])
def test_numbers_of_channels_that_do_not_start_at_the_first_are_not_used_for_columns(lines, tmp_path):
    """Formerly, files with the channels 2 and 3, or with a trigger at channel 0, were rejected."""
    rows = [f"{a};{b}" for a, b in zip(FORCE, RAIL)]
    (tmp_path / "a.csv").write_text("\n".join([*lines, "force;rail", *rows, ""]), encoding="utf-8")
    assert not read("a.csv", tmp_path, layout(("N", "m/s²"))).errors


@pytest.mark.parametrize("format", ["h5", "npz"])
def test_a_mapping_of_channels_to_units_is_used_in_other_formats(format, tmp_path):
    for units in ({"force": "N", "rail": "m/s²"}, {"force": "m/s²", "rail": "N"}):
        if format == "h5":
            with h5py.File(tmp_path / "a.h5", "w") as file:
                file["force"], file["rail"] = FORCE, RAIL
                file.create_group("info").attrs.update(units)
        else:
            np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, info=np.array(json.dumps(units)))
        result = read(f"a.{format}", tmp_path, layout(("N", "m/s²")))
        assert [error.reason for error in result.errors] == ["unit_unknown"][: int(units["force"] != "N")]


@pytest.mark.parametrize("line", ["rail side: N", "CH3: kN", "Switch 1: N", "AI0: V"])
def test_a_letter_beside_other_words_is_not_read_as_the_unit_of_the_channel(line, tmp_path):
    rows = [f"{a};{b}" for a, b in zip(FORCE, RAIL)]
    (tmp_path / "a.csv").write_text("\n".join([line, "force [N];rail [m/s²]", *rows, ""]), encoding="utf-8")
    result = read("a.csv", tmp_path, layout(("N", "m/s²")))
    assert not any("channel 'rail'" in error.where or "channel 'force'" in error.where for error in result.errors)
