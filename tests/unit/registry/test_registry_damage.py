"""A bit that flipped on the disk changes no answer: it is found before files are merged or rows are added."""

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
# Rows that count, without what tells when they were registered. Rows that were superseded before are in no batch.
QUESTIONS = (
    "select * exclude (run_id) from modes_current",
    "select * exclude (run_id) from models_current",
    "select * exclude (run_id) from results_current where kind <> 'configuration'",
    "select r.* exclude (run_id) from recordings r semi join results_current using (result_id)",
    "select * exclude (run_id) from quarantine_open",
    "from turnouts",
    "from sections",
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
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
def spoiled(made, tmp_path):
    """A copy of it to spoil."""
    return copy_of(made, tmp_path / "copy")


def copy_of(bench, folder):
    shutil.copytree(bench.root, folder)
    rebuild_database(folder / "registry")
    copy = Bench(folder)
    copy.batches = [folder / "work" / b.name for b in bench.batches]
    return copy


def answers(bench):
    """Sorted rows of every question."""
    return {question: sorted(map(repr, bench.ask(question))) for question in QUESTIONS}


def flip(path, bit):
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


def night(bench):
    return bench.register(tables=CONFIGURATION)


def test_the_next_registration_restores_the_rows_of_a_damaged_file_of_each_table(made, spoiled, caplog):
    for table in TABLES:
        file = load(spoiled.registry).of(table)[0]
        flip(spoiled.registry / file.path, 8 * (file.bytes // 2))
    night(spoiled)
    assert answers(spoiled) == answers(made)
    assert caplog.text.count("has another hash than the list") == len(TABLES)
    vacuum(spoiled.registry)
    assert check(spoiled.registry) == [] and night(spoiled).n_units == 0


@pytest.mark.parametrize("merge", [compact, rebuild])
def test_merging_does_not_hide_a_flipped_bit(made, spoiled, merge, capsys):
    file = max(load(spoiled.registry).of("modes"), key=lambda f: f.rows)
    flip(spoiled.registry / file.path, 8 * (file.bytes // 2))
    merge(spoiled.registry)
    assert load(spoiled.registry).incomplete == ["modes"]
    assert any("modes were taken off the list" in problem for problem in check(spoiled.registry))
    assert spoiled.ask("select count(*) from modes") == [(9 - file.rows,)]
    assert main(["registry", "compact", "--registry", str(spoiled.registry)]) == 1
    assert "Damaged files of modes count no longer" in capsys.readouterr().out
    assert damage_stamp(spoiled.registry) != ""
    for file in load(spoiled.registry).of("modes"):
        flip(spoiled.registry / file.path, 8 * (file.bytes // 2))
    night(spoiled)
    assert answers(spoiled) == answers(made) and damage_stamp(spoiled.registry) == ""


def test_an_empty_or_missing_file_is_restored(made, spoiled):
    first, second = load(spoiled.registry).of("modes")[:2]
    (spoiled.registry / first.path).write_bytes(b"")
    (spoiled.registry / second.path).unlink()
    night(spoiled)
    assert answers(spoiled) == answers(made)


def test_rows_that_no_batch_holds_any_more_are_removed_and_said(spoiled, caplog):
    day = "from modes where measured_at_utc < '2026-01-11'"
    (name,) = spoiled.ask(f"select any_value(run_id) {day} and frequency_hz > 100")[0]
    (file,) = [f for f in load(spoiled.registry).of("modes") if name[:12] in f.path]
    flip(spoiled.registry / file.path, 8 * (file.bytes // 2))
    spoiled.batches.pop(0)
    night(spoiled)
    assert spoiled.ask(f"select turnout_id, frequency_hz {day}") == [("t0", 99.0)]
    assert "computes its 4 rows again as far as the work batches hold them" in caplog.text


def test_rows_of_a_result_that_no_batch_holds_do_not_count_again(tmp_path):
    """The same night damages the file of the earlier results and that of their supersession."""
    (tmp_path / "work").mkdir()
    bench = Bench(tmp_path)
    bench.register(hammer_result("t0"), tables=CONFIGURATION)
    bench.register(hammer_result("t0", frequency=99.0, key="k2"), tables=CONFIGURATION)
    bench.batches.pop(0)
    questions = [
        f"select * exclude (run_id) from {view}" for view in ("recordings_current", "models_current", "modes_current")
    ]
    before = [bench.ask(question) for question in questions]
    for table in ("results", "supersedes"):
        for file in load(bench.registry).of(table):
            flip(bench.registry / file.path, 8 * (file.bytes // 2))
    night(bench)
    assert [bench.ask(question) for question in questions] == before and all(before)


def test_most_files_gone_is_a_disk_that_is_not_mounted(spoiled):
    before = (spoiled.registry / "_generation.json").read_bytes()
    for file in load(spoiled.registry).files:
        (spoiled.registry / file.path).unlink()
    with pytest.raises(RegistryError, match=r"files are gone, first .* mount the disk"):
        night(spoiled)
    assert (spoiled.registry / "_generation.json").read_bytes() == before


def test_single_bit_flips_change_no_answer_silently_after_the_next_night(made, tmp_path):
    """Any bit of any live file, drawn by seed; `python -m benchmarks faults` draws as many as asked for."""
    intact, draw = answers(made), random.Random(39)
    bench = copy_of(made, tmp_path / "copy")
    for _ in range(2):
        for file in [f for f in load(bench.registry).files if f.table != "runs" and draw.random() < 0.7]:
            flip(bench.registry / file.path, draw.randrange(8 * file.bytes))
        night(bench)
        assert answers(bench) == intact


def test_an_older_generation_file_without_the_new_list_is_read(spoiled):
    assert "incomplete" not in (spoiled.registry / "_generation.json").read_text()
    assert load(spoiled.registry).incomplete == []


@pytest.mark.parametrize("content", [None, b"", b"no database" * 500])
def test_a_lost_or_damaged_database_is_made_again_by_the_next_night(made, spoiled, content):
    """Its readers are told that a night makes it, so the job must run although no data file is damaged."""
    database = spoiled.registry / "registry.duckdb"
    assert damage_stamp(spoiled.registry) == ""
    database.unlink()
    if content is not None:
        database.write_bytes(content)
    assert damage_stamp(spoiled.registry) == "registry.duckdb"
    night(spoiled)
    assert damage_stamp(spoiled.registry) == "" and answers(spoiled) == answers(made)


def test_a_registry_that_is_not_there_yet_has_no_damage(tmp_path):
    """Else its job would run again in the second night."""
    assert damage_stamp(tmp_path / "registry") == ""
