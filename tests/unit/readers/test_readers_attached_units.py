"""Units in the names of text columns: after a slash, a comma or "in", in brackets, in the line below."""

import numpy as np
import pytest

from turnout.constants import STANDARD_GRAVITY
from turnout.errors import ReadError
from turnout.readers import names_and_units, read
from turnout.records import RawChannel, RawDescription

RATE = 10000.0
FORCE, ACCELERATION = np.random.default_rng(0).normal(size=(2, 100)).round(5)


def outcome(header, path, force="F", acceleration="a", separator=";", units=(None, None), times_per_second=1.0):
    """The only recording of a file with a time, a force and an acceleration under a header, or its first error."""
    cells = zip(np.arange(100) / RATE * times_per_second, FORCE, ACCELERATION)
    rows = "".join(separator.join(f"{x:.7g}" for x in row) + "\n" for row in cells)
    (path / "a.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
    channels = (
        RawChannel("force", force, "force", unit=units[0]),
        RawChannel("rail", acceleration, "acceleration", unit=units[1]),
    )
    try:
        result = read("a.csv", path, RawDescription(channels))
    except ReadError as error:
        return error
    return result.errors[0] if result.errors else result.recordings[0]


def is_read(recording, scales=(1.0, 1.0)):
    if isinstance(recording, ReadError) or recording.rate != RATE:
        return False
    return np.allclose(recording.samples, [FORCE * scales[0], ACCELERATION * scales[1]], rtol=1e-9, atol=1e-9)


HEADERS = {  # header: scales of force and acceleration to N and m/s²
    "t/s;F/N;a/(m/s²)": (1.0, 1.0),
    "t/s;F/N;a/m/s2": (1.0, 1.0),
    "t\u00a0/\u00a0s;F / kN;a / g": (1e3, STANDARD_GRAVITY),
    "time;F/kN;a/g": (1e3, STANDARD_GRAVITY),
    "t in s;F in N;a in m/s²": (1.0, 1.0),
    "t in [s];F in [kN];a in [m/s²]": (1e3, 1.0),
    "t, s;F, N;a, g": (1.0, STANDARD_GRAVITY),
    "t, in s;F, in daN;a, in [g]": (10.0, STANDARD_GRAVITY),
    "t en s;F en daN;a en g": (10.0, STANDARD_GRAVITY),
    "t {s};F {N};a {g}": (1.0, STANDARD_GRAVITY),
    "t/s;F/kN;a/g\ns;kN;g": (1e3, STANDARD_GRAVITY),
    "t;F;a\ns;kN;m/s²": (1e3, 1.0),
}


@pytest.mark.parametrize("header", HEADERS)
def test_a_unit_is_read_in_every_notation_after_the_name(header, tmp_path):
    assert is_read(outcome(header, tmp_path), HEADERS[header])


@pytest.mark.parametrize("separator", [",", "\t", "|", " "])
def test_units_behind_a_slash_are_read_with_all_separators(separator, tmp_path):
    header = separator.join(("t/ms", "F/kN", "a/(m/s²)"))
    assert is_read(outcome(header, tmp_path, separator=separator, times_per_second=1e3), (1e3, 1.0))


def test_a_layout_can_name_a_channel_with_or_without_its_unit(tmp_path):
    header = "Zeit in s;Kraft in N;Beschleunigung in m/s²"
    assert is_read(outcome(header, tmp_path, "Kraft", "Beschleunigung"))
    assert is_read(outcome(header, tmp_path, "Kraft in N", "Beschleunigung in m/s²"))


def test_the_unit_of_the_layout_must_agree_with_a_unit_behind_a_slash(tmp_path):
    error = outcome("t/s;F/kN;a/g", tmp_path, units=("N", "g"))
    assert error.reason == "unit_unknown" and "'kN'" in error.problem and "'unit: N!'" in error.problem
    assert is_read(outcome("t/s;F/kN;a/g", tmp_path, units=("N!", "m/s²!")))


NO_UNITS = ("in", "in N", "v m/s", "hammer mV/N", "hammer pC/N", "flow l/s", "rate 1/s", "Force, 5 kN", "rail/left",
            "S1, strain", "force_N", "force N", "N/m", "max/min", "c/d", "F/-")  # fmt: skip


@pytest.mark.parametrize("name", NO_UNITS)
def test_a_name_that_only_resembles_a_name_with_a_unit_is_not_split(name, tmp_path):
    outcome(f"t/s;{name};a/g", tmp_path)
    assert names_and_units("a.csv", tmp_path) == ((name, ""), ("a", "g"))
    error = outcome(f"t/s;{name};a/g", tmp_path, name)
    assert error.reason == "unit_unknown" and "neither the file nor the layout says the unit" in error.problem


@pytest.mark.parametrize("header", ["t/s;S1/V;S1/L", "time;force;rail/m", "time;force;rail/m\ns;N;m/s²"])
def test_a_letter_for_a_side_is_not_read_as_a_unit(header, tmp_path):
    names = header.split("\n")[0].split(";")[1:]
    assert is_read(outcome(header, tmp_path, *names, units=("N", "m/s²")))


def test_a_sensitivity_is_not_read_as_a_unit(tmp_path):
    error = outcome("t [s];F [N];rail mV/(m/s²)", tmp_path, acceleration="rail mV/(m/s²)")
    assert "neither the file nor the layout says the unit" in error.problem


@pytest.mark.parametrize("name", ["F/N", "F [N]"])
def test_contradictory_units_in_a_name_and_in_the_line_of_units_are_an_error(name, tmp_path):
    error = outcome(f"t;{name};a\ns;kN;g", tmp_path, name)
    assert error.reason == "scale_unknown" and f"name {name!r} says 'N', the line of units 'kN'" in error.problem
    assert is_read(outcome(f"t;{name};a\ns;kN;g", tmp_path, name, units=("kN!", "g")), (1e3, STANDARD_GRAVITY))


def test_two_different_units_of_the_time_are_an_error(tmp_path):
    error = outcome("t/ms;F;a\ns;N;g", tmp_path)
    assert error.reason == "unit_unknown" and "says 'ms', the line of units 's'" in error.problem


def test_a_comment_with_a_unit_above_the_names_is_not_read_as_names(tmp_path):
    assert is_read(outcome("Kommentar;Werte in N;Gleis 3\nt/s;F/N;a/m/s²\nvon Hand;kopiert;heute", tmp_path))
    assert is_read(outcome("Kommentar;Werte in N;Gleis 3\nt;F;a\n", tmp_path, units=("N", "m/s²")))
