"""A command that can use none of its inputs ends with exit code 1, whatever the command."""

import json
from contextlib import nullcontext
from dataclasses import replace
from importlib import import_module
from inspect import getsource
from pathlib import Path
from types import SimpleNamespace

import pytest

from turnout.cli import COMMANDS
from turnout.cli.main import EXIT_CODES, main
from turnout.workflow.nightly import NightReport
from turnout.workflow.project import create_project

CONTINUING = {"blind", "diagnose", "nightly", "plan", "trains"}  # they continue without the inputs that they cannot use
CHECKING = {"check", "hammer", "inspect", "passage"}  # exit code 1 for one problem, or without a train
NEEDING_INPUT = {"calibrate", "compare", "layout", "paper", "twin"}  # exit code 2 without a usable input
OTHERS = {  # they query a registry or a track file, or write what the user typed
    "acknowledge", "add", "alert", "completion", "config", "demo", "distinguish", "events", "export", "init", "query",
    "real", "registry", "report", "simulate", "worklist",
}  # fmt: skip


def test_every_command_is_of_one_kind_and_those_that_continue_state_which_inputs_they_used():
    assert sorted([*CONTINUING, *CHECKING, *NEEDING_INPUT, *OTHERS]) == sorted(COMMANDS)
    stating = {name for name in COMMANDS if "add_use(" in getsource(import_module(f"turnout.cli.{name}"))}
    assert stating == CONTINUING


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A new project with one turnout and its folder of recordings."""
    create_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["add", "t1", "tommerup"]) == 0
    (tmp_path / "raw/t1/hammer").mkdir(parents=True)
    return tmp_path


def diagnose(monkeypatch, n_used, n_left_out):
    finding = {
        "sections": "A7", "verdict": "none", "grade": None, "probability": 0.9, "sentence": "s.", "n_held_out": 0,
        "next_measurement": None, "n_hammer_tests": 1, "n_passages": 0, "n_sensors": 1, "notes": None,
    }  # fmt: skip
    rows = {
        "mismatch_findings": [finding] * n_used,
        "quarantine": [{"place": "A8", "found": "no hammer test"}] * n_left_out,
    }
    monkeypatch.setattr("turnout.cli.diagnose._diagnose", lambda args: rows)
    monkeypatch.setattr("turnout.stages.mismatch_results.Results.save", lambda self, tables: None)
    monkeypatch.setattr("turnout.report.finding_pages.write_diagnosis_page", lambda *args: "page.html")
    return ["diagnose", "--turnout", "t1"]


def trains(monkeypatch, n_used, n_left_out):
    """Used: the clusters. Left out: the turnout without weighed trains, which always exists."""
    cluster = SimpleNamespace(id="a", mean=[4.0], n=9)
    clusters = SimpleNamespace(version=1, clusters=[cluster] * n_used)
    monkeypatch.setattr("turnout.registry.database.open_registry", lambda path: nullcontext())
    monkeypatch.setattr("turnout.stages.passage_training.learn_clusters", lambda *args: clusters)
    return ["trains"]


def plan(monkeypatch, n_used, n_left_out):
    for number in range(n_used):
        Path(f"raw/t1/hammer/2024-05-1{number}").mkdir()
        Path(f"raw/t1/hammer/2024-05-1{number}/A7_1.uff").write_text("x")
    for number in range(n_left_out):
        Path(f"raw/t1/hammer/notes {number}.uff").write_text("x")
    return ["plan"]


def nightly(monkeypatch, n_used, n_left_out):
    unused = tuple(f"t{k}" for k in range(n_left_out))
    night = replace(NightReport(0, 5, 5, 0, 0), unused=unused, nothing_usable=n_used == 0 and bool(unused))
    monkeypatch.setattr("turnout.workflow.nightly.nightly", lambda *args, **options: night)
    return ["nightly"]


def blind(monkeypatch, n_used, n_left_out):
    status = ["answered"] * n_used + ["failed"] * n_left_out
    record = {"cases": {str(k): {"status": s} for k, s in enumerate(status)}, "isolation": "nothing"}
    monkeypatch.setattr("turnout_blind.diagnose.diagnose_set", lambda *args, **options: record)
    return ["blind", "diagnose", "--out", "set"]


@pytest.mark.parametrize(("n_used", "n_left_out", "code"), [(0, 2, 1), (1, 2, 0), (1, 0, 0)])
@pytest.mark.parametrize("command", [diagnose, trains, plan, nightly, blind], ids=lambda c: c.__name__)
def test_only_a_command_that_could_use_no_input_has_exit_code_1(
    project, monkeypatch, capsys, command, n_used, n_left_out, code
):
    words = command(monkeypatch, n_used, n_left_out)
    assert main([*words, "--json"]) == code
    assert json.loads(capsys.readouterr().out)["exit_code"] == code


@pytest.mark.parametrize("held", [{}, {"2024-05-13": "named"}])
def test_visits_that_all_differ_from_the_track_file_give_exit_code_0(project, monkeypatch, held):
    """Ballast with a third of its stiffness from the first day: the answer is that no visit agrees with the file."""
    history = SimpleNamespace(used_steps=[], steps=[object()] * 4)
    model = SimpleNamespace(history=history, held=held)
    monkeypatch.setattr("turnout.stages.calibrated_model.calibrate_turnout", lambda *args: model)
    monkeypatch.setattr("turnout.stages.calibrated_model.answer_rows", lambda model: [])
    monkeypatch.setattr("turnout.cli.twin.model_text", lambda *args: ["against the file: local ballast"])
    assert main(["twin", "--turnout", "t1"]) == 0


def test_the_page_of_commands_lists_the_commands_that_continue(repository):
    text = (repository / "docs/commands.md").read_text()
    names = {"blind": "blind diagnose"}
    assert all(f"`{names.get(name, name)}`" in text.partition("and 1 if none did")[2] for name in CONTINUING)
    assert "none of the inputs could be used" in EXIT_CODES
