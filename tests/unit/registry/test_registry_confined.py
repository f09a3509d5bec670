"""A query reads the files of the registry, writes no file, and has no access to anything else on the machine."""

import csv
import io
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb
import pytest
from registry_rows import Bench, hammer_result

from turnout.cli.main import main
from turnout.cli.worklist import _write
from turnout.registry.damage import damage_message


@pytest.fixture(scope="module")
def registry(tmp_path_factory):
    root = tmp_path_factory.mktemp("confined")
    (root / "work").mkdir()
    (root / "secret.csv").write_text("password\nsesame\n")
    bench = Bench(root)
    bench.register(hammer_result(), tables={"turnouts": [{
        "turnout_id": "t1", "name": "=HYPERLINK(1)", "line": "-1+1", "layout": "l", "config_hash": "h",
    }]})  # fmt: skip
    return bench.registry


def query(registry, sql, *more):
    return main(["query", sql, "--registry", str(registry), *more])


@pytest.mark.parametrize("damage", [Path.unlink, lambda file: file.write_bytes(b"no Parquet")])
def test_a_damaged_file_is_not_reported_as_a_fault_of_the_query(registry, tmp_path, capsys, damage):
    copy = tmp_path / "registry"
    shutil.copytree(registry, copy)
    assert main(["registry", "relocate", "--registry", str(copy)]) == 0
    damage(next((copy / "modes").glob("year=*/*.parquet")))
    assert query(copy, "from modes") == 2
    assert "A file of the registry is damaged or absent: 'turnout registry check'" in capsys.readouterr().err
    assert query(copy, "from mode") == 2
    assert "'turnout query --list' names the tables, views and macros" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        ["query", "from modes"], ["export", "out"], ["worklist"], ["worklist", "--csv", "list.csv"], ["report"],
        ["alert", "--dry-run"], ["events", "--effect"], ["paper", "t1"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_no_command_takes_a_damaged_file_for_its_own_fault(
    registry, tmp_path, repository, monkeypatch, capsys, command
):
    copy = tmp_path / "results/registry"
    shutil.copytree(registry, copy)
    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    assert main(["registry", "relocate"]) == 0
    for file in copy.rglob("*.parquet"):
        file.write_bytes(b"no Parquet")
    assert main(command) == 2
    message = capsys.readouterr().err
    assert (
        "A file of the registry is damaged or absent: 'turnout registry check' names each, with what to do" in message
    )
    assert "Traceback" not in message


@pytest.mark.parametrize(
    ("name", "is_file"),
    [
        ("registry/modes/a.parquet", True), ("registry/registry.duckdb", True), ("registry_export/modes.csv", False),
        ("registry/.spill/duckdb_temp_storage-0.tmp", False), ("registry/registry.duckdb.tmp", False),
    ],
)  # fmt: skip
def test_only_an_error_that_names_a_file_of_the_registry_is_damage(tmp_path, name, is_file):
    """A folder beside it may be full or closed, and so may the folder for what exceeds the memory."""
    error = duckdb.IOException(f'IO Error: Cannot open file "{tmp_path / name}": No space left on device')
    assert bool(damage_message(error, tmp_path / "registry")) == is_file
    assert not damage_message(OSError(str(error)), tmp_path / "registry")


def test_a_registry_that_another_program_has_open_is_not_reported_as_damaged(registry, tmp_path, capsys):
    shutil.copytree(registry, tmp_path / "registry")
    file = tmp_path / "registry" / "registry.duckdb"
    program = f"import duckdb\nheld = duckdb.connect({str(file)!r})\nprint('held', flush=True)\ninput()"
    words = [sys.executable, "-c", program]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        assert query(file.parent, "from modes") == 2
        other.stdin.write("\n")
    message = capsys.readouterr().err
    assert "Another program has it open for writing: close it there, or open it there read-only." in message
    assert "damaged" not in message


@pytest.mark.parametrize(
    "sql",
    [
        "copy (select 1) to '{root}/written'",
        "copy (select 1 as x) to '{root}/registry/_generation.json'",
        "explain analyze copy (select 1) to '{root}/registry/written'",
        "explain (analyze) copy (select 1) to '{root}/registry/written'",
        "select 1; copy (select 1) to '{root}/registry/written'",
        "/* from */ copy (select 1) to '{root}/registry/written'",
        "export database '{root}/registry/written'",
        "from '{root}/secret.csv'",
        "from read_csv('{root}/secret.csv')",
        "from read_text('{root}/registry/../secret.csv')",
        "from glob('{root}/*')",
        "from query('copy (select 1) to ''{root}/registry/written''')",
        "attach '{root}/written' as w",
        "install httpfs",
        "load httpfs",
        "set enable_external_access = true",
        "pragma enable_external_access",
        "create table x (i int)",
        "from 'http://127.0.0.1:9/x.parquet'",
    ],
)
def test_a_query_that_writes_or_accesses_other_files_is_rejected(registry, sql, capsys):
    before = {p: p.read_bytes() for p in registry.parent.rglob("*") if p.is_file() and p.name != ".lock"}
    assert query(registry, sql.format(root=registry.parent)) != 0
    assert "sesame" not in capsys.readouterr().out
    assert {p: p.read_bytes() for p in registry.parent.rglob("*") if p.is_file() and p.name != ".lock"} == before


@pytest.mark.parametrize(
    "sql",
    [
        "from modes",
        "with m as (from modes) select count(*) from m",
        "describe modes",
        "summarize modes",
        "show tables",
        "explain from modes",
        "explain analyze select * from modes",
        "pivot modes on band using max(frequency_hz)",
        "from worklist(timestamp '2026-02-01')",
    ],
)
def test_queries_that_only_read_are_accepted(registry, sql):
    assert query(registry, sql) == 0


def test_a_csv_has_no_formula(registry, tmp_path):
    out = tmp_path / "out.csv"
    assert query(registry, "select name, line, -1.5 as n, '@x' as \"=y\" from turnouts", "--csv", str(out)) == 0
    assert list(csv.reader(out.open(encoding="utf-8-sig"))) == [
        ["name", "line", "n", "'=y"],
        ["'=HYPERLINK(1)", "'-1+1", "-1.5", "'@x"],
    ]
    stream = io.StringIO()
    _write(stream, ["name"], [("+x",), (-2.0,)])
    assert stream.getvalue() == "name\n'+x\n-2.0\n"


def test_a_misspelt_name_is_reported_if_a_query_returns_no_row(registry, capsys):
    assert query(registry, "from turnouts where turnout_id = 't11'") == 0
    assert capsys.readouterr().err == "The registry has no 't11'. Did you mean 't1'?\n"
    for text, remark in (
        ("tamping", "The registry has no event of the kind 'tamping'."),
        ("tampin", "The registry has no 'tampin'. Did you mean 'tamping'?"),
    ):
        assert query(registry, f"from change_since_event('{text}', 90)") == 0
        assert capsys.readouterr().err == f"{remark}\n"
    for sql in ("from turnouts where turnout_id = 't1' and name = ''", "select 'T1'"):
        assert query(registry, sql) == 0
        assert capsys.readouterr().err == "", sql
    assert query(registry, "from turnouts where turnout_id = 't11'", "--quiet") == 0
    assert capsys.readouterr().err == ""
