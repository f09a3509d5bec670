"""A bit that flips on the disk changes no query result: damage is found before files are merged or rows added."""

import random
import shutil

import pytest
from registry_rows import Bench, hammer_result, quarantined_result

from turnout.cli.main import main
from turnout.errors import RegistryError
from turnout.registry.compaction import compact, rebuild
from turnout.registry.damage import damage_stamp
from turnout.registry.database import rebuild_database
from turnout.registry.generation import load
from turnout.registry.integrity import check, vacuum

CONFIGURATION = {
    "turnouts": [{"turnout_id": f"t{i}", "name": f"Turnout {i}", "layout": "l", "config_hash": "h"} for i in range(4)],
    "sections": [
        {"turnout_id": f"t{i}", "section_id": f"t{i}/A1", "label": "A1", "panel": "CP", "track": "main"}
        for i in range(4)
    ],
}
TABLES = ("recordings", "models", "modes", "quarantine", "results", "supersedes", "turnouts", "sections")
# Current rows, without the columns of their registration. Rows that were superseded before are in no batch.
QUERIES = (
    "select * exclude (run_id) from modes_current",
    "select * exclude (run_id) from models_current",
    "select * exclude (run_id) from results_current where kind <> 'configuration'",
    "select r.* exclude (run_id) from recordings r semi join results_current using (result_id)",
    "select * exclude (run_id) from quarantine_open",
    "from turnouts",
    "from sections",
)


@pytest.fixture(scope="module")
def registered(tmp_path_factory):
    """Three registrations, the last of which supersedes a model and adds a file in quarantine."""
    root = tmp_path_factory.mktemp("intact")
    (root / "work").mkdir()
    bench = Bench(root)
    for day in ("2026-01-10", "2026-01-11"):
        bench.register(*(hammer_result(f"t{i}", day=day) for i in range(4)), tables=CONFIGURATION)
    newer = hammer_result("t0", day="2026-01-10", frequency=99.0, key="k2")
    bench.register(newer, quarantined_result(day="2026-03-09"), tables=CONFIGURATION)
    return bench


@pytest.fixture
def copied(registered, tmp_path):
    """A copy for a test to damage."""
    return copy_of(registered, tmp_path / "copy")


def copy_of(bench, folder):
    shutil.copytree(bench.root, folder)
    rebuild_database(folder / "registry")
    copy = Bench(folder)
    copy.batches = [folder / "work" / b.name for b in bench.batches]
    return copy


def answers(bench):
    """Sorted rows of every query."""
    return {query: sorted(map(repr, bench.ask(query))) for query in QUERIES}


def flip(path, bit):
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


def night(bench):
    return bench.register(tables=CONFIGURATION)


def test_the_next_registration_restores_the_rows_of_a_damaged_file_of_each_table(registered, copied, caplog):
    for table in TABLES:
        file = load(copied.registry).of(table)[0]
        flip(copied.registry / file.path, 8 * (file.bytes // 2))
    night(copied)
    assert answers(copied) == answers(registered)
    assert caplog.text.count("has another hash than the list") == len(TABLES)
    vacuum(copied.registry)
    assert check(copied.registry) == [] and night(copied).n_units == 0


@pytest.mark.parametrize("merge", [compact, rebuild])
def test_merging_of_files_does_not_hide_a_flipped_bit(registered, copied, merge, capsys):
    file = max(load(copied.registry).of("modes"), key=lambda f: f.rows)
    flip(copied.registry / file.path, 8 * (file.bytes // 2))
    merge(copied.registry)
    assert load(copied.registry).incomplete == ["modes"]
    assert any("modes were taken off the list" in problem for problem in check(copied.registry))
    assert copied.ask("select count(*) from modes") == [(9 - file.rows,)]
    assert main(["registry", "compact", "--registry", str(copied.registry)]) == 1
    assert "Damaged files of modes count no longer" in capsys.readouterr().out
    assert damage_stamp(copied.registry) != ""
    for file in load(copied.registry).of("modes"):
        flip(copied.registry / file.path, 8 * (file.bytes // 2))
    night(copied)
    assert answers(copied) == answers(registered) and damage_stamp(copied.registry) == ""


def test_an_empty_or_missing_file_is_restored(registered, copied):
    first, second = load(copied.registry).of("modes")[:2]
    (copied.registry / first.path).write_bytes(b"")
    (copied.registry / second.path).unlink()
    night(copied)
    assert answers(copied) == answers(registered)


def test_damaged_rows_that_no_batch_contains_are_removed_and_reported(copied, caplog):
    day = "from modes where measured_at_utc < '2026-01-11'"
    (name,) = copied.ask(f"select any_value(run_id) {day} and frequency_hz > 100")[0]
    (file,) = [f for f in load(copied.registry).of("modes") if name[:12] in f.path]
    flip(copied.registry / file.path, 8 * (file.bytes // 2))
    copied.batches.pop(0)
    night(copied)
    assert copied.ask(f"select turnout_id, frequency_hz {day}") == [("t0", 99.0)]
    assert "computes its 4 rows again as far as the work batches hold them" in caplog.text


def test_superseded_rows_that_no_batch_contains_do_not_become_current_again(tmp_path):
    """The file of the earlier results and that of their supersession are damaged before the same run."""
    (tmp_path / "work").mkdir()
    bench = Bench(tmp_path)
    bench.register(hammer_result("t0"), tables=CONFIGURATION)
    bench.register(hammer_result("t0", frequency=99.0, key="k2"), tables=CONFIGURATION)
    bench.batches.pop(0)
    queries = [
        f"select * exclude (run_id) from {view}" for view in ("recordings_current", "models_current", "modes_current")
    ]
    before = [bench.ask(query) for query in queries]
    for table in ("results", "supersedes"):
        for file in load(bench.registry).of(table):
            flip(bench.registry / file.path, 8 * (file.bytes // 2))
    night(bench)
    assert [bench.ask(query) for query in queries] == before and all(before)


def test_a_registry_without_most_of_its_files_is_reported_as_a_disk_that_is_not_mounted(copied):
    before = (copied.registry / "_generation.json").read_bytes()
    for file in load(copied.registry).files:
        (copied.registry / file.path).unlink()
    with pytest.raises(RegistryError, match=r"files are gone, first .* mount the disk"):
        night(copied)
    assert (copied.registry / "_generation.json").read_bytes() == before


def test_no_query_result_differs_after_single_bit_flips_and_the_next_registration(registered, tmp_path):
    """Random bits of random live files (fixed seed); `python -m benchmarks faults` flips more of them."""
    intact, draw = answers(registered), random.Random(39)
    bench = copy_of(registered, tmp_path / "copy")
    for _ in range(2):
        for file in [f for f in load(bench.registry).files if f.table != "runs" and draw.random() < 0.7]:
            flip(bench.registry / file.path, draw.randrange(8 * file.bytes))
        night(bench)
        assert answers(bench) == intact


def test_an_older_generation_file_without_the_new_list_is_read(copied):
    assert "incomplete" not in (copied.registry / "_generation.json").read_text()
    assert load(copied.registry).incomplete == []


@pytest.mark.parametrize("content", [None, b"", b"no database" * 500])
def test_the_next_registration_makes_a_lost_or_damaged_database_again(registered, copied, content):
    """The job must run even if no data file is damaged: the readers' message refers to the nightly run."""
    database = copied.registry / "registry.duckdb"
    assert damage_stamp(copied.registry) == ""
    database.unlink()
    if content is not None:
        database.write_bytes(content)
    assert damage_stamp(copied.registry) == "registry.duckdb"
    night(copied)
    assert damage_stamp(copied.registry) == "" and answers(copied) == answers(registered)


def test_a_registry_that_does_not_exist_yet_has_no_damage(tmp_path):
    """Otherwise its job would run again in the second nightly run."""
    assert damage_stamp(tmp_path / "registry") == ""
