"""A registry lies in a folder of any name: what DuckDB would take for a pattern stands for itself."""

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
def test_a_registry_holds_its_own_rows_though_its_name_as_a_pattern_matches_a_copy(pattern, matched, tmp_path):
    bench = bench_in(tmp_path / pattern)
    bench.register(hammer_result())
    shutil.copytree(bench.registry, tmp_path / matched / "registry")
    bench.register(hammer_result(day="2026-02-09"), hammer_result(key="k2"), quarantined_result("t2"))
    once = [(4, 3, 2)]  # the first test was computed again: its first model no longer counts
    assert bench.ask(COUNTS) == once
    shutil.rmtree(tmp_path / matched)
    shutil.copytree(bench.registry, tmp_path / matched / "registry")
    rebuild_database(bench.registry)
    assert bench.ask(COUNTS) == once
    compact(bench.registry)
    rebuild(bench.registry)
    assert bench.ask(COUNTS) == once


@pytest.mark.parametrize("name", ["what?", "a\\b"])
def test_a_folder_in_which_no_database_can_be_made_is_rejected_before_anything_is_written(name, tmp_path):
    bench = bench_in(tmp_path / name)
    with pytest.raises(RegistryError, match="Rename that folder, or put the registry elsewhere"):
        bench.register(hammer_result())
    assert not list(bench.registry.rglob("*.parquet"))


def test_an_export_that_cannot_be_written_is_one_sentence(bench, tmp_path, capsys):
    bench.register(hammer_result())
    (tmp_path / "out/modes.parquet").mkdir(parents=True)
    asked = ["--only", "modes", "--registry", str(bench.registry)]
    assert main(["export", str(tmp_path / "out"), *asked]) == 2
    assert f"turnout export: modes cannot be written to {tmp_path / 'out'}: " in capsys.readouterr().err
