"""A folder or a broken link in place of a configuration file is reported: it is not treated as a missing file."""

import errno
import os
import shutil

import pytest

from turnout.cli.main import main
from turnout.config.document import as_config_errors
from turnout.config.parameter_files import read_parameters
from turnout.config.settings.passage import PassageSettings
from turnout.errors import ConfigError
from turnout.stages.passage_context import known_patterns

ALL = ("turnouts.tsv", "events.csv", "acknowledgements.csv", "config.yaml", "layouts/tommerup.yaml",
       "overrides/tommerup_s1.yaml")  # fmt: skip
KINDS = {"folder": "Is a directory", "link": "No such file or directory"}
COMMANDS = {
    "events.csv": ["events", "tommerup_s1", "tamping", "2026-04-02"],
    "acknowledgements.csv": ["acknowledge", "tommerup_s1", "--by", "M. Jensen", "--reason", "seen"],
    "turnouts.tsv": ["add", "new", "tommerup"],
}


@pytest.fixture
def config(tmp_path, repository, monkeypatch):
    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "config"


def replace_file(path, kind):
    """Broken links result from a share that is not mounted; the files behind them must not be lost."""
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    path.mkdir() if kind == "folder" else path.symlink_to(path.parent / "share" / path.name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ALL)
def test_check_reports_the_name_and_fails(config, capsys, name, kind):
    replace_file(config / name, kind)
    assert main(["check"]) != 0
    printed = "".join(capsys.readouterr())
    assert f"config/{name}, line 1" in printed and KINDS[kind] in printed


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_row_is_not_written_to_another_file_and_one_sentence_states_the_reason(config, capsys, name, kind):
    replace_file(config / name, kind)
    assert main(COMMANDS[name]) == 2
    assert f"config/{name}" in (message := capsys.readouterr().err) and KINDS[kind] in message
    assert not (config / "share").exists() and (config / name).is_symlink() == (kind == "link")


@pytest.mark.parametrize(
    ("code", "remedy"),
    [
        (errno.EACCES, "Correct its permissions"),
        (errno.EIO, "Check the disk or the network that holds it"),
        (errno.EISDIR, "Put a file of that name there, or remove it"),
    ],
)
def test_nobody_is_asked_to_remove_a_file_that_only_cannot_be_opened(code, remedy):
    with pytest.raises(ConfigError) as caught, as_config_errors("config/turnouts.tsv", "line 1", ""):
        raise OSError(code, os.strerror(code))
    assert str(caught.value) == f"config/turnouts.tsv, line 1: cannot be read: {os.strerror(code)}. {remedy}."


def test_a_table_without_write_permission_gives_one_sentence(config, capsys, monkeypatch):
    def reject(path, content):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("turnout.config.table_edits.write_atomic", reject)  # as root has every permission
    assert main(COMMANDS["events.csv"]) == 2
    message = (
        "turnout events: config/events.csv: Permission denied. Correct its permissions, or name another file or folder"
    )
    assert capsys.readouterr().err.startswith(message)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("vehicles: [1\n", "vehicles and trains: "),
        ("vehicles: [1, 2]\ntrains: {}\n", "vehicles and trains: "),
        ("vehicles: \0\n", "the character '\\x00', which no YAML file may hold"),
    ],
)
def test_the_error_of_a_file_without_valid_axle_patterns_names_the_file(tmp_path, content, message):
    path = tmp_path / "axles.yaml"
    path.write_text(content)
    with pytest.raises(ConfigError, match=r"axles\.yaml") as caught:
        known_patterns(str(path))
    assert message in str(caught.value)


def test_a_missing_file_of_axle_patterns_that_the_settings_name_is_an_error(tmp_path, monkeypatch):
    """The default file may be absent: then no train has a type. A path that a user wrote must exist."""
    monkeypatch.chdir(tmp_path)
    assert known_patterns(PassageSettings().axle_patterns) == ()
    with pytest.raises(ConfigError, match=r"axels\.yaml, passage.axle_patterns: there is no such file"):
        known_patterns("config/vehicles/axels.yaml")


def test_the_command_trains_needs_an_existing_folder(tmp_path, capsys):
    assert main(["trains", "--raw", str(tmp_path / "rawe")]) == 2
    assert "there is no folder" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["report", "--cores", "0"], ["query", "from modes", "--rows", "-5"]])
def test_a_count_below_one_is_rejected(command, capsys):
    with pytest.raises(SystemExit):
        main(command)
    assert "is not a whole number of 1 or more" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("sources: [paper]\nx: {value: 1, unit: m, source: paper}\n", "line 1, sources: is not a mapping"),
        ("x: {value: 1, unit: m, source: [a, b]}\n", "line 1, x: a number without source"),
        ("x: {value: 1, unit: [m], source: a}\n", "line 1, x: a number without unit"),
        ("x: {value: 1, unit: m, source: estimate, prior: .nan}\n", "line 1, x: nan is not finite"),
        ("x: {value: 1, unit: m, source: estimate, prior: wide}\n", "line 1, x: 'wide' is not a number"),
        ("x: {value: 1, unit: m, source: drawing, prior: -0.1}\n", "line 1, x: a prior of -0.1"),
        ("x: {value: 1, unit: m, source: estimate, prior: 0}\n", "line 1, x: a prior of 0. Give its relative"),
        ("x: &whole\n  y: [*whole]\n", "line 1, column 4: it contains itself. Write out what the alias stands for"),
    ],
)
def test_sources_units_and_priors_of_a_wrong_kind_are_reported_with_their_line(tmp_path, content, message):
    path = tmp_path / "track.yaml"
    path.write_text(content)
    with pytest.raises(ConfigError) as caught:
        read_parameters(path)
    assert message in str(caught.value)


def test_an_empty_table_of_sources_is_accepted(tmp_path):
    path = tmp_path / "track.yaml"
    path.write_text("sources:\nx: {value: 2, unit: mm, source: drawing}\n")
    assert read_parameters(path).number("x", "m") == 0.002
