"""A registry works in a folder of any name: characters of DuckDB's file patterns are taken literally."""

import shutil

import pytest
from registry_rows import Bench, hammer_result, quarantined_result

from turnout.cli.main import main
from turnout.errors import RegistryError
from turnout.registry.compaction import compact, rebuild
from turnout.registry.database import rebuild_database

COUNTS = "select (select count(*) from results), (select count(*) from models), (select count(*) from modes_current)"


def bench_in(folder):
    (folder / "work").mkdir(parents=True)
    return Bench(folder)


@pytest.mark.parametrize(("pattern", "matched"), [("line*", "line 1"), ("line [12]", "line 2")])
def test_a_registry_whose_name_is_a_pattern_that_matches_a_copy_reads_only_its_own_rows(pattern, matched, tmp_path):
    bench = bench_in(tmp_path / pattern)
    bench.register(hammer_result())
    shutil.copytree(bench.registry, tmp_path / matched / "registry")
    bench.register(hammer_result(day="2026-02-09"), hammer_result(key="k2"), quarantined_result("t2"))
    once = [(4, 3, 2)]  # the first test was computed again: its first model is superseded
    assert bench.ask(COUNTS) == once
    shutil.rmtree(tmp_path / matched)
    shutil.copytree(bench.registry, tmp_path / matched / "registry")
    rebuild_database(bench.registry)
    assert bench.ask(COUNTS) == once
    compact(bench.registry)
    rebuild(bench.registry)
    assert bench.ask(COUNTS) == once


@pytest.mark.parametrize("name", ["what?", "a\\b"])
def test_a_folder_name_that_duckdb_cannot_use_is_rejected_before_any_file_is_written(name, tmp_path):
    bench = bench_in(tmp_path / name)
    with pytest.raises(RegistryError, match="Rename that folder, or put the registry elsewhere"):
        bench.register(hammer_result())
    assert not list(bench.registry.rglob("*.parquet"))


def test_a_failed_export_gives_one_sentence(bench, tmp_path, capsys):
    bench.register(hammer_result())
    (tmp_path / "out/modes.parquet").mkdir(parents=True)
    options = ["--only", "modes", "--registry", str(bench.registry)]
    assert main(["export", str(tmp_path / "out"), *options]) == 2
    assert f"turnout export: modes cannot be written to {tmp_path / 'out'}: " in capsys.readouterr().err
