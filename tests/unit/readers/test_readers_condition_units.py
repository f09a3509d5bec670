"""Temperatures in files are converted to °C from any unit, and a temperature that cannot be read is reported."""

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

FORCE, RAIL = np.random.default_rng(20261128).normal(size=(2, 60)).round(6)
CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
IN_SI = RawDescription(CHANNELS, rate=1000.0)


def read_with(tmp_path, format, entries, lines=()):
    path = tmp_path / f"a.{format}"
    if format == "csv":
        rows = [f"{a};{b}" for a, b in zip(FORCE, RAIL)]
        path.write_text("\n".join([*lines, "force;rail", *rows, ""]), encoding="utf-8")
    elif format == "h5":
        with h5py.File(path, "w") as file:
            file["force"], file["rail"] = FORCE, RAIL
            file.attrs.update(entries)
    else:
        np.savez(path, force=FORCE, rail=RAIL, **{n: np.array(v) for n, v in entries.items()})
    result = read(path.name, tmp_path, IN_SI)
    (recording,) = result.recordings
    return recording.conditions, result.errors


TEXTS = {
    "12.5": 12.5,
    "12,5 °C": 12.5,
    "54.5 °F": 12.5,
    "54.5F": 12.5,
    "285.65 K": 12.5,
    "12.5℃": 12.5,
    "-3 degC": -3.0,
}


@pytest.mark.parametrize("text", TEXTS)
def test_a_temperature_is_converted_from_its_unit(text, tmp_path):
    """Formerly, 54.5 °F were read as 54.5 °C in texts and not at all in other formats, without a message."""
    number = text.rstrip("°CFK℃deg ")
    unit = text.removeprefix(number).strip()
    heads = [f"rail_temperature: {text}", f"# Rail temperature = {text}", f"rail_temperature [{unit}];{number}"]
    cases = [("csv", {}, [line]) for line in heads[: 3 if unit else 2]]
    cases += [(format, {"rail_temperature": text}, ()) for format in ("h5", "npz")]
    if unit and "," not in text:
        value = {"rail_temperature": float(number), "rail_temperature_unit": unit}
        cases += [(format, value, ()) for format in ("h5", "npz")]
    for case in cases:
        conditions, errors = read_with(tmp_path, *case)
        assert conditions["rail_temperature"] == pytest.approx(TEXTS[text], abs=1e-9), case
        assert not errors


@pytest.mark.parametrize(
    "unit",
    ["°c", "c", "ºC", "oC", "deg. C", "degrees C", "degrees Celsius", ";°C", ",°C", "± 0.5 °C", "°C (sensor 2)"],
)
def test_many_notations_of_the_unit_of_a_temperature_are_read(unit, tmp_path):
    """Formerly, a temperature in one of these was lost. The sign of −3 may be a typographic minus."""
    for number, value in (("12.5", 12.5), ("\u22123", -3.0)):
        lines = [f"rail_temperature: {number} {unit}"]
        conditions, errors = read_with(tmp_path, "csv", {}, lines)
        assert conditions["rail_temperature"] == value and not errors


NAMES_OF_UNIT = {
    "temperature_unit": 12.5,
    "Temperature units": 12.5,
    "rail temperature unit": 12.5,
    "rail_temperature_unit_string": 12.5,
    "pad_temperature_unit": 54.5,
}


@pytest.mark.parametrize("name", NAMES_OF_UNIT)
def test_a_common_unit_of_all_temperatures_is_used_for_each(name, tmp_path):
    """Formerly, 54.5 °F were read as 54.5 °C without a message."""
    conditions, _ = read_with(tmp_path, "h5", {"rail_temperature": 54.5, name: "°F"})
    assert conditions["rail_temperature"] == pytest.approx(NAMES_OF_UNIT[name])


@pytest.mark.parametrize("name", ["temperature", "rail_temperature"])
def test_a_unit_of_a_channel_that_is_named_like_a_condition_belongs_to_the_channel(name, tmp_path):
    description = RawDescription((RawChannel(name, name, "temperature", "°C"),), rate=1000.0, kind="passage")
    for stated, reasons in (("°C", []), ("°F", ["unit_unknown"])):
        rows = [f"{a}" for a in FORCE]
        (tmp_path / "a.csv").write_text("\n".join([f"{name}_unit: {stated}", name, *rows, ""]), encoding="utf-8")
        assert [error.reason for error in read("a.csv", tmp_path, description).errors] == reasons


@pytest.mark.parametrize("text", ["twelve", "12.5;13.0", "12.5 bar", "12.5 V", "warm (12)"])
def test_a_temperature_that_cannot_be_read_is_reported(text, tmp_path):
    for case in (("csv", {}, [f"rail_temperature: {text}"]), ("h5", {"rail_temperature": text}, ())):
        _, errors = read_with(tmp_path, *case)
        assert [error.reason for error in errors] == ["condition_lost"] and "°C" in errors[0].remedy


def test_unreadable_temperatures_of_several_records_are_reported_once(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in (1, 2):
            file[f"impact_{k}/force"], file[f"impact_{k}/rail"] = FORCE, RAIL * k
            file[f"impact_{k}"].attrs["rail_temperature"] = f"warm {k}"
    (error,) = read("a.h5", tmp_path, IN_SI).errors
    assert error.reason == "condition_lost" and error.where == "record 1" and "'warm 1'" in error.problem


@pytest.mark.parametrize("text", ["n/a", "n.a.", "-", "---", "?", "", "NaN"])
def test_an_empty_temperature_is_not_reported(text, tmp_path):
    for case in (("csv", {}, [f"rail_temperature: {text}"]), ("h5", {"rail_temperature": text}, ())):
        assert not read_with(tmp_path, *case)[1]


def test_a_speed_is_converted_from_its_unit(tmp_path):
    for text, speed in (("33.3", 33.3), ("120 km/h", 120 / 3.6), ("33.3 m/s", 33.3)):
        for case in (("csv", {}, [f"# speed: {text}"]), ("h5", {"speed": text}, ())):
            assert read_with(tmp_path, *case)[0]["speed"] == pytest.approx(speed)


@pytest.mark.parametrize("text", ["60 mph", "120 km/t", "fast"])
def test_a_speed_in_an_unknown_unit_is_reported_and_a_word_is_not(text, tmp_path):
    """Formerly, 60 mph were read as 60 m/s."""
    for case in (("csv", {}, [f"# speed: {text}"]), ("h5", {"speed": text}, ())):
        conditions, errors = read_with(tmp_path, *case)
        assert conditions["speed"] == text
        assert [error.reason for error in errors] == ["condition_lost"][: int(text != "fast")]
        assert all("km/h" in error.remedy for error in errors)


OTHER_TEMPERATURES = [
    *["Rail temperature threshold", "Rail laying temperature", "Spannungsfreie Schienentemperatur"],
    *["Schienentemperatur Soll", "Rail temperature offset", "Rail temperature accuracy", "Rail temperature forecast"],
    *["Air conditioning temperature", "Calibration air temperature", "Lufttemperatur Labor"],
    *["Rail temperature at laying", "Schienentemperatur (Soll)"],
]


@pytest.mark.parametrize("name", OTHER_TEMPERATURES)
def test_another_temperature_of_a_rail_or_the_air_is_a_remark_and_no_value(name, tmp_path):
    """Formerly, the temperature at which a rail was laid was read as that of the measurement."""
    conditions, errors = read_with(tmp_path, "csv", {}, [f"{name}: 23 °C"])
    assert not {"rail_temperature", "air_temperature"} & set(conditions)
    assert [error.reason for error in errors] == ["condition_lost"] and "may mean" in errors[0].problem


@pytest.mark.parametrize("name", ["Trailer", "Repair", "Fair", "Airport", "Handrail", "Trail", "Affair", "Stair"])
def test_a_word_that_only_holds_that_of_a_rail_or_the_air_is_neither(name, tmp_path):
    assert read_with(tmp_path, "csv", {}, [f"{name} temperature: 23 °C"]) == ({}, ())


@pytest.mark.parametrize(
    "name",
    [
        *["Rail temperature measured", "Current rail temp.", "railTemp", "Schienentemperatur gemessen"],
        *["Temperatur der Schiene", "Skinnetemperatur", "Température du rail", "Teplota kolejnice"],
        *["Temperatura szyny"],
        *["Rail temperature (start)", "Mean rail temperature", "Rail temperature [°C]", "rail_temperature_celsius"],
    ],
)
def test_a_temperature_of_the_rail_in_other_words_is_still_read(name, tmp_path):
    assert read_with(tmp_path, "csv", {}, [f"{name}: 23 °C"]) == ({"rail_temperature": 23.0}, ())


@pytest.mark.parametrize(
    "line", ["Rotational speed: 1500 rpm", "Recording speed: 1x", "CPU speed: 3 GHz", "Baud speed: 9600"]
)
def test_the_speed_of_a_device_is_no_lost_condition(line, tmp_path):
    assert "condition_lost" not in [error.reason for error in read_with(tmp_path, "csv", {}, [line])[1]]


@pytest.mark.parametrize("line", ["Train speed: 80", "Geschwindigkeit: 80", "Speed of passing: 80 km/h"])
def test_the_speed_of_a_train_under_another_name_is_a_remark(line, tmp_path):
    assert [error.reason for error in read_with(tmp_path, "csv", {}, [line])[1]] == ["condition_lost"]
