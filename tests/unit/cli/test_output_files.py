"""Every command that writes a file makes missing folders, and says before it computes that a file cannot be written."""

import codecs
import json
import os
import secrets
import shlex
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import duckdb
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


@pytest.mark.parametrize("line", [
    "simulate hammer --section A7 --raw file", "simulate passage --raw file", "simulate passage --raw file/raw",
    "twin --turnout W1 --work file", "diagnose --turnout W1 --work file/work",
])  # fmt: skip
def test_a_folder_of_results_that_cannot_be_written_is_an_error_before_anything_is_computed(
    folder, capsys, monkeypatch, line
):
    for name in ("simulate_hammer", "simulate_passage"):
        monkeypatch.setattr(f"turnout.stages.simulate.{name}", None)
    assert main(line.split()) == 2
    message = capsys.readouterr().err
    assert "file" in message and "is a file, not a folder" in message and (folder / "file").read_text() == "kept"


def test_a_disk_that_is_mounted_for_reading_is_not_called_a_lack_of_permission(folder, monkeypatch):
    """No permissions help there."""
    monkeypatch.setattr(os, "statvfs", lambda path: SimpleNamespace(f_flag=os.ST_RDONLY))
    problem, remedy = output_problem("new/a.svg")
    assert problem == f"the disk of {folder} is mounted for reading" and remedy.startswith("Mount it for writing")


def test_a_simulation_makes_the_folder_of_its_file(folder):
    command = ["simulate", "hammer", "--track", "tommerup", "--section", "A7", "--impacts", "1"]
    assert main([*command, "--out", "new/folder/a.npz"]) == 0 and (folder / "new/folder/a.npz").is_file()


@pytest.mark.parametrize("command", ["worklist", "query"])
def test_a_table_makes_the_folder_of_its_file(folder, registry, command):
    words = ["query", "from turnouts"] if command == "query" else ["worklist"]
    assert main([*words, "--csv", "new/folder/a.csv"]) == 0 and (folder / "new/folder/a.csv").is_file()


@pytest.mark.parametrize("words", [["query", "select 'Ørsted ± 1' as name"], ["worklist"]])
def test_a_table_is_written_beside_json(folder, registry, capsys, words):
    assert main([*words, "--json", "--csv", "a.csv"]) == 0
    n_rows = len((folder / "a.csv").read_text(encoding="utf-8-sig").splitlines()) - 1
    assert len(json.loads(capsys.readouterr().out)["result"]) == n_rows


@pytest.mark.parametrize(
    "line", ["query 'from turnouts' --csv a.csv", "worklist --csv a.csv", "export . --format csv --only turnouts"]
)
def test_a_spreadsheet_reads_a_table_as_utf_8(folder, registry, line):
    assert main(shlex.split(line)) == 0
    (table,) = folder.glob("*.csv")
    assert table.read_bytes().startswith(codecs.BOM_UTF8) and table.read_bytes().count(codecs.BOM_UTF8) == 1
    assert "turnout_id" in duckdb.sql(f"from read_csv('{table}', header = true)").columns


@pytest.mark.parametrize("path", ["-", "/dev/stdout", "/dev//stdout", "/dev/./stdout"])
def test_a_program_gets_a_table_without_a_mark(folder, registry, path):
    command = [sys.executable, "-m", "turnout", "query", "select 1 as name", "--csv", path]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    assert done.stdout.split() == [b"name", b"1"]


@pytest.mark.parametrize("line", ["query 'from turnouts' --csv 'a[1].csv'", "export 'new' --only turnouts"])
def test_what_a_killed_command_left_is_deleted_by_the_next(folder, registry, line):
    target = Path("a[1].csv") if "csv" in line else Path("new/turnouts.parquet")
    target.parent.mkdir(exist_ok=True)
    old, present, other = (
        target.with_name(f".{stem}.{secrets.token_hex(6)}{target.suffix}") for stem in (target.stem, target.stem, "b")
    )
    for file in (old, present, other):
        file.write_text("half a tab")
    for file in (old, other):
        os.utime(file, (time.time() - 7200, time.time() - 7200))
    assert main(shlex.split(line)) == 0
    assert target.is_file() and present.exists() and other.exists() and not old.exists()


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
