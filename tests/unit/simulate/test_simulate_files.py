"""Files of tracks and vehicles: misspelt, impossible or unitless entries are rejected with file and line."""

from copy import deepcopy

import pytest

from turnout.config import parameter_files
from turnout.config.document import compose
from turnout.config.parameter_files import read_parameters
from turnout.errors import ConfigError, TurnoutError
from turnout.installation import shipped_path
from turnout.simulate import load_track, load_vehicle

TRACK = shipped_path("config/tracks/tommerup.yaml").read_text(encoding="utf-8")
VEHICLE = shipped_path("config/vehicles/ic3.yaml").read_text(encoding="utf-8")
LEVEL = '  level: {value: 3, unit: dB, source: "estimate: a main line some years after grinding", prior: 1.0}'
STRETCH = "stretches:\n  - {from: {value: %s, unit: m, source: x}, to: {value: %s, unit: m, source: x}, rail: *rail}\n"


def check_rejection(load, path, text, expected):
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=expected) as caught:
        load(str(path))
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("  level:", "  levle:", r"roughness: unknown key 'levle'\. Did you mean 'level'"),
        ("roughness:\n" + LEVEL, "roughness: 3", "roughness: 3 instead of names with values"),
        ("share: {value: 0.55", "shaer: {value: 0.55", r"routes\.main\[1\]: unknown key 'shaer'"),
        ("share: {value: 0.55", "share: {value: 1.0", r"routes\.main\[1\]: kink at 26.700 m: share 1.0 is not between"),
        ("length: {value: 1.2", "lenght: {value: 1.2", r"routes\.main\[0\]: unknown key 'lenght'"),
        ("length: {value: 1.2", "length: {value: 0", r"routes\.main\[0\]: cosine at 4.500 m: a length of 0.0 m"),
        ("{kind: cosine, ", "{", r"routes\.main\[0\]: the key 'kind' is missing"),
        ("kind: cosine", "kind: sine", r"routes\.main\[0\]\.kind: no path of kind 'sine'\. Write one of sections, dip"),
        ("place: {value: 4.5", "depth_: {value: 4.5", r"unknown key 'depth_'"),
        ("route: diverging}\n  ASM", "route: divering}\n  ASM",
         r"locations\.A9\.route: 'divering' is no route of this track\. Write one of main, diverging"),
        ("panel: CP\n    route: main", "panel: CP\n    route: mian", r"sections\[4\]\.route: 'mian'"),
        ("damping: {value: 20, unit: N s/m²", "damping: {value: 20, unit: kN s/m",
         r"rail\.damping: the unit 'N s/m' is not one of 'N s/m²'"),
        ("spacing: {value: 0.6", "spacing: {value: 0", "spacing: 0 m does not divide a track of 102 m"),
        ("from: {value: -46", "from: {value: 46", r"sections\[0\]: from 46 m to -1.5 m is no stretch"),
        ("elements_per_bay: 4", "elements_per_bay: 4.5", r"elements_per_bay: 4.5 .* whole number of at least 1"),
        ("elements_per_bay: 4", 'elements_per_bay: {value: 4, unit: "-", source: x}', "without unit and source"),
        ("layers: 2", "layers: 3", "tommerup: 3 layers need ballast_mass above 0"),
        ("mass: {value: 60.2", "mass: {value: .nan", r"rail\.mass: nan is not finite"),
        ("roughness:\n", "scatter: {pad_stiffness: 0.1}\nroughness:\n", r"scatter\.pad_stiffness: 0\.1 has no unit"),
        ("roughness:\n", "scatter: {pad_stiffness: {value: 9, unit: MN/m, source: x}}\nroughness:\n",
         r"scatter\.pad_stiffness: the unit 'N/m' is not one of '-'"),
        ("roughness:\n", 'scatter: {ballast_mass: {value: 9, unit: "%", source: x}}\nroughness:\n',
         r"scatter\.ballast_mass: scatter of a value that is not given\. Give 'ballast_mass' in 'support'"),
        ("roughness:\n", STRETCH % (26.03, 26.09) + "roughness:\n", "middle of no element.* as an element, 0.15 m"),
        ("roughness:\n", "terms:\n  - {term: hum, route: mian}\nroughness:\n", r"terms\[0\]\.route: 'mian'"),
        ("    - &joint", "    - {kind: sections, places: [1.0, 2.0], dips: [0.0, 0.001]}\n    - &joint",
         r"routes\.main\[2\]\.places\[0\]: 1.0 has no unit and source"),
    ],
)  # fmt: skip
def test_a_track_file_is_rejected_with_the_entry_and_the_remedy(tmp_path, old, new, expected):
    assert old in TRACK
    check_rejection(load_track, tmp_path / "t.yaml", TRACK.replace(old, new, 1), expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("payload: {value: 4.6", "paylaod: {value: 4.6", r"car_types\.end_car: unknown key 'paylaod'"),
        ("contact: {value: 93", "contcat: {value: 93", "wheel: unknown key 'contcat'"),
        ("{label: b1,", "{label: b1, lable: b2,", r"bogies\[0\]: unknown key 'lable'"),
        ("type: end_car", "type: endcar", "car_types: the key 'endcar' is missing"),
        ("base: {value: 2.7", "axles: 2.5\n    base: {value: 2.7", r"bogie_types\.end_bogie\.axles: 2\.5"),
        ("mass: {value: 24.6", "mass: {value: 0", r"car_types\.end_car\.mass: 0 kg is no mass of a car"),
        ("rests_on: [b1, b2]", "rests_on: 3", r"cars\[0\]\.rests_on: 3 instead of a list"),
    ],
)
def test_a_vehicle_file_is_rejected_with_the_entry(tmp_path, old, new, expected):
    assert old in VEHICLE
    check_rejection(load_vehicle, tmp_path / "v.yaml", VEHICLE.replace(old, new, 1), expected)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("share: {value: 0.55", "shaer: {value: 0.55", "    - &nose"),
        ("  level:", "  levle:", "  levle:"),
        ("mass: {value: 60.2", "mass: {value: .nan", "  mass: {value: .nan"),
        ("unit: cm⁴", "unit: furlong", "  second_moment:"),
        ("roughness:\n", "rougness:\n", "rougness:"),
        ("route: diverging}\n  ASM", "route: divering}\n  ASM", "  A9:"),
        ("layers: 2", "layers: two", "layers: two"),
    ],
)
def test_an_error_of_a_track_file_names_its_line(tmp_path, old, new, line):
    text = TRACK.replace(old, new, 1)
    number = 1 + next(k for k, text_line in enumerate(text.split("\n")) if text_line.startswith(line))
    check_rejection(load_track, tmp_path / "t.yaml", text, rf"t\.yaml, line {number}[,:] ")


def test_an_error_in_an_extended_track_file_states_the_line_of_that_file(tmp_path):
    (tmp_path / "base.yaml").write_text(TRACK.replace("kind: cosine", "kind: sine"), encoding="utf-8")
    (tmp_path / "own.yaml").write_text("extends: base\n\nname: own\n", encoding="utf-8")
    line = 1 + next(k for k, text_line in enumerate(TRACK.split("\n")) if "kind: cosine" in text_line)
    with pytest.raises(ConfigError, match=rf"base\.yaml, line {line}, routes\.main\[0\]\.kind: no path"):
        load_track(str(tmp_path / "own.yaml"))
    (tmp_path / "base.yaml").write_text(TRACK.replace("spacing: {value: 0.6", "spacing: {value: 0"), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"own\.yaml, spacing: 0 m does not"):
        load_track(str(tmp_path / "own.yaml"))


def number(value, unit):
    return {"value": value, "unit": unit, "source": "made up"}


PLACES = {"from": number(0, "m"), "to": number(6, "m")}
RAIL = {
    "youngs_modulus": number(210, "GPa"), "second_moment": number(3037, "cm⁴"), "area": number(76.7, "cm²"),
    "mass": number(60.2, "kg/m"), "shear_modulus": number(81, "GPa"), "shear_coefficient": number(0.4, "-"),
    "density": number(7850, "kg/m³"), "damping": number(20, "N s/m²"),
}  # fmt: skip
SUPPORT = {
    "pad_stiffness": number(300, "MN/m"), "pad_damping": number(30, "kN s/m"), "sleeper_mass": number(150, "kg"),
    "ballast_stiffness": number(90, "MN/m"), "ballast_damping": number(80, "kN s/m"),
}  # fmt: skip
SMALL_TRACK = {
    "name": "small", "layers": 2, "elements_per_bay": 4, "extent": PLACES, "spacing": number(0.6, "m"),
    "absorbing_end": {"length": number(1, "m"), "rate": number(400, "1/s")}, "rail": RAIL, "support": SUPPORT,
    "sections": [{"label": "a", "route": "main", **PLACES, "pad_stiffness": number(200, "MN/m")}],
    "stretches": [{**PLACES, "rail": RAIL}], "scatter": {"pad_stiffness": number(10, "%")},
    "roughness": {"level": number(3, "dB")}, "locations": {"A": {"place": number(3, "m"), "route": "main"}},
    "routes": {"main": {
        "common": [{"kind": "kink", "place": number(3, "m"), "depth": number(1, "mm"), "length": number(1, "m")}],
        "surfaces": [[{"kind": "sections", "places": [number(1, "m"), number(2, "m")],
                       "dips": [number(0, "m"), number(1, "mm")]}]],
    }},
    "terms": [{"term": "hum", "route": "main"}],
}  # fmt: skip
BOGIE = {
    "mass": number(3, "t"), "inertia": number(3, "t m²"), "base": number(2.5, "m"), "wheelset_mass": number(1.5, "t"),
    "primary_stiffness": number(2, "MN/m"), "primary_damping": number(10, "kN s/m"), "axles": 2,
    "secondary_stiffness": number(1, "MN/m"), "secondary_damping": number(40, "kN s/m"),
}  # fmt: skip
SMALL_VEHICLE = {
    "name": "small", "length": number(20, "m"), "bogie_types": {"b": BOGIE},
    "wheel": {"radius": number(0.46, "m"), "contact": number(93, "GN/m^1.5")},
    "car_types": {"c": {"mass": number(30, "t"), "payload": number(5, "t"), "inertia": number(900, "t m²")}},
    "bogies": [{"label": k, "type": "b", "centre": number(x, "m")} for k, x in (("b1", 3), ("b2", 17))],
    "cars": [{"type": "c", "rests_on": ["b1", "b2"], "centre": number(10, "m")}],
}  # fmt: skip


def wrong_contents(content):
    """``content`` with one entry after the other, at every depth, replaced by a wrong value."""

    def places(inside, way=()):
        items = inside.items() if isinstance(inside, dict) else enumerate(inside) if isinstance(inside, list) else ()
        for key, value in items:
            yield (*way, key)
            yield from () if isinstance(value, dict) and "value" in value else places(value, (*way, key))

    for way in places(content):
        for wrong in (None, 3, -1.5, "three", [], [3], {}, {"a": 3}, number(0, "m"), number(-1, "kg")):
            other = deepcopy(content)
            inside = other
            for key in way[:-1]:
                inside = inside[key]
            inside[way[-1]] = wrong
            yield way, wrong, other


@pytest.mark.parametrize(
    ("load", "content"), [(load_track, SMALL_TRACK), (load_vehicle, SMALL_VEHICLE)], ids=["track", "vehicle"]
)
def test_any_content_of_a_file_is_loaded_or_rejected_with_a_message(tmp_path, monkeypatch, load, content):
    """Never with a traceback: YAML files contain numbers, text, lists, mappings and empty values."""
    path, parsed = tmp_path / "file.yaml", [content]
    path.write_text("", encoding="utf-8")
    # the true reader takes twenty times as long
    monkeypatch.setattr("turnout.config.parameter_files.read_content", lambda path: (deepcopy(parsed[-1]), None))
    load(str(path))
    for way, wrong, other in wrong_contents(content):
        parsed.append(other)
        try:
            load(str(path))
        except TurnoutError:
            continue
        except Exception as error:
            raise AssertionError(f"{'.'.join(map(str, way))} = {wrong!r}") from error


def test_a_changed_vehicle_file_is_read_again(tmp_path):
    path = tmp_path / "v.yaml"
    path.write_text(VEHICLE)
    before = load_vehicle(path, 0.0)
    assert load_vehicle(path, 0.0) == before
    heavier = VEHICLE.replace("mass: {value: 24.6", "mass: {value: 25.6", 1)
    assert heavier != VEHICLE
    path.write_text(heavier)
    assert load_vehicle(path, 0.0) != before


def test_a_file_is_parsed_once_per_text_and_each_caller_has_its_own_parameters(tmp_path, monkeypatch):
    """Parsing took a tenth of a second for each turnout of a fleet with a common track file."""
    parsed = []
    monkeypatch.setattr(parameter_files, "compose", lambda *given: [parsed.append(given), compose(*given)][1])
    path = tmp_path / "t.yaml"
    for text, n in ((TRACK, 1), (TRACK, 1), (TRACK + "# end\n", 2)):
        path.write_text(text, encoding="utf-8")
        parameters = read_parameters(path)
        assert len(parsed) == n and "sources" not in parameters
        assert parameters.pop("rail") and parameters.pop("routes")
