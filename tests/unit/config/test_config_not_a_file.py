"""A name of the configuration that is a folder, or a link to nothing, is said: it is no file that is not there."""

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


def put(path, kind):
    """A share that is not mounted leaves such links: what lies behind them, maintenance above all, must not be lost."""
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    path.mkdir() if kind == "folder" else path.symlink_to(path.parent / "share" / path.name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ALL)
def test_it_is_said_by_name_and_nothing_goes_on_without_it(config, capsys, name, kind):
    put(config / name, kind)
    assert main(["check"]) != 0
    told = "".join(capsys.readouterr())
    assert f"config/{name}, line 1" in told and KINDS[kind] in told


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_row_is_not_entered_elsewhere_and_one_sentence_says_why(config, capsys, name, kind):
    put(config / name, kind)
    assert main(COMMANDS[name]) == 2
    assert f"config/{name}" in (said := capsys.readouterr().err) and KINDS[kind] in said
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


def test_a_table_that_may_not_be_written_is_one_sentence(config, capsys, monkeypatch):
    def reject(path, content):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("turnout.config.table_edits.write_atomic", reject)  # we may be root
    assert main(COMMANDS["events.csv"]) == 2
    said = "turnout events: config/events.csv: Permission denied. Correct this, or name another file or folder"
    assert capsys.readouterr().err.startswith(said)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("vehicles: [1\n", "vehicles and trains: "),
        ("vehicles: [1, 2]\ntrains: {}\n", "vehicles and trains: "),
        ("vehicles: \0\n", "the character '\\x00', which no YAML file may hold"),
    ],
)
def test_axle_patterns_that_are_no_yaml_or_no_patterns_are_said_by_name(tmp_path, content, said):
    path = tmp_path / "axles.yaml"
    path.write_text(content)
    with pytest.raises(ConfigError, match=r"axles\.yaml") as caught:
        known_patterns(str(path))
    assert said in str(caught.value)


def test_axle_patterns_that_the_settings_name_and_that_are_not_there_are_said(tmp_path, monkeypatch):
    """The usual file need not be there: no train has a type then. A path that somebody wrote is a wish."""
    monkeypatch.chdir(tmp_path)
    assert known_patterns(PassageSettings().axle_patterns) == ()
    with pytest.raises(ConfigError, match=r"axels\.yaml, passage.axle_patterns: there is no such file"):
        known_patterns("config/vehicles/axels.yaml")


def test_trains_of_a_folder_that_is_not_there_are_rejected(tmp_path, capsys):
    assert main(["trains", "--raw", str(tmp_path / "rawe")]) == 2
    assert "there is no folder" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["report", "--cores", "0"], ["query", "from modes", "--rows", "-5"]])
def test_a_count_of_nothing_is_rejected(command, capsys):
    with pytest.raises(SystemExit):
        main(command)
    assert "is not a whole number of 1 or more" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "said"),
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
def test_sources_and_units_of_another_kind_are_said_with_their_line(tmp_path, content, said):
    path = tmp_path / "track.yaml"
    path.write_text(content)
    with pytest.raises(ConfigError) as caught:
        read_parameters(path)
    assert said in str(caught.value)


def test_an_emptied_table_of_sources_is_none(tmp_path):
    path = tmp_path / "track.yaml"
    path.write_text("sources:\nx: {value: 2, unit: mm, source: drawing}\n")
    assert read_parameters(path).number("x", "m") == 0.002
