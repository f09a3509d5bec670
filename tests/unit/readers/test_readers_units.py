"""Units and sensitivities, compared with exact values."""

import math

import numpy as np
import pytest

from turnout.readers import read
from turnout.readers.channel_units import resolve_unit
from turnout.records import RawChannel, RawDescription
from turnout.units import conversion, to_si

G = 9.80665  # m/s², by definition (3rd CGPM, 1901)


@pytest.mark.parametrize(
    ("quantity", "unit", "sensitivity", "sensitivity_unit", "one"),
    [
        ("force", "V", 0.23, "mV/N", 1 / 0.23e-3),  # hammer of the paper's Table 3: 1 V is 4347.8 N
        ("acceleration", "V", 35.3, "mV/g", G / 35.3e-3),  # its accelerometers
        ("acceleration", "mV", 87.9, "mV/g", G / 87.9),
        ("acceleration", "V", 10.0, "mV/g", 980.665),
        ("acceleration", "mV", 10.0, "mV/(m/s²)", 0.1),
        ("acceleration", "V", 10.0, "mV/(m/s^2)", 100.0),
        ("force", "count", 2.5, "N/count", 2.5),
        ("force", "count", 4.0, "count/N", 0.25),
        ("acceleration", "V", 50.0, "m/s²/V", 50.0),
        ("acceleration", "V", 5.0, "(g)/V", 5 * G),
        ("force", "0.305 mV", 0.23, "mV/N", 0.305 / 0.23),
        ("force", "10 V", 0.5, "V/kN", 20e3),
        ("force", "kN", None, "", 1000.0),
        ("force", "Newtons", 0.23, "mV/N", 1.0),  # already physical: the sensitivity is not used
        ("velocity", "km/h", None, "", 1 / 3.6),
        ("displacement", "µm", None, "", 1e-6),
        ("displacement", "\u03bcm", None, "", 1e-6),  # the Greek letter instead of the micro sign
        ("strain", "µm/m", None, "", 1e-6),
        ("acceleration", "m/s^2", None, "", 1.0),
        ("acceleration", "[g]", None, "", G),
        ("force", "daN", None, "", 10.0),
        ("force", "kp", None, "", G),
        ("force", "kgf", None, "", G),
        ("force", "MN", None, "", 1e6),
        ("acceleration", "cm/s²", None, "", 0.01),
        ("acceleration", "Gal", None, "", 0.01),
        ("acceleration", "ft/s²", None, "", 0.3048),  # the international foot, by definition
        ("acceleration", "in/s^2", None, "", 0.0254),
        ("temperature", "Deg C", None, "", 1.0),  # as LabVIEW writes it
    ],
)
def test_one_raw_unit_has_the_value_of_the_data_sheet(quantity, unit, sensitivity, sensitivity_unit, one):
    convert = to_si(quantity, unit, sensitivity, sensitivity_unit)
    assert math.isclose(convert.scale, one, rel_tol=1e-15 * 8)  # a handful of roundings
    assert convert.offset == 0.0


@pytest.mark.parametrize(("unit", "number", "celsius"), [("K", 273.15, 0.0), ("°F", 212.0, 100.0), ("°F", -40, -40)])
def test_temperatures_have_an_offset(unit, number, celsius):
    convert = to_si("temperature", unit)
    assert math.isclose(convert.scale * number + convert.offset, celsius, abs_tol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("force", "furlong"), "the unit 'furlong' is not known; known are"),
        (("force", "V"), "'V' is no unit of force and no sensitivity is given"),
        (("force", "m/s²"), "'m/s²' is no unit of force and no sensitivity is given"),
        (("force", "V", 10.0, "mV/g"), "a sensitivity in 'mV/g' does not lead from 'V' to 'N'"),
        (("force", "count", 0.3, "mV/N"), "a sensitivity in 'mV/N' does not lead from 'count' to 'N'"),
        (("force", "V", 10.0, "mV per N"), "the sensitivity's unit 'mV per N' is not of the form mV/N"),
        (
            ("force", "V", 0.0, "mV/N"),
            "the sensitivity must be above 0, not 0.0; use the sign to turn",
        ),
        (("force", "V", float("nan"), "mV/N"), "the sensitivity must be above 0, not nan"),
        (("colour", "V"), "the quantity 'colour' is not known; known are force, acceleration"),
    ],
)
def test_the_error_of_an_impossible_conversion_states_the_cause(arguments, sentence):
    with pytest.raises(ValueError) as caught:
        to_si(*arguments)
    assert sentence in str(caught.value)


def test_a_factor_of_zero_is_rejected_as_a_unit():
    with pytest.raises(ValueError, match="'0 V' is not known"):
        conversion("0 V")


def test_file_and_layout_must_agree_if_both_state_a_unit():
    assert resolve_unit("g", "g") == "g"
    assert resolve_unit("m/s^2", "m/s²") == "m/s²"
    for label in ("EU", "", " - ", "None", "[a.u.]", "1.0"):  # the label of the file states no unit
        assert resolve_unit(label, "V") == "V"
    assert resolve_unit("count", "0.305 mV") == "0.305 mV"  # the layout states the value of a count
    assert resolve_unit("g", "V!") == "V"
    assert resolve_unit("counts", "mV") == "mV"  # a step of the converter is a millivolt
    assert resolve_unit("count", "0.05 N") == "0.05 N"
    for file_unit, layout_unit in (("mV", "V"), ("g", "m/s²"), ("N", "V"), ("daN", "N"), ("counts", "N")):
        with pytest.raises(ValueError, match=f"the file says '{file_unit}', the layout '{layout_unit}'"):
            resolve_unit(file_unit, layout_unit)
    with pytest.raises(ValueError, match="neither the file nor the layout says the unit"):
        resolve_unit("", None)


def test_an_unknown_unit_of_the_file_is_an_error_unless_the_layout_overrides_it():
    with pytest.raises(ValueError) as caught:
        resolve_unit("ozf", "kN")
    expected = "the file says 'ozf', which is not known, the layout 'kN' ('unit: kN!' if the layout is right)"
    assert str(caught.value) == expected
    assert resolve_unit("tf", "kN!") == "kN"


SENSITIVITIES = {
    "rail 100 mV/g": True, "rail_100mV/g": True, "rail (100 mV/g)": True, "rail, 100 mV per g": True,
    "100mV/g rail": True, "rail 10,2 mV/ms-2": True, "rail 10.2 mV/(m/s²)": True, "rail 100 mV/g [V]": True,
    "rail [V] @100mV/g": True, "rail 35.3 mV/g": False, "rail [35.3 mV/g]": False, "rail 3.6 mV/(m/s²)": False,
}  # fmt: skip


@pytest.mark.parametrize(
    ("format", "name"),
    [*(("csv", name) for name in SENSITIVITIES), ("npz", "rail 10.2 mV/(m/s²)"), ("npz", "rail (100 mV/g)")],
)
def test_a_sensitivity_in_the_name_of_a_channel_is_compared_and_not_read_as_a_unit(name, format, tmp_path):
    """Formerly, the g of 100 mV/g was read as the unit of the samples."""
    samples = np.random.default_rng(2).normal(size=(2, 40)).round(6)
    if format == "csv":
        rows = "".join(f"{f};{a}\n" for f, a in samples.T)
        (tmp_path / "a.csv").write_text(f"force;{name}\n{rows}", encoding="utf-8")
    else:
        np.savez(tmp_path / "a.npz", samples=samples, channels=["force", name])
    volts = {"unit": "V", "sensitivity": 100.0, "sensitivity_unit": "mV/g"}
    sensors = (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", **volts))
    result = read(f"a.{format}", tmp_path, RawDescription(sensors, rate=1e3))
    if not SENSITIVITIES[name]:
        assert not result.recordings and "the layout's sensitivity of 100 mV/g is none of these" in str(result.errors)
        return
    assert result.recordings[0].samples[1] == pytest.approx(98.0665 * samples[1], rel=1e-12) and not result.errors
    if "[V]" not in name:
        physical = (sensors[0], RawChannel("rail", 1, "acceleration", unit="m/s²"))
        result = read(f"a.{format}", tmp_path, RawDescription(physical, rate=1e3))
        assert result.recordings[0].samples[1] == pytest.approx(samples[1]) and not result.errors


def test_the_value_of_a_count_and_a_unit_beside_a_sensitivity_are_compared(tmp_path):
    for name, problem in (("rail 0.3 mV/count", "count"), ("rail_100mV/g_mm/s2", "mm/s2"), ("rail_g", "g")):
        (tmp_path / "a.csv").write_text(f"force;{name}\n" + "1.5;2.5\n3.5;1.5\n" * 20)
        sensors = (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", unit="m/s²"))
        (error,) = read("a.csv", tmp_path, RawDescription(sensors, rate=1e3)).errors
        assert error.reason == "unit_unknown" and repr(problem) in str(error)


@pytest.mark.parametrize(("russian", "latin"), [("кН", "kN"), ("Н", "N"), ("м/с²", "m/s²"), ("мВ", "mV")])
def test_units_in_russian_are_those_in_latin_letters(russian, latin):
    assert conversion(russian) == conversion(latin)


@pytest.mark.parametrize("mass", ["г", "мг", "кг"])
def test_a_gram_in_russian_is_no_acceleration_of_gravity(mass):
    with pytest.raises(ValueError, match="is not known"):
        conversion(mass)
