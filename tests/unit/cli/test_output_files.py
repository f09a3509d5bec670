"""Every command that writes a file makes missing folders, and says before it computes that a file cannot be written."""

import os

import pytest

from turnout.cli.main import build_parser, main
from turnout.cli.options import leaf_parsers
from turnout.files import make_folder, output_problem, whole_file, write_text
from turnout.registry.job import register

COMMANDS = {  # option of an output file -> the rest of a command line, by command
    ("turnout hammer", "--figure"): "hammer a.csv --turnout W1",
    ("turnout passage", "--figure"): "passage a.csv --turnout W1",
    ("turnout compare", "--figure"): "compare a.csv --turnout W1",
    ("turnout compare", "--csv"): "compare a.csv --turnout W1",
    ("turnout paper", "--figure"): "paper W1",
    ("turnout query", "--csv"): "query worklist",
    ("turnout worklist", "--csv"): "worklist",
    ("turnout simulate hammer", "--out"): "simulate hammer --section A7",
    ("turnout simulate passage", "--out"): "simulate passage",
    ("turnout blind score", "--report"): "blind score --out proof",
    ("turnout blind score", "--page"): "blind score --out proof",
}
FILE_OPTIONS = ("--figure", "--csv", "--report", "--page")
NO_PERMISSION = "no permission to write in"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder with a folder and a file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.svg").mkdir()
    (tmp_path / "file").write_text("kept")
    return tmp_path


@pytest.fixture
def registry(folder):
    """An empty registry in the usual place."""
    register([], folder / "results/registry", read=iter)


def test_the_list_of_output_files_is_complete():
    options = {
        (leaf.prog, option)
        for leaf in leaf_parsers(build_parser())
        for option in FILE_OPTIONS
        if option in leaf._option_string_actions
    }
    assert options <= COMMANDS.keys()


@pytest.mark.parametrize(("command", "option"), COMMANDS)
@pytest.mark.parametrize(
    ("name", "problem"),
    [("folder.svg", "it is a folder. Write the name of a file"), ("file/a.svg", "file is a file, not a folder")],
)
def test_a_path_that_cannot_be_written_is_an_error_before_anything_is_read(
    folder, capsys, command, option, name, problem
):
    assert main([*COMMANDS[command, option].split(), option, name]) == 2
    message = capsys.readouterr().err
    assert f"{name}, {option}: " in message and problem in message and (folder / "file").read_text() == "kept"


@pytest.mark.parametrize(("command", "option"), COMMANDS)
def test_a_folder_without_permission_is_an_error_before_anything_is_read(folder, capsys, monkeypatch, command, option):
    monkeypatch.setattr("turnout.files.os.access", lambda path, mode: False)  # root may write everywhere
    assert main([*COMMANDS[command, option].split(), option, "new/a.svg"]) == 2
    assert f"new/a.svg, {option}: {NO_PERMISSION} {folder}. Correct its permissions" in capsys.readouterr().err


def test_a_simulation_makes_the_folder_of_its_file(folder):
    command = ["simulate", "hammer", "--track", "tommerup", "--section", "A7", "--impacts", "1"]
    assert main([*command, "--out", "new/folder/a.npz"]) == 0 and (folder / "new/folder/a.npz").is_file()


@pytest.mark.parametrize("command", ["worklist", "query"])
def test_a_table_makes_the_folder_of_its_file(folder, registry, command):
    words = ["query", "from turnouts"] if command == "query" else ["worklist"]
    assert main([*words, "--csv", "new/folder/a.csv"]) == 0 and (folder / "new/folder/a.csv").is_file()


def test_all_functions_that_write_files_make_folders(folder):
    write_text("one/two/a.txt", "a")
    with whole_file("three/four/a.txt") as unfinished:
        unfinished.write_text("a")
    assert (folder / "one/two/a.txt").read_text() == (folder / "three/four/a.txt").read_text() == "a"


@pytest.mark.parametrize("line", ["export file", "simulate figures --out file", "report --pages file/pages"])
def test_a_file_in_place_of_a_folder_of_results_is_named(folder, registry, capsys, line):
    assert main(line.split()) == 2
    assert "file: it is a file, not a folder." in capsys.readouterr().err


def test_a_device_and_a_new_file_can_be_written(folder):
    assert output_problem(os.devnull) is None and output_problem("new/a.svg") is None
    make_folder("new")
    assert output_problem("new/a.svg") is None
