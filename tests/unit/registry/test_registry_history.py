"""Generations are kept for a day, for readers that opened one earlier and for queries of an earlier state."""

import re
import shutil
from datetime import UTC, datetime, timedelta

import pytest
from registry_rows import Bench, hammer_result

from turnout.cli.main import main
from turnout.errors import RegistryError
from turnout.registry.compaction import compact
from turnout.registry.database import open_registry
from turnout.registry.generation import load
from turnout.registry.generation_history import HISTORY_FOLDER, TIME_FORMAT, history
from turnout.registry.integrity import check, vacuum

COUNT = "select count(*) from modes"


def pass_time(registry, span):
    """Simulate that ``span`` has passed: date the publication of all generations back by it."""
    for number, (path, time) in history(registry).items():
        path.rename(path.with_name(f"{number:06d}-{(time - span).strftime(TIME_FORMAT)}.json"))


def parquet_files(registry):
    return {p.relative_to(registry).as_posix() for p in registry.rglob("*.parquet") if not p.name.startswith("_schema")}


def count_as_of(registry, as_of):
    with open_registry(registry, as_of=as_of) as connection:
        return connection.execute(COUNT).fetchall()[0][0]


@pytest.fixture(scope="module")
def registered(tmp_path_factory):
    """Generations 1 to 3 add one mode each, generation 4 merges their files."""
    root = tmp_path_factory.mktemp("made")
    (root / "work").mkdir()
    bench = Bench(root)
    for day in ("2026-01-05", "2026-01-12", "2026-01-19"):
        bench.register(hammer_result(day=day))
    compact(bench.registry)
    return bench


@pytest.fixture
def merged(registered, tmp_path):
    shutil.copytree(registered.root, tmp_path / "copy")
    bench = Bench(tmp_path / "copy")
    bench.batches = [bench.root / "work" / b.name for b in registered.batches]
    return bench


def test_an_open_registry_can_be_read_for_a_day_while_other_generations_are_published(merged, hammer):
    merged.register(hammer("t1", day="2026-01-26"))
    with open_registry(merged.registry) as reader:
        for k in range(2):
            compact(merged.registry)
            merged.register(hammer(f"t{k + 2}"))
            assert reader.execute(COUNT).fetchall() == [(4,)]
        pass_time(merged.registry, timedelta(hours=23))
        merged.register(hammer("t8"))
        assert reader.execute(COUNT).fetchall() == [(4,)]


def test_files_that_no_generation_of_the_last_day_uses_are_deleted(merged, hammer):
    assert len(load(merged.registry).retired) >= 3
    pass_time(merged.registry, timedelta(days=1))
    for k in range(2):
        merged.register(hammer(f"t{k + 2}"))
    generation = load(merged.registry)
    assert {number for _, number in generation.retired} == {5, 6}  # the table of sections was written again
    assert parquet_files(merged.registry) == {f.path for f in generation.files} | {p for p, _ in generation.retired}
    assert list(history(merged.registry)) == [4, 5, 6]  # generation 4 was current until 5 was published
    assert [count_as_of(merged.registry, number) for number in (4, 5, 6)] == [3, 4, 5]
    assert check(merged.registry) == [] and vacuum(merged.registry) == []


@pytest.mark.parametrize("span", [timedelta(days=-400), timedelta(days=400)])
def test_after_a_wrong_clock_files_are_kept_for_two_generations_and_then_deleted(merged, hammer, span):
    """All times are in the future, or long ago: the files are kept for two more generations and then deleted."""
    pass_time(merged.registry, span)
    with open_registry(merged.registry, as_of=3) as reader:
        merged.register(hammer("t2"))
        assert reader.execute(COUNT).fetchall() == [(3,)]
    merged.register(hammer("t3"))
    assert {number for _, number in load(merged.registry).retired} == {5, 6}


def test_an_earlier_generation_can_be_queried_by_number_and_by_time(merged):
    start = datetime(2026, 11, 24, 6, tzinfo=UTC)
    for number, (path, _) in history(merged.registry).items():
        time = start + timedelta(hours=number)
        path.rename(path.with_name(f"{number:06d}-{time.strftime(TIME_FORMAT)}.json"))
    assert [count_as_of(merged.registry, number) for number in (1, 2, 3, 4)] == [1, 2, 3, 3]
    times = (
        "2026-11-24T07:00",
        "2026-11-24T08:59:59",
        datetime(2026, 11, 24, 9),
        "2026-11-24 12:30+02:00",
        "2027-01-01",
    )
    assert [count_as_of(merged.registry, time) for time in times] == [1, 2, 3, 3, 3]
    with open_registry(merged.registry, as_of=2) as connection:
        assert connection.execute("select generation, n_files from registry_info").fetchall()[0][0] == 2
        assert connection.execute("select published_at()::varchar").fetchall() == [("2026-11-24 00:00:00",)]
    kept = r"Kept are.*1 \(2026-11-24 07:00:00\)"
    wrong = {9: "no generation is kept for 9", "2026-11-24T06:59": kept, "yesterday": "no time and no number"}
    for as_of, words in wrong.items():
        with pytest.raises(RegistryError, match=words):
            open_registry(merged.registry, as_of=as_of)


def catalogue_of(connection):
    """Views with their comments and macros of a connection."""
    views = "select view_name, comment from duckdb_views() where not internal order by all"
    macros = "select distinct function_name from duckdb_functions() where not internal order by all"
    return connection.execute(views).fetchall(), connection.execute(macros).fetchall()


def test_an_earlier_generation_has_all_views_and_comments_of_the_current_one(registered):
    with open_registry(registered.registry) as now, open_registry(registered.registry, as_of=2) as then:
        assert catalogue_of(then) == catalogue_of(now)
        for view, _ in catalogue_of(then)[0]:
            then.execute(f'from "{view}"')
        assert then.execute("select database_name from duckdb_databases() where not internal").fetchall() == [
            ("memory",)
        ]


def test_an_earlier_generation_can_be_opened_without_space_for_a_temporary_file(merged, monkeypatch):
    def full(prefix):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("turnout.registry.database.tempfile.TemporaryDirectory", full)
    assert count_as_of(merged.registry, 2) == 2


def test_the_command_queries_an_earlier_generation_and_reads_no_other_file(merged, capsys, tmp_path):
    assert main(["query", COUNT, "--registry", str(merged.registry), "--as-of", "2"]) == 0
    assert re.search(r"^\s*2$", capsys.readouterr().out, re.M)
    (tmp_path / "secret.csv").write_text("a\n1\n")
    for sql in (f"from '{tmp_path}/secret.csv'", "create table x as select 1"):
        assert main(["query", sql, "--registry", str(merged.registry), "--as-of", "2"]) != 0


def test_the_entry_of_a_run_that_was_killed_before_publication_is_not_used(merged, hammer):
    lost = merged.registry / HISTORY_FOLDER / f"000005-{datetime.now(UTC).strftime(TIME_FORMAT)}.json"
    lost.write_text("cut")
    assert count_as_of(merged.registry, "2999-01-01") == 3
    merged.register(hammer("t2"))
    assert not lost.exists() and count_as_of(merged.registry, 5) == 4


def test_a_generation_that_is_not_published_yet_is_not_listed(merged):
    """Its file is written before publication; a run that is killed in between leaves the file behind."""
    path = merged.registry / HISTORY_FOLDER / "000005-20260101T000000000000Z.json"
    path.write_bytes((merged.registry / "_generation.json").read_bytes())
    assert max(history(merged.registry)) == 4 == load(merged.registry).number
    with pytest.raises(RegistryError, match="no generation is kept for 5"):
        open_registry(merged.registry, as_of=5)
