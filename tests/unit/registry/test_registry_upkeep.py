"""Compaction, checks, moves and updates change no query result."""

import json
import os
import shutil

import duckdb
import pytest
from registry_rows import Bench, hammer_result

from turnout.cli.main import main
from turnout.errors import RegistryError
from turnout.registry import database, publication, view_texts
from turnout.registry.compaction import compact, rebuild
from turnout.registry.database import open_registry, rebuild_database
from turnout.registry.generation import GENERATION_FILE, load
from turnout.registry.integrity import check, vacuum
from turnout.registry.view_texts import sort_by_needs

ALL_MODES = "select * from modes order by model_id, band"


@pytest.fixture(scope="module")
def registered(tmp_path_factory):
    """Six registrations, one of which supersedes a model."""
    root = tmp_path_factory.mktemp("made")
    (root / "work").mkdir()
    bench = Bench(root)
    for night in range(5):
        results = [hammer_result(f"t{i}", day=f"2026-01-{10 + night}", frequency=100.0 + night) for i in range(4)]
        bench.register(*results)
    bench.register(hammer_result("t0", day="2026-01-10", frequency=99.0, key="k2"))
    return bench


@pytest.fixture
def five_nights(registered, tmp_path):
    """A copy for a test to change or damage."""
    shutil.copytree(registered.root, tmp_path / "copy")
    rebuild_database(tmp_path / "copy" / "registry")
    bench = Bench(tmp_path / "copy")
    bench.batches = [bench.root / "work" / b.name for b in registered.batches]
    return bench


def test_compaction_keeps_every_row_and_every_query_result(five_nights):
    before = five_nights.ask(ALL_MODES), five_nights.ask("select * from modes_current order by all")
    done = compact(five_nights.registry)
    assert done["modes/year=2026"] == (6, 21)
    assert (five_nights.ask(ALL_MODES), five_nights.ask("select * from modes_current order by all")) == before
    assert len(load(five_nights.registry).of("modes")) == 2
    assert compact(five_nights.registry) == {} and check(five_nights.registry) == []


def test_compaction_merges_only_at_least_the_given_number_of_files(bench, hammer):
    for day in ("2026-01-05", "2026-01-12", "2026-01-19"):
        bench.register(hammer(day=day))
    assert compact(bench.registry, at_least=4) == {}
    assert compact(bench.registry, at_least=3)["modes/year=2026"] == (3, 3)


def test_compaction_separates_current_rows_from_superseded_rows(five_nights, hammer):
    def counts():
        return sorted((f.rows, f.dead) for f in load(five_nights.registry).of("modes"))

    assert counts() == [(1, 0), (4, 0), (4, 0), (4, 0), (4, 0), (4, 1)]
    compact(five_nights.registry)
    assert counts() == [(1, 1), (20, 0)]
    current = five_nights.ask("select turnout_id, frequency_hz from modes_current order by all")
    assert len(current) == 20 and ("t0", 99.0) in current and ("t0", 100.0) not in current
    five_nights.register(hammer("t0", day="2026-01-10", frequency=100.0))
    assert counts() == [(1, 0), (20, 1)], "after the reversal the old row is current again, the new one is not"
    assert five_nights.ask("select frequency_hz from modes_current where turnout_id = 't0' order by 1")[0] == (100.0,)
    compact(five_nights.registry)
    assert counts() == [(1, 1), (20, 0)] and five_nights.ask("select count(*) from modes_current") == [(20,)]


def test_during_compaction_a_glob_has_every_row_twice_and_the_list_has_it_once(five_nights, monkeypatch):
    glob = f"select count(*) from read_parquet('{five_nights.registry}/modes/year=*/*.parquet')"
    seen, real = [], publication.commit

    def record_counts(root, generation):
        seen.append((five_nights.ask("select count(*) from modes"), duckdb.sql(glob).fetchall()))
        real(root, generation)
        seen.append((five_nights.ask("select count(*) from modes"), duckdb.sql(glob).fetchall()))

    monkeypatch.setattr(publication, "commit", record_counts)
    compact(five_nights.registry)
    assert [listed for listed, _ in seen] == [[(21,)], [(21,)]]
    assert [globbed for _, globbed in seen] == [[(42,)], [(42,)]]


def test_a_small_table_that_changes_and_changes_back_stays_readable(bench):
    def event(kind):
        return {
            "event_id": "e", "turnout_id": "t1", "event_at_utc": "2026-02-01T00:00:00", "kind": kind,
            "resets_ballast": True, "resets_railpad": False,
        }  # fmt: skip

    for kind in ("tamping", "grinding", "tamping", "grinding", "tamping", "tamping"):
        bench.register(tables={"events": [event(kind)]})
        assert bench.ask("select kind from events") == [(kind,)]
        assert check(bench.registry) == []


def damage_truncate(path):
    path.write_bytes(path.read_bytes()[:-100])


def damage_flip(path):
    content = bytearray(path.read_bytes())
    footer = int.from_bytes(content[-8:-4], "little")
    content[(len(content) - footer) // 2] ^= (
        1  # within the values: a file with a changed footer would be no Parquet file
    )
    path.write_bytes(content)


def damage_delete(path):
    path.unlink()


def damage_replace(path):
    duckdb.sql(f"copy (select 1 as x) to '{path}' (format parquet)")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (damage_truncate, "bytes, the list says"),
        (damage_flip, "its hash differs from the list"),
        (damage_delete, "is gone"),
        (damage_replace, "bytes, the list says"),
    ],
)
def test_check_reports_the_damaged_file(bench, hammer, damage, message):
    bench.register(hammer())
    file = load(bench.registry).of("modes")[0].path
    damage(bench.registry / file)
    problems = check(bench.registry)
    assert len(problems) == 1 and problems[0].startswith(f"{file}: ") and message in problems[0]


def test_vacuum_deletes_only_files_that_are_on_no_list(five_nights):
    folder = five_nights.registry / "modes" / "year=2026"
    (folder / "batch-feed-0000.parquet").write_bytes(b"left by a killed run")
    assert check(five_nights.registry)[0].startswith("1 file is on no list, the first modes/year=2026/batch-feed")
    (folder / ".batch-feed.77.tmp").write_bytes(b"half")
    before = five_nights.ask(ALL_MODES)
    assert "2 files are on no list" in check(five_nights.registry)[0]
    assert sorted(os.path.basename(p) for p in vacuum(five_nights.registry)) == [
        ".batch-feed.77.tmp", "batch-feed-0000.parquet",
    ]  # fmt: skip
    assert check(five_nights.registry) == [] and five_nights.ask(ALL_MODES) == before


def test_a_moved_registry_can_be_relocated(five_nights):
    before, moved = five_nights.ask(ALL_MODES), five_nights.root / "elsewhere with 'quotes'"
    shutil.move(five_nights.registry, moved)
    assert "registry.duckdb is not of generation" in check(moved)[0]
    with pytest.raises(RegistryError, match=r"was made in .*registry, which is not there. Where it was moved, run"):
        open_registry(moved)
    rebuild_database(moved)
    five_nights.registry = moved
    assert five_nights.ask(ALL_MODES) == before and check(moved) == []


def test_a_copied_registry_does_not_return_the_rows_of_the_original(five_nights):
    copy = five_nights.root / "copy"
    shutil.copytree(five_nights.registry, copy)
    with pytest.raises(
        RegistryError, match=r"is a copy, and its views read the files of .*registry\. To read the copy"
    ):
        open_registry(copy)
    (five_nights.root / "link").symlink_to(five_nights.registry)
    open_registry(five_nights.root / "link").close()  # another path to the same folder is no copy
    before = five_nights.ask(ALL_MODES)
    rebuild_database(copy)
    shutil.rmtree(five_nights.registry)
    five_nights.registry = copy
    assert five_nights.ask(ALL_MODES) == before


def test_an_export_with_an_unknown_table_writes_no_file(five_nights, tmp_path, capsys):
    out = tmp_path / "out"
    command = ["export", str(out), "--registry", str(five_nights.registry), "--only", "turnouts", "modes"]
    assert main(command) == 0 and len(list(out.iterdir())) == 2
    shutil.rmtree(out)
    assert main([*command, "mode"]) == 2 and not out.exists()
    assert "no table or view 'mode'" in capsys.readouterr().err


def test_a_later_column_is_null_in_old_rows_and_rebuild_writes_it(bench, hammer, monkeypatch):
    bench.register(hammer(frequency=150.0))
    file = bench.registry / load(bench.registry).of("modes")[0].path
    strip_column(bench, "modes", file, "frequency_sd_hz")
    bench.register(hammer(section="A2", frequency=151.0, frequency_sd_hz=0.5))
    assert bench.ask("select frequency_hz, frequency_sd_hz from modes order by 1") == [(150.0, None), (151.0, 0.5)]
    rebuild(bench.registry)
    assert bench.ask("select frequency_hz, frequency_sd_hz from modes order by 1") == [(150.0, None), (151.0, 0.5)]
    assert len({f.schema for f in load(bench.registry).of("modes")}) == 1 and check(bench.registry) == []


def strip_column(bench, table, file, column):
    """Rewrite one live file as an older version of the program would have written it."""
    from turnout.content import sha256_of

    older = file.with_name("older.parquet")
    duckdb.sql(f"copy (select * exclude ({column}) from read_parquet('{file}')) to '{older}' (format parquet)")
    older.replace(file)
    path = bench.registry / GENERATION_FILE
    generation = json.loads(path.read_text())
    for entry in generation["files"]:
        if entry["path"].endswith(file.name):
            entry |= {"sha256": sha256_of(file), "bytes": file.stat().st_size, "schema": f"{table}:older"}
    held = dict(next(v for k, v in generation["schemas"].items() if k.startswith(f"{table}:")))
    del held[column]
    generation["schemas"][f"{table}:older"] = held
    path.write_text(json.dumps(generation))


def test_a_column_with_a_changed_type_is_rejected_before_any_file_is_written(bench, hammer):
    bench.register(hammer())
    path = bench.registry / GENERATION_FILE
    generation = json.loads(path.read_text())
    name = next(k for k in generation["schemas"] if k.startswith("modes:"))
    generation["schemas"][name]["n_impacts"] = "varchar"
    path.write_text(json.dumps(generation))
    with pytest.raises(RegistryError, match=r"modes, column n_impacts: files hold varchar, columns.csv says integer"):
        bench.register(hammer(section="A2"))


@pytest.mark.parametrize("content", ["{", "[]", "3", '{"format": 1}', '{"format": 1, "files": [{"rows": 2}]}'])
def test_a_damaged_generation_file_is_an_error(bench, hammer, content):
    bench.register(hammer())
    (bench.registry / GENERATION_FILE).write_text(content)
    with pytest.raises(RegistryError, match=r"not a generation file.*delete its folder"):
        bench.register(hammer(section="A2"))


def test_a_folder_without_a_registry_is_an_error(tmp_path):
    with pytest.raises(RegistryError, match=r"there is no registry here. 'turnout nightly' makes one"):
        open_registry(tmp_path)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ({"a": "-- needs: b"}, "views/a.sql needs b, and there is no such file"),
        ({"a": "-- needs: b", "b": "-- needs: a"}, "need each other in a circle"),
    ],
)
def test_views_that_cannot_be_ordered_are_rejected(texts, message):
    with pytest.raises(RegistryError, match=message):
        sort_by_needs(texts)


def test_views_of_an_older_program_are_created_again_without_a_new_row(bench, hammer, monkeypatch):
    bench.register(hammer())
    generation = bench.ask("select generation from registry_info")
    monkeypatch.setattr("turnout.registry.view_texts.views_version", lambda: "older")
    database.build_database(bench.registry, load(bench.registry))
    monkeypatch.undo()
    assert bench.ask("select views_version from registry_info") == [("older",)]
    bench.register()
    assert bench.ask("select views_version from registry_info") == [(view_texts.views_version(),)]
    assert bench.ask("select generation from registry_info") == generation
