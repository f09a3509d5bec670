"""The files of the workflow keep to their style, and profiles and default stages are used."""

import re
import subprocess
import sys

import pytest
import toy_fleet as toy

RULES = sorted((toy.REPOSITORY / "rules").glob("*.smk"))
SCRIPTS = sorted((toy.REPOSITORY / "scripts").glob("*.py"))
# Elsewhere every script job may have its own environment; here all jobs share one.
ALLOWED = "Specify a conda environment or container for each rule."


def test_snakemake_lint_is_clean(tmp_path):
    folder = toy.make(tmp_path, n_turnout=1)
    done = toy.run(folder, "--lint", check=False)
    complaints = re.findall(r"^\s+\* (.*?):", done.stdout, re.M)
    assert [c for c in complaints if c != ALLOWED] == [], done.stdout


def test_snakefmt_is_clean():
    files = [str(toy.REPOSITORY / "Snakefile"), *map(str, RULES)]
    done = subprocess.run([sys.executable, "-m", "snakefmt", "--check", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", RULES, ids=lambda p: p.name)
def test_every_rule_has_log_benchmark_resources_and_no_code(path):
    text = path.read_text()
    assert len(text.splitlines()) < 120 and not re.search(r"^\s+run:", text, re.M)
    for body in re.split(r"^rule ", text, flags=re.M)[1:]:
        for word in ("log:", "benchmark:", "resources:", "script:"):
            assert re.search(rf"^    {word}", body, re.M), f"{path.name}, rule {body.split(':')[0]} lacks {word}"


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.name)
def test_every_script_is_short(path):
    lines = path.read_text().splitlines()
    assert len(lines) <= 25 and lines[0].startswith('"""')


@pytest.mark.parametrize(
    ("file", "rule", "result"), [("report", "report", "pages/index.html"), ("trend", "worklist", "worklist.csv")]
)
def test_a_failed_job_keeps_the_output_of_the_day_before(file, rule, result):
    """Snakemake removes the output of a job before it starts and if it fails, except outputs to be updated."""
    text = (toy.REPOSITORY / "rules" / f"{file}.smk").read_text()
    assert f'update("results/{result}")' in text and f'again=attempts("{rule}")' in text


def test_profiles_are_read(tmp_path):
    folder = toy.make(tmp_path, n_turnout=1)
    output = toy.run(folder, "--dry-run").stdout
    assert "profiles/default" in output and "hammer" in output


def test_the_stage_of_the_program_is_the_default(tmp_path):
    folder = toy.make(tmp_path, n_turnout=1)
    output = toy.run(folder, "--dry-run", "--printshellcmds", function=None, target=None).stdout
    assert "rule hammer" in output
