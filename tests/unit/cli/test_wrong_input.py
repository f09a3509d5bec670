"""Wrong input of a user gives one message with the place, the fault and the remedy."""

import argparse
import os
import shlex
import shutil
from importlib import import_module

import pytest

from turnout import files as files_module
from turnout.cli import COMMANDS
from turnout.cli.main import main
from turnout.registry.job import register
from turnout.workflow import project as project_module
from turnout.workflow.project import create_project


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A new project with turnout W1 of the example layout, whose file of passages is a folder."""
    create_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["add", "W1", "tommerup"]) == 0
    (tmp_path / "raw/W1/hammer").mkdir(parents=True)
    (tmp_path / "raw/W1/hammer/A7_1.csv").write_text("no numbers\n")
    return tmp_path


def without_passages(project):
    """Remove the part ``passages`` of the layout."""
    layout = project / "config/layouts/tommerup.yaml"
    layout.write_text(layout.read_text().partition("\npassages:")[0] + "\n")


WRONG = {
    "passage nothing.csv --turnout W1": "nothing.csv, the path: there is no such file",
    "passage raw --turnout W1": "raw, the path: it is a folder. Name the files in it, such as raw/W1/hammer/A7_1.csv.",
    "compare raw --turnout W1": "raw, the path: it is a folder. Name the files in it",
    "hammer raw/W1 --turnout W1": "raw/W1, the path: it is a folder. Name the files in it, such as raw/W1/hammer/A7",
    "calibrate raw --section A7 --track tommerup": "raw, the path: it is a folder. Name the files in it",
    "layout new --from raw": "raw, the path: it is a folder. Name the files in it",
    "hammer raw/W1/hammer/A7_1.csv --turnout W1 --section X": "turnout hammer: --section: 'X' is no section of W1",
    "check --turnout W9": "config/turnouts.tsv, line 1, column 1: no turnout 'W9'. Allowed: W1.",
    "check --raw README.md": "README.md, --raw: it is a file.",
    "check --config config/config.yaml": "config/config.yaml, the folder: it is a file. Name the folder",
    "check --config /nowhere/config": "/nowhere/config, the folder: there is no such folder. Run the command in the",
    "config generate --config nowhere": "nowhere, the folder: there is no such folder. Run the command in the folder",
    "plan --config nowhere": "nowhere, the folder: there is no such folder. Run the command in the folder of a project",
    "add W1 tommerup": "config/turnouts.tsv, line 2: there is a turnout 'W1' already. Write another id",
    "add W:1 tommerup": "turnout is 'W:1'. Write 1 to 64 letters, digits, _ and -, the first a letter or digit.",
    "demo": "config/turnouts.tsv, the table: no turnout 'aarup_n4' of the demonstration. Run the command in an",
    "worklist": "results/registry: there is no registry here. 'turnout nightly' makes one",
    "events W9 tamping 2026-04-02": "config/events.csv, turnout: turnout 'W9' has no row in turnouts.tsv. Allowed: W1.",
    "acknowledge W1/X --by me --reason x": "config/acknowledgements.csv, section: turnout 'W1' has no section 'X'",
    "query from_worklist --registry README.md": "not a valid DuckDB database file. Name the folder that holds registry",
    "simulate hammer --section X": "no section 'X' in the track file of 'tommerup'. Write one of OT, SP",
    "diagnose --turnout W1 --sections X": "W1 has no section X. Write some of OT, SP",
    "events W1 tamping 0202-05-01": "config/events.csv, date: date 0202-05-01 is before 1900. Correct its year.",
    "events W1 tamping 3024-05-01": "config/events.csv, date: date 3024-05-01 is more than a year ahead. Correct it",
    "calibrate --section A7 --track tommerup --modes ballast=-5/0.1": "'ballast=-5/0.1': no resonance has a frequency",
    "calibrate --section A7 --track tommerup --modes ballast=nan/0.1": "Write a frequency above 0 Hz",
    "calibrate --section A7 --track tommerup --modes ballast=100/1.5": "damping ratio between 0 and 1",
    "calibrate --section A7 --track tommerup --modes ballast=1e300/0.1": "above 0 Hz, up to 5000 Hz",
    "distinguish --track tommerup --sensor-positions 1e9 --impact-positions 24.6": "the position 1e+09 m of a sensor",
    "distinguish --track tommerup --sensor-positions 24.6 --impact-positions -900": "Write positions from",
    "plan --shards 1000000000000": "Write the number of shards of the runs, 1 to 4096",
    "calibrate --section A7 --track tommerup --modes ballast=600/.1 railpad=150/.1": "the ballast resonance lies below",
    "calibrate --section A7 --track tommerup --modes balast=100/.1": "no resonance 'balast'. Write ballast or railpad",
    "calibrate --section A7 --track tommerup --modes ballast=99/.1 ballast=100/.1": "ballast for the second time",
    "calibrate raw/W1/hammer/A7_1.csv --turnout W1 --section A8": "is 'A8', and the file's name says 'A7'",
    "diagnose --turnout W1 --finding x": "--finding, option: it acts with --accept only",
    "diagnose --turnout W1 --anyway": "--anyway, option: it acts with --accept only",
    "compare raw/W1/hammer/A7_1.csv --turnout W1 --figure config": "config, --figure: it is a folder",
    "simulate hammer --section A7 --impacts 100000000": "--impacts: 100000000. Write a whole number from 1 to 1000",
    "simulate passage --units 100000": "--units: 100000. Write a whole number from 1 to 50",
    "nightly W1": "'W1' is no option. Options of Snakemake stand behind --, as in 'turnout nightly -- --config turn",
    "nightly shards=2": "as in 'turnout nightly -- --config shards=2'",
    "nightly -- --config nix=1": "--config, option: unknown option 'nix'",
    "nightly -- --cores 1 --config day=2026-13-01 shards=2": "'2026-13-01', which is no day of the calendar.",
    "events W1 tamping 2026-13-20": "date is '2026-13-20', which is no day of the calendar. Write a day that exists",
    "report --day 2026-02-30": "--day, date: '2026-02-30', which is no day of the calendar",
    "simulate hammer --section A7 --at 2026-02-30T09:00": "'2026-02-30T09:00', which is no day of the calendar",
    "hammer raw/W1/hammer/A7_1.csv --turnout W1 --campaign 2026-02-30": "'2026-02-30', which is no day of the calendar",
    "nightly -- --config shards=0 --cores 1": "--config, shards: 0. Write a whole number from 1 to 4096",
    "nightly -- --config=turnouts=W9": "config/turnouts.tsv, line 1, column 1: no turnout 'W9'. Allowed: W1",
    "nightly -- -C strict=perhaps": "--config, strict: 'perhaps'. Write true or false",
    "nightly -- --config configuration=nowhere": "nowhere/turnouts.tsv, the path: there is no such file",
}


@pytest.mark.parametrize("line", WRONG)
def test_the_message_states_place_fault_and_remedy(project, capsys, line):
    assert main(line.split()) == 2
    message = capsys.readouterr().err
    assert WRONG[line] in message and "Traceback" not in message


@pytest.mark.parametrize("command", ["hammer", "passage"])
def test_the_message_proposes_no_table_as_a_recording(project, capsys, command):
    for name in ("campaigns.csv", "trains.csv"):
        (project / "raw" / "W1" / name).write_text("a,b\n")
    assert main([command, "raw/W1", "--turnout", "W1"]) == 2
    assert "Name the files in it, such as raw/W1/hammer/A7_1.csv." in capsys.readouterr().err


@pytest.mark.parametrize("command", ["passage", "compare"])
def test_the_error_of_a_layout_without_passages_names_the_layout(project, capsys, command):
    without_passages(project)
    assert main([command, "raw/W1/hammer/A7_1.csv", "--turnout", "W1"]) == 2
    message = capsys.readouterr().err
    assert "config/layouts/tommerup.yaml, passages: the layout describes no passages. Add the part" in message


@pytest.mark.parametrize(
    "line, message",
    [
        ("", "usage: turnout"),
        ("hamer", "no command 'hamer'. Did you mean 'hammer'?"),
        ("--verison", "turnout: '--verison' before the command. Write options behind it: turnout COMMAND --verison"),
        ("--json worklist", "turnout: '--json' before the command. Write options behind it: turnout COMMAND --json"),
        ("worklist --asoff 2026-05-14", "unknown: --asoff 2026-05-14. Did you mean --as-of? 'turnout worklist --help'"),
        ("worklist --quite", "unknown: --quite. Did you mean --quiet? 'turnout worklist --help'"),
        ("worklist --out x", "unknown: --out x. 'turnout worklist --help'"),
        ("worklist --turnout W1", "turnout worklist: error: unknown: --turnout W1. 'turnout worklist --help'"),
        (
            "simulate passage --speed -3",
            "turnout simulate passage: error: argument --speed: '-3' is not a number from 1 to 500 km/h",
        ),
        ("simulate passage --speed 1e9", "argument --speed: '1e9' is not a number from 1 to 500 km/h"),
        ("simulate hammer --section A7 --temperature 1e30", "--temperature: '1e30' is not a number from -50 to 80 °C"),
        (
            "distinguish --sensor-positions 24 --vehicles ic3 --speeds 1e-9",
            "--speeds: '1e-9' is not a number from 1 to 500 km/h",
        ),
        ("diagnose --turnout W1 --limit-minutes nan", "argument --limit-minutes: 'nan' is not a number"),
        ("diagnose --turnout W1 --limit-minutes -1", "argument --limit-minutes: '-1' is not 0 or more"),
        ("paper W1 --speed -5", "argument --speed: '-5' is not a number from 1 to 500 km/h"),
        ("distinguish --sensor-positions nan", "argument --sensor-positions: 'nan' is not a number"),
    ],
)
def test_a_wrong_command_line_has_exit_code_2(capsys, line, message):
    with pytest.raises(SystemExit) as end:
        main(line.split())
    assert end.value.code == 2 and message in capsys.readouterr().err


def test_the_error_of_a_folder_without_effects_for_the_blind_proof_names_it(capsys):
    assert main(["blind", "make", "--out", "proof", "--effects-folder", "nowhere", "--limit", "1"]) == 2
    assert "nowhere, --effects-folder: no file of an effect. Name a folder with" in capsys.readouterr().err


@pytest.mark.parametrize("line", ["inspect ''", "hammer '' --turnout W1", "report --pages ''", "query ''", "init ''"])
def test_an_empty_argument_is_not_accepted_as_a_path(project, capsys, line):
    """An unset "$FILE" of a shell gives such an argument; as a path it would be the current folder."""
    with pytest.raises(SystemExit) as end:
        main(shlex.split(line))
    assert end.value.code == 2 and "is empty. Give it a value, or leave it out" in capsys.readouterr().err


@pytest.mark.parametrize("sql", ["select 1; select 2", ";", "-- nothing"])
def test_a_command_accepts_exactly_one_query(tmp_path, capsys, sql):
    register([], tmp_path, read=iter)
    assert main(["query", sql, "--registry", str(tmp_path)]) == 2
    assert "Give one query." in capsys.readouterr().err


def test_a_section_of_the_track_that_the_layout_lacks_is_reported(project, capsys):
    layout = project / "config/layouts/tommerup.yaml"
    lines = layout.read_text().splitlines(keepends=True)
    layout.write_text("".join(line for line in lines if not line.lstrip().startswith("SP:")))
    (project / "a.csv").write_text("no numbers\n")
    assert main(["calibrate", "a.csv", "--turnout", "W1", "--section", "SP"]) == 2
    assert "'SP' is no section of W1" in capsys.readouterr().err


def test_inspect_reports_every_entry_of_a_folder_that_it_cannot_read(tmp_path, capsys, monkeypatch):
    (tmp_path / "raw/closed").mkdir(parents=True)
    (tmp_path / "raw/a.csv").symlink_to("nowhere.csv")
    (tmp_path / "raw/b.csv").symlink_to("b.csv")
    walk = os.walk

    def walk_of_another_user(top, onerror):
        onerror(PermissionError(13, "Permission denied", str(tmp_path / "raw/closed")))
        yield from walk(top)

    monkeypatch.setattr(os, "walk", walk_of_another_user)
    assert main(["inspect", str(tmp_path / "raw")]) == 2
    printed, message = capsys.readouterr()
    assert "raw/a.csv: not read" in printed and "raw/b.csv: not read" in printed
    assert f"{tmp_path}/raw/closed: Permission denied" in message


def test_inspect_checks_the_tables_beside_the_recordings(tmp_path, capsys):
    (tmp_path / "campaigns.csv").write_text(
        "campaign,started_at_utc,rail_temperature_c\n2026-05-13,2026-05-13T09:00:00,12\n2026-5-14,,9\n"
    )
    (tmp_path / "trains.csv").write_text("passed_at_utc,train_type\n2026-05-13T10:00:00,IC3\n")
    assert main(["inspect", str(tmp_path / "trains.csv")]) == 0
    assert "trains.csv: a table beside the recordings, 1 row that can be used" in capsys.readouterr().out
    assert main(["inspect", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "campaigns.csv: a table beside the recordings, 1 row that can be used" in printed
    assert "line 3, column 1: campaign is '2026-5-14'" in printed and "not read" not in printed


def test_plots_of_files_with_the_same_name_do_not_overwrite_each_other(tmp_path, repository, monkeypatch, capsys):
    monkeypatch.chdir(repository)
    file = tmp_path / "a/A7_1.csv"
    assert main(["simulate", "hammer", "--section", "A7", "--impacts", "1", "--out", str(file)]) == 0
    (tmp_path / "b").mkdir()
    shutil.copy(file, tmp_path / "b")
    monkeypatch.chdir(tmp_path)
    main(["inspect", "a/A7_1.csv", "b", "--plot"])
    assert {p.name for p in tmp_path.glob("*.svg")} == {"A7_1.csv.svg", "b_A7_1.csv.svg"}


def test_a_tab_in_yaml_is_reported(project, capsys):
    (project / "config/config.yaml").write_text("fleet:\n\tshards: 2\n")
    assert main(["check"]) == 2
    assert "config/config.yaml, line 2, column 1: a tab. Write blanks" in capsys.readouterr().err


def test_a_count_of_one_is_in_the_singular(project, capsys):
    shutil.rmtree(project / "raw/W1")
    main(["check"])
    assert "config: 1 turnout with 1 layout, 0 events, 0 acknowledgements, no fault." in capsys.readouterr().out


@pytest.mark.parametrize("name", ["tommerup", "unused"])
def test_an_unfinished_draft_of_a_layout_is_listed(project, capsys, name):
    """A draft that no turnout uses yet is listed, too."""
    layout = project / f"config/layouts/{name}.yaml"
    text = (project / "config/layouts/tommerup.yaml").read_text()
    layout.write_text(text.replace("position: 24.6}  ", "position: 24.6}  # DECIDE: position [m]"))
    assert main(["check"]) in (0, 1)
    line = 1 + layout.read_text().splitlines().index(next(x for x in layout.read_text().splitlines() if "DECIDE" in x))
    assert f"config/layouts/{name}.yaml, line {line}: position [m]" in capsys.readouterr().out


def test_check_states_how_to_add_the_first_turnout(tmp_path, monkeypatch, capsys):
    create_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["check"]) == 0 and "no turnout yet: `turnout add ID LAYOUT` adds one" in capsys.readouterr().out


def test_the_first_command_of_a_project_can_be_pasted_into_a_shell(tmp_path, capsys):
    folder = tmp_path / "Prüf stand's"
    assert main(["init", str(folder)]) == 0
    assert shlex.split(capsys.readouterr().out.split("first: ")[1]) == ["cd", str(folder)]


def test_the_first_command_does_not_pass_a_folder_name_with_a_leading_dash_as_an_option(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["init", "--", "-a b"]) == 0
    assert shlex.split(capsys.readouterr().out.split("first: ")[1]) == ["cd", "./-a b"]


def test_the_next_init_completes_an_interrupted_one(tmp_path, monkeypatch):
    write, n_written = project_module.write_text, []

    def interrupted(path, text):
        if len(n_written) == 5:
            raise KeyboardInterrupt
        n_written.append(path)
        write(path, text)

    monkeypatch.setattr(project_module, "write_text", interrupted)
    with pytest.raises(KeyboardInterrupt):
        create_project(tmp_path)
    monkeypatch.undo()
    assert create_project(tmp_path)
    names = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()}
    create_project(tmp_path / "whole")
    assert names == {str(p.relative_to(tmp_path / "whole")) for p in (tmp_path / "whole").rglob("*") if p.is_file()}


def test_the_list_of_events_states_that_it_is_empty(project, capsys):
    assert main(["events"]) == 0
    assert "config/events.csv: no event yet" in capsys.readouterr().out


def test_config_generate_writes_no_page_of_the_documentation_into_a_project(project, capsys):
    assert main(["config", "generate"]) == 0
    assert not (project / "docs").exists() and "settings.md" not in capsys.readouterr().out


def test_nightly_outside_a_project_writes_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["nightly"]) == 2
    assert "Run the command in the folder of a project" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_nightly_with_a_wrong_configuration_starts_nothing(project, capsys):
    (project / "config" / "config.yaml").write_text("fleet: {shard: 3}\n")
    assert main(["nightly"]) == 2
    assert "config/config.yaml, line 1, column 9: unknown key 'shard'" in capsys.readouterr().err
    assert not any((project / name).exists() for name in ("work", "logs", ".snakemake"))


@pytest.mark.parametrize("name", ["Switch\x00 1", "Switch\x07", "a\x1b[31mred", "a\x7f"])
def test_a_name_with_a_control_character_is_an_error(project, capsys, name):
    table = project / "config" / "turnouts.tsv"
    table.write_text(f"turnout\tlayout\tname\nW1\ttommerup\t{name}\n")
    assert main(["check"]) == 2
    assert "config/turnouts.tsv, line 2, column 13: name is" in (message := capsys.readouterr().err)
    assert "Write it without control characters" in message and name not in message


def test_the_error_of_a_missing_configuration_names_the_folder_and_not_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["config", "show", "W1"]) == 2
    assert "turnout config: config, the folder: there is no such folder" in capsys.readouterr().err


def options_of(parser):
    """All options of a parser and of its subcommands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for subparser in action.choices.values():
                yield from options_of(subparser)
        else:
            yield action


@pytest.mark.parametrize("command", COMMANDS)
def test_no_option_uses_float_or_int_as_its_type(command):
    """``float`` accepts nan and inf, and the message of ``int`` contains the name of a Python type."""
    parser = argparse.ArgumentParser()
    import_module(f"turnout.cli.{command}").add_arguments(parser)
    assert not [action.dest for action in options_of(parser) if action.type in (float, int)]


def test_the_error_of_a_file_without_write_permission_names_the_file_and_no_temporary_file(
    project, capsys, monkeypatch
):
    def forbidden(file, mode="r", **options):
        if "w" in mode:
            raise PermissionError(13, "Permission denied", str(file))
        return open(file, mode, **options)

    monkeypatch.setattr(files_module, "open", forbidden, raising=False)
    assert main(["add", "W2", "tommerup"]) == 2
    message = capsys.readouterr().err
    assert "config/turnouts.tsv: Permission denied" in message and ".tmp" not in message


def test_a_failed_export_leaves_no_folder(project, capsys):
    assert main(["export", "out"]) == 2
    assert "there is no registry here" in capsys.readouterr().err and not (project / "out").exists()


def test_maintenance_that_is_already_listed_is_not_added_again(project, capsys):
    line = ["events", "W1", "tamping", "2026-04-02"]
    assert main(line) == 0
    before = (project / "config/events.csv").read_bytes()
    assert main([*line, "--resets", "none"]) == main(line) == 2
    assert (project / "config/events.csv").read_bytes() == before
    assert "config/events.csv, the work: tamping at W1, 2026-04-02, is there already." in capsys.readouterr().err


ENTRIES = {  # an entry of a track file, and the message of `turnout check`
    "term: local_padd\n    sleeper: 18.0": "W1.yaml, terms[0]: no effect 'local_padd'; there are",
    "term: local_pad\n    faktor: 0.5": "W1.yaml, terms[0]: local_pad has no 'faktor'; it has factor, sleeper",
    "term: local_pad\n    sleeper: 900\n    factor: {value: 0.5, unit: '-', source: me}": "is on no route of the track",
    "term: local_pad\n    sleeper: 18\n    factor: {value: -3, unit: '-', source: me}": (
        "W1.yaml, terms[0]: local_pad[18.0 m]: factor is -3. Write 0.05 to 8."
    ),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_an_entry_of_a_track_file_that_cannot_be_simulated_is_a_fault_of_the_configuration(project, capsys, entry):
    track = project / "config/tracks/W1.yaml"
    track.write_text(f"extends: tommerup\nterms:\n  - {entry}\n")
    assert main(["check"]) == 1
    printed = capsys.readouterr().out
    assert "no simulation: " in printed and str(track.relative_to(project)) in printed and ENTRIES[entry] in printed


VALUES = {
    "tracks/tommerup.yaml: {value: 466.3, unit: MN/m => {value: 466.3, unit: N/m": (
        "improbable: config/tracks/tommerup.yaml, line 43, sections[0].pad_stiffness: 466.3 N/m is outside 1e+06 to"
    ),
    "tracks/tommerup.yaml: {value: 400, unit: MN/m => {value: -400, unit: MN/m": "pad_stiffness: -4e+08 N/m is outside",
    "tracks/tommerup.yaml: {value: 210, unit: GPa => {value: 210, unit: Pa": "rail.youngs_modulus: 210 Pa is outside",
    "tracks/tommerup.yaml: prior: 0.03} => prior: 30}": "a prior of 30 is a standard deviation of 3000 %. Write it as",
    "vehicles/ic3.yaml: {value: 24.6, unit: t => {value: 24.6, unit: kg": (
        "improbable: config/vehicles/ic3.yaml, line 15, car_types.end_car.mass: 24.6 kg is outside 100 to 300000 kg."
    ),
    "vehicles/ic3.yaml: {value: 0.43, unit: m => {value: 430, unit: m": "wheel.radius: 430 m is outside 0.1 to 0.65 m.",
    "vehicles/ic3.yaml: centre: {value: 54.6 => centre: {value: 154.6": (
        "no train: config/vehicles/ic3.yaml, line 41, bogies[3].centre: 154.6 m is outside the unit, whose length is"
    ),
    "vehicles/ic3.yaml: type: end_bogie => type: end_bogy": "no train: config/vehicles/ic3.yaml, line 22, bogie_types:",
    "vehicles/axle_patterns.yaml: vehicles: => vehicle:": (
        "no train: config/vehicles/axle_patterns.yaml, vehicles and trains: 'vehicles' is missing."
    ),
    "vehicles/axle_patterns.yaml: trains: => trains: []\nothers:": "names with values. Compare it with the file",
}


@pytest.mark.parametrize("change", VALUES)
def test_files_of_tracks_and_vehicles_are_checked(project, capsys, change):
    name, _, edit = change.partition(": ")
    old, new = edit.split(" => ")
    path = project / "config" / name
    assert main(["check"]) == 1  # the only problem of the example is in its raw files
    printed = capsys.readouterr().out
    assert "improbable" not in printed and "no train" not in printed
    content = path.read_text()
    assert old in content
    path.write_text(content.replace(old, new, 1))
    assert main(["check"]) == 1
    assert VALUES[change] in capsys.readouterr().out


def test_a_file_in_place_of_the_folder_of_recordings_is_reported(project, capsys):
    shutil.rmtree(project / "raw")
    (project / "raw").write_text("")
    assert main(["check"]) == 2
    assert "raw, --raw: it is a file. Write the folder" in capsys.readouterr().err
