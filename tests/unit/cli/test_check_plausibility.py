"""`turnout check` names values that no turnout has, and files that no command reads; right ones pass."""

import json
import shutil

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.passage.axle_patterns import read_patterns
from turnout.readers.repeated_blocks import is_noisy
from turnout.workflow.project import create_project

LAYOUT, TRACK, COACH = "config/layouts/tommerup.yaml", "config/tracks/tommerup.yaml", "config/vehicles/coach.yaml"
PATTERNS, WAGON = "config/vehicles/axle_patterns.yaml", "config/vehicles/wagon_two_axles.yaml"


@pytest.fixture
def checked(tmp_path, monkeypatch, capsys):
    create_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["add", "W1", "tommerup"]) == 0
    shutil.rmtree(tmp_path / "raw")  # without recordings only the configuration is checked

    def check(*edits):
        for name, old, new in edits:
            path = tmp_path / name
            content = path.read_text(encoding="utf-8")
            assert old in content, old
            path.write_text(content.replace(old, new, 1), encoding="utf-8")
        capsys.readouterr()
        code = main(["check"])
        return code, capsys.readouterr().out

    return check


FAULTS = {
    "crossing before the switch": (
        LAYOUT,
        "track: both, position: 3.6}",
        "track: both, position: 30}",
        "line 11, column 45: section CLP of panel CLP at 13.8 m is before SP of panel SP at 30",
    ),
    "offset in mm": (
        LAYOUT,
        "mounting: rail web, section: SP",
        "offset: 20, section: SP",
        "offset of channel SP is 20 m. Write the distance from its section in m",
    ),
    "extent in mm": (
        TRACK,
        "from: {value: -45, unit: m",
        "from: {value: -45000, unit: m",
        "extent.from: from -45000 to 57 m are more than 5000 m",
    ),
    "depth in m": (
        TRACK,
        "depth: {value: 0.8, unit: mm",
        "depth: {value: 0.8, unit: m",
        "0.8 m is outside -0.05 to 0.05 m",
    ),
    "length in mm": (
        TRACK,
        "length: {value: 1.2, unit: m",
        "length: {value: 1.2, unit: mm",
        "0.0012 m is outside 0.01",
    ),
    "negative end": (
        TRACK,
        "length: {value: 9, unit: m",
        "length: {value: -9, unit: m",
        "-9 m is below 0",
    ),
    "roughness": (
        TRACK,
        "level: {value: 3, unit: dB",
        "level: {value: 300, unit: dB",
        "300 dB is outside -60 to 60 dB",
    ),
    "shear coefficient": (TRACK, "{value: 0.393,", "{value: 39.3,", "39.3 - is outside 0.05 to 1"),
    "inertia in kg m²": (COACH, "unit: t m²", "unit: kg m²", "a radius of gyration of 0.248 m"),
    "axle in mm": (
        WAGON,
        "centre: {value: 3.25, unit: m",
        "centre: {value: 3.25, unit: mm",
        "line 24, axles[0].centre: a wheel at 0.00325 m, of a radius of 0.46 m, reaches beyond the end of 15.5 m",
    ),
    "axle beyond the end": (
        WAGON,
        "centre: {value: 12.25",
        "centre: {value: 15.25",
        "reaches beyond the end of 15.5 m",
    ),
    "axle at another": (WAGON, "centre: {value: 12.25", "centre: {value: 3.5", "3.5 m is 0.25 m behind another axle"),
    "suspension times 1000": (WAGON, "value: 2.0, unit: MN/m", "value: 2000, unit: MN/m", "2e+09 N/m is outside"),
    "damping times 1000": (WAGON, "value: 50, unit: kN s/m", "value: 50000, unit: kN s/m", "5e+07 N s/m is outside"),
    "primary stiffness times 1000": (
        COACH,
        "primary_stiffness: {value: ",
        "primary_stiffness: {value: 100",
        "N/m is outside",
    ),
    "negative payload": (COACH, "payload: {value: 7.5", "payload: {value: -7.5", "-7500 kg is outside 1 to 500000 kg"),
    "length of a vehicle in mm": (
        PATTERNS,
        "length: 26.80, pivots",
        "length: 26800, pivots",
        "vehicle ic2000: a length of 26800 m; one unit of a train has above 0 and up to 500 m",
    ),
    "count upside down": (
        PATTERNS,
        "count: [1, 16]",
        "count: [16, 1]",
        "train intercity: the second count is 1, not a whole number of at least 16",
    ),
    "no unit": (PATTERNS, "coupled: 5", "coupled: 0", "train IC3: coupled is 0, not a whole number of at least 1"),
    "decimal comma": (PATTERNS, "pivots: 20.00", 'pivots: "20,0"', "vehicle ic2000: could not convert"),
    "misspelt key": (
        PATTERNS,
        "pivots: 20.00, wheelbase",
        "pivots: 20.00, wheel_base",
        "ic2000: 'wheelbase' is missing",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_value_that_no_turnout_has_is_a_fault(checked, fault, tmp_path):
    *edit, expected = FAULTS[fault]
    if edit[0] == LAYOUT:  # a track file would contradict the position
        (tmp_path / TRACK).unlink()
    code, text = checked(edit)
    assert code == 1 and expected in text and "no fault" not in text
    assert len(set(text.splitlines())) == len(text.splitlines())  # of a train and of its vehicles alike


RIGHT = {
    "hump": (TRACK, "depth: {value: 0.8, unit: mm", "depth: {value: -0.8, unit: mm"),
    "depth in other units": (TRACK, "depth: {value: 0.8, unit: mm", "depth: {value: 0.08, unit: cm"),
    "offset": (LAYOUT, "mounting: rail web, section: SP", "offset: -0.3, section: SP"),
    "axles in another order": (
        WAGON,
        "label: a1, type: axle, centre: {value: 3.25",
        "label: a1, type: axle, centre: {value: 13.5",
    ),
    "single vehicles": (PATTERNS, "coupled: 5", "coupled: 1"),
    "optional vehicles": (PATTERNS, "count: [1, 16]", "count: [0, 16]"),
}


@pytest.mark.parametrize("change", RIGHT)
def test_unusual_right_values_have_no_fault(checked, change):
    code, text = checked(RIGHT[change])
    assert code == 0 and "no fault" in text


@pytest.mark.parametrize(
    ("mounting", "is_known"),
    [("rail head at sleeper", True), ("sleeper end", True), ("rail head mid-span", True), ("moon", False),
     ("Sleeper", False), ("rail head midspan", False)],
)  # fmt: skip
def test_a_mounting_that_the_simulation_does_not_know_is_named(checked, mounting, is_known):
    code, text = checked((LAYOUT, "mounting: rail head at sleeper", f"mounting: {mounting}"))
    assert (
        code == 0 and (f"mounting {mounting!r} is simulated as a sensor on the rail at a sleeper" in text) != is_known
    )


def test_files_that_no_command_reads_are_named(checked, tmp_path):
    config = tmp_path / "config"
    for folder, name in (
        ("overrides", "W1"),
        ("overrides", "W1.json"),
        ("layouts", "old.yaml.txt"),
        ("override", "W1.yaml"),
        ("overrides", "README.md"),
        ("tracks", ".hidden"),
        ("layouts", "tommerup.yaml~"),
    ):
        (config / folder).mkdir(exist_ok=True)
        (config / folder / name).write_text("x: 1\n")
    shutil.copy(config / "tracks/tommerup.yaml", config / "tracks/tomerup.yaml")
    (config / "tracks/W1.yaml").write_text("extends: base\n")
    shutil.copy(config / "tracks/tommerup.yaml", config / "tracks/base.yaml")
    code, text = checked()
    assert code == 0
    named = {line.split(": no command")[0].strip() for line in text.splitlines() if "no command reads" in line}
    assert named == {
        "config/overrides/W1",
        "config/overrides/W1.json",
        "config/layouts/old.yaml.txt",
        "config/override",
    }
    tracks = [
        line.split(":")[0].strip() for line in text.splitlines() if "no turnout and no layout has this name" in line
    ]
    assert tracks == ["config/tracks/tomerup.yaml"]


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("check --nosuch", "unknown: --nosuch"),
        ("query --rows x", "x"),
        ("blind", "required"),
        ("chek", "no command 'chek'"),
        ("diagnose", "--turnout"),
    ],
)
def test_a_wrong_command_line_also_gives_a_json_object(capsys, line, error):
    with pytest.raises(SystemExit) as end:
        main([*line.split(), "--json"])
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    assert end.value.code == document["exit_code"] == 2 and error in document["error"] and error in printed.err
    assert document.keys() == {"command", "exit_code", "text", "result", "warnings", "error"}


def test_help_is_no_error_of_json(capsys):
    with pytest.raises(SystemExit) as end:
        main(["check", "--help", "--json"])
    assert not end.value.code and capsys.readouterr().out.startswith("usage: turnout check")


def test_two_samples_hold_no_noise(recwarn):
    assert not any(is_noisy(np.ones((2, n))) for n in range(4)) and not recwarn.list


def test_a_vehicle_without_its_numbers_is_named():
    for values, expected in (
        ({"length": "x"}, "could not convert"),
        (None, "are missing"),
        ({}, "'length' is missing"),
    ):
        with pytest.raises(ValueError, match=f"vehicle a: .*{expected}"):
            read_patterns({"vehicles": {"a": values}, "trains": {}})
