"""Every command that computes with track and vehicle files states their improbable values once."""

import json

import pytest

from turnout.cli.main import build_parser, main
from turnout.cli.options import leaf_parsers
from turnout.errors import SimulationError
from turnout.stages.track_files import files_of_vehicle
from turnout.workflow.project import create_project

PAD = "config/tracks/tommerup.yaml, line 43, sections[0].pad_stiffness: 4.663e+11 N/m is outside"
MASS = "config/vehicles/ic3.yaml, line 15, car_types.end_car.mass: 24.6 kg is outside"
LINES = {
    "turnout simulate hammer": ("simulate hammer --section A7 --turnout W1", "stages.simulate.write_hammer", [PAD]),
    "turnout simulate passage": ("simulate passage --turnout W1", "stages.simulate.write_passage", [PAD, MASS]),
    "turnout calibrate": (
        "calibrate --section A7 --turnout W1 --modes ballast=99/.3", "stages.calibrate.calibrate_to_modes", [PAD],
    ),
    "turnout distinguish": (
        "distinguish --sensor-positions 24 --vehicles ic3", "stages.distinguish.planned_matrix", [PAD, MASS],
    ),
    "turnout twin": ("twin --turnout W1", "stages.calibrated_model.calibrate_turnout", [PAD, MASS]),
}  # fmt: skip
OTHER_TESTS = {  # they state the values with the result
    "turnout compare": "tests/unit/stages/test_compare_passage.py",
    "turnout diagnose": "tests/unit/stages/test_mismatch_stage.py",
}


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project whose pads are a thousand times as stiff, with a car of 25 kg."""
    create_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["add", "W1", "tommerup"]) == 0
    for name, old, new in (
        ("tracks/tommerup", "{value: 466.3, unit: MN/m", "{value: 466300, unit: MN/m"),
        ("vehicles/ic3", "{value: 24.6, unit: t", "{value: 24.6, unit: kg"),
    ):
        path = tmp_path / f"config/{name}.yaml"
        content = path.read_text()
        assert old in content
        path.write_text(content.replace(old, new, 1))
    return tmp_path


def stopped(*_, **__):
    raise SimulationError("stopped before the computation.")


def test_the_list_of_commands_is_complete():
    options = {"--track", "--vehicle", "--vehicles"}
    commands = {leaf.prog for leaf in leaf_parsers(build_parser()) if options & leaf._option_string_actions.keys()}
    assert commands == LINES.keys() | OTHER_TESTS.keys()


@pytest.mark.parametrize("command", LINES)
def test_a_command_states_improbable_values_once_before_it_computes(project, monkeypatch, capsys, command):
    line, function, expected = LINES[command]
    monkeypatch.setattr(f"turnout.{function}", stopped)
    assert main(line.split()) == 2
    lines = [text for text in capsys.readouterr().err.splitlines() if "improbable" in text]
    assert len(lines) == len(expected) and all(text in line for text, line in zip(expected, lines, strict=True))
    assert main([*line.split(), "--quiet"]) == 2 and "improbable" not in capsys.readouterr().err


def test_the_json_object_contains_the_warnings(project, monkeypatch, capsys):
    monkeypatch.setattr("turnout.stages.simulate.write_passage", stopped)
    main(["simulate", "passage", "--turnout", "W1", "--json"])
    printed = capsys.readouterr()
    warnings = json.loads(printed.out)["warnings"]
    assert len(warnings) == 2 and PAD in warnings[0] and MASS in warnings[1] and "improbable" not in printed.err


def test_the_files_of_a_composed_train_are_those_of_its_vehicles(project):
    names = [path.stem for path in files_of_vehicle("intercity")]
    assert names == ["intercity", "locomotive", "coach"]
