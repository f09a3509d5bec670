"""The list of the files of the registry stays when its job cannot be submitted: Snakemake removes it then."""

import subprocess
import sys

import pytest

from turnout.workflow.registry_copy import COPY, LIST, copy_list, restore_list


@pytest.fixture(autouse=True)
def in_project(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    LIST.parent.mkdir(parents=True)


def test_the_list_that_a_failed_run_has_removed_is_put_back():
    LIST.write_text("generation 7")
    copy_list()
    LIST.unlink()
    restore_list()
    assert LIST.read_text() == "generation 7"


def test_a_newer_list_is_left_as_it_is():
    LIST.write_text("generation 7")
    copy_list()
    LIST.write_text("generation 8")
    restore_list()
    assert LIST.read_text() == "generation 8"


def test_a_registry_that_was_deleted_before_the_run_does_not_come_back():
    LIST.write_text("generation 7")
    copy_list()
    LIST.unlink()
    copy_list()
    restore_list()
    assert not LIST.exists() and not COPY.exists()


def test_the_workflow_keeps_the_list_of_a_job_that_could_not_be_submitted(repository, tmp_path):
    """The hooks of the Snakefile, with a rule whose job fails after Snakemake has lost its backup."""
    text = (repository / "Snakefile").read_text()
    hooks = text[text.index("onstart:") : text.index("localrules:")]
    rule = f"""
from turnout.workflow.registry_copy import copy_list, restore_list
{hooks}
rule register:
    output: update("{LIST}")
    shell: "rm -r .snakemake/backups; exit 1"
"""
    (tmp_path / "Snakefile").write_text(rule)
    LIST.write_text("generation 7")
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--forceall"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 1 and "Removing output files of failed job register" in ended.stderr, ended.stderr
    assert LIST.read_text() == "generation 7"
