"""Entries of track and vehicle files that contradict each other: reported with their line, and right files are not."""

from pathlib import Path

import pytest

from turnout.config.parameter_files import read_parameters
from turnout.simulate import load_track
from turnout.stages.parameter_ranges import improbable_in_files


def at(x, sign=1.0):
    return f"{{value: {sign * x:g}, unit: m, source: x}}"


def track_text(toe=0, heel=6, end=50, nose=26, switch=(-1, 9), crossing=(22, 32), sign=1.0, panel="SP", more=""):
    """A track file; with ``sign`` -1 positions fall towards the crossing."""

    mass = "{value: 170, unit: kg, source: x}"

    def stretch(ends, words):
        start, stop = sorted(sign * x for x in ends)
        return f"  - {{{words}, from: {at(start)}, to: {at(stop)}, sleeper_mass: {mass}}}\n"

    surface = f"start: {at(toe, sign)}, length: {at(1, sign)}, depth: {{value: 2, unit: mm, source: x}}"
    return f"""\
name: weiche
elements_per_bay: 4
extent: {{from: {at(-60)}, to: {at(60)}}}
spacing: {at(0.6)}
rail: &rail
  youngs_modulus: {{value: 210, unit: GPa, source: x}}
  second_moment: {{value: 3037, unit: cm⁴, source: x}}
  area: {{value: 76.7, unit: cm², source: x}}
  mass: {{value: 60.2, unit: kg/m, source: x}}
  shear_modulus: {{value: 80.77, unit: GPa, source: x}}
  shear_coefficient: {{value: 0.393, unit: "-", source: x}}
  density: {{value: 7850, unit: kg/m³, source: x}}
support:
  pad_stiffness: {{value: 400, unit: MN/m, source: x}}
  pad_damping: {{value: 25, unit: kN s/m, source: x}}
  sleeper_mass: {{value: 140, unit: kg, source: x}}
  ballast_stiffness: {{value: 100, unit: MN/m, source: x}}
  ballast_damping: {{value: 70, unit: kN s/m, source: x}}
sections:
{stretch(switch, f"label: S, panel: {panel}")}{stretch(crossing, "label: C, panel: CP")}\
{stretch((32, 40), "label: A, panel: AS, route: main")}\
{stretch((32, 40), "label: B, panel: AS, route: diverging")}{more}\
blade:
  toe: {at(toe, sign)}
  heel: {at(heel, sign)}
  end: {at(end, sign)}
  chair_stiffness: {{value: 300, unit: MN/m, source: x}}
  chair_damping: {{value: 25, unit: kN s/m, source: x}}
  rail: *rail
routes:
  main: {{surfaces: [[{{kind: stock_fall, {surface}}}], [{{kind: blade_top, {surface}}}]]}}
  diverging:
    - {{kind: kink, place: {at(nose, sign)}, depth: {{value: 2, unit: mm, source: x}}, length: {at(1)}}}
"""


TRACK = track_text()
WHEEL = "name: car\nwheel:\n  radius: {value: 0.46, unit: m, source: x}\n"
PART = "  - {{label: P, from: {}, to: {}, {}: {{value: 90, unit: {}, source: x}}}}\n"


def remarks(folder, text):
    path = folder / "file.yaml"
    path.write_text(text)
    read_parameters(path)  # a file that cannot be read would have no remark either
    return improbable_in_files([path])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_right_track_has_no_remark_in_either_direction_of_its_positions(tmp_path, sign):
    assert remarks(tmp_path, track_text(sign=sign)) == []
    load_track(str(tmp_path / "file.yaml"), folder=tmp_path)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("changes", "remark"),
    [
        ({"panel": "SPP"}, "sections[0].panel: 'SPP' is no panel. Did you mean 'SP'?"),
        ({"panel": "AS", "switch": (10, 12)}, "is before panel CP at"),
        ({"crossing": (8, 32)}, "m here and in section 'S' (from"),
        ({"toe": 28, "heel": 34}, "m is in panel CP, where no blade is"),
        ({"nose": 5}, "m, behind the nose at"),
        ({"toe": 42, "heel": 44}, "m, behind the nose at"),
        ({"heel": 21.5}, ""),
        ({"toe": -2}, ""),
    ],
)
def test_places_of_a_track_that_contradict_each_other_are_reported(tmp_path, changes, sign, remark):
    found = remarks(tmp_path, track_text(**changes, sign=sign))
    assert bool(found) == bool(remark) and (not remark or any(remark in sentence for sentence in found)), found


@pytest.mark.parametrize(
    ("old", "new", "remark"),
    [
        ("elements_per_bay: 4", "elements_per_bay: 400", "line 2, elements_per_bay: 400 elements between two supports"),
        ("elements_per_bay: 4", "elements_per_bay: 16", ""),
        ("value: 60.2", "value: 54.3", ""),  # a worn rail: 10 % are 6 kg/m
        ("value: 60.2", "value: 49.9", "rail.mass: 49.9 kg/m, while density times area is 60.21 kg/m"),
        ("value: 60.2, unit: kg/m", "value: 602, unit: kg/m", "rail.mass: 602 kg/m, while"),
        ("value: 80.77", "value: 210", "are a Poisson's ratio of -0.5, outside 0 to 0.5"),
        ("3037, unit: cm⁴", "0.003037, unit: m⁴", "are a radius of gyration of 0.629 m"),
        ("3037, unit: cm⁴", "500, unit: cm⁴", ""),
    ],
)
def test_numbers_of_a_track_that_contradict_each_other_are_reported(tmp_path, old, new, remark):
    found = remarks(tmp_path, TRACK.replace(old, new))
    assert bool(found) == bool(remark) and (not remark or any(remark in sentence for sentence in found)), found


@pytest.mark.parametrize(
    ("start", "end", "key", "unit", "n"),
    [
        (24, 25, "sleeper_mass", "kg", 0),  # a part of an earlier section
        (24, 33, "sleeper_mass", "kg", 3),  # it goes on into the sections of both routes behind it
        (24, 33, "pad_stiffness", "MN/m", 0),  # another value
        (22, 32, "sleeper_mass", "kg", 1),  # a copy
        (9, 22, "sleeper_mass", "kg", 0),  # between two sections
    ],
)
def test_a_later_section_may_only_be_a_part_of_an_earlier_one(tmp_path, start, end, key, unit, n):
    found = remarks(tmp_path, track_text(more=PART.format(at(start), at(end), key, unit)))
    assert len(found) == n and all(f"{key} is given from" in sentence for sentence in found), found


@pytest.mark.parametrize(("radius", "n"), [("0.46", 0), ("0.625", 0), ("0.19", 0), ("0.92", 1), ("1.25", 1)])
def test_a_diameter_in_place_of_the_radius_of_a_wheel_is_reported(tmp_path, radius, n):
    found = remarks(tmp_path, WHEEL.replace("0.46", radius))
    assert len(found) == n and all(f"half a diameter of {radius} m is {float(radius) / 2:g} m" in s for s in found)


@pytest.mark.parametrize("path", sorted(Path("config").glob("*/*.yaml")) + sorted(Path("proof").rglob("tracks/*.yaml")))
def test_the_files_of_the_project_have_no_contradiction(path):
    assert improbable_in_files([path]) == []
