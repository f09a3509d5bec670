"""Each result is registered once, whatever batch contains it; a newly computed result supersedes the earlier one."""

import random
import subprocess
import sys
from datetime import UTC, datetime

import duckdb
import pytest

from turnout.registry.job import register
from turnout.workflow.batches import read_results, write_batch


def some_results(hammer, quarantined, n_turnouts=5):
    results = [
        hammer(f"t{i}", f"A{j}", day, frequency=150.0 + i - 2.5 * j)
        for i in range(n_turnouts)
        for j in range(3)
        for day in ("2025-12-30", "2026-01-05")
    ]
    return [*results, quarantined("t9", "A1"), quarantined("t9", "A2", reason="not_finite")]


def test_a_registered_result_can_be_queried(bench, hammer):
    done = bench.register(hammer(frequency=150.1234))
    assert done.rows["modes"] == done.rows["models"] == done.rows["recordings"] == 1
    rows = bench.ask("select turnout_id, section_id, band, frequency_hz, method from modes_current")
    assert rows == [("t1", "t1/A1", "ballast", 150.123, "joint")]


def test_a_run_writes_one_file_per_table_and_year(bench, hammer, quarantined):
    bench.register(*some_results(hammer, quarantined))
    files = [p.parent.name for p in (bench.registry / "modes").rglob("batch-*.parquet")]
    assert sorted(files) == ["year=2025", "year=2026"]


def test_the_same_batch_again_adds_nothing(bench, hammer, quarantined, hashes):
    first = bench.register(*some_results(hammer, quarantined))
    before = hashes(bench.registry, without=())
    again = bench.register()
    assert (again.run_id, again.generation, again.rows) == (None, first.generation, {})
    assert hashes(bench.registry, without=()) == before


def test_the_same_results_in_another_batch_add_nothing(bench, hammer, quarantined, hashes):
    results = some_results(hammer, quarantined)
    bench.register(*results)
    before = hashes(bench.registry, without=())
    done = bench.register(*results[:7])
    assert done.n_units == 0 and hashes(bench.registry, without=()) == before


@pytest.mark.parametrize("n_batches", [1, 4, 7])
def test_files_do_not_depend_on_the_division_into_batches(n_batches, tmp_path, hammer, quarantined, hashes):
    results = some_results(hammer, quarantined)
    random.Random(n_batches).shuffle(results)
    (tmp_path / "work").mkdir()
    batches = [write_batch(tmp_path / "work", results[i::n_batches]) for i in range(n_batches)]
    whole = write_batch(tmp_path / "work", results)
    register(batches, tmp_path / "cut", read=read_results)
    register([whole], tmp_path / "whole", read=read_results)
    assert hashes(tmp_path / "cut") == hashes(tmp_path / "whole")
    assert len(hashes(tmp_path / "cut")) > 20


def test_files_do_not_depend_on_the_number_of_threads(tmp_path, hammer, hashes):
    results = [hammer("t1", "A1", f"2026-{m:02d}-{d:02d}", 150.0 + m) for m in range(1, 13) for d in range(1, 28)]
    (tmp_path / "work").mkdir()
    batch = write_batch(tmp_path / "work", results)
    for threads in (1, 2):
        code = (
            "from functools import partial; import turnout.registry.registration as r;"
            f"r.connect = partial(r.connect, threads={threads}); r.limit_memory = lambda con: None;"
            "from turnout.registry.job import register; from turnout.workflow.batches import read_results;"
            f"register([{str(batch)!r}], {str(tmp_path / str(threads))!r}, read=read_results)"
        )
        subprocess.run([sys.executable, "-c", code], check=True)
    assert hashes(tmp_path / "1") == hashes(tmp_path / "2")


def test_the_later_batch_decides_for_a_unit_in_two_batches(bench, hammer):
    bench.batch(hammer(file="a", frequency=150.0))
    bench.batch(hammer(file="b", frequency=151.0))
    done = bench.register()
    assert done.n_units == 1
    assert bench.ask("select frequency_hz from modes") == [(151.0,)]


@pytest.mark.parametrize(
    ("second", "reason"),
    [
        ({"file": "b"}, "new_data"),
        ({"algo": "2"}, "new_code"),
        ({"key": "k2"}, "new_configuration"),
        ({"file": "b", "algo": "2"}, "new_data"),
    ],
)
def test_a_newly_computed_unit_supersedes_its_model_with_the_reason(bench, hammer, second, reason):
    bench.register(hammer(frequency=150.0), hammer(section="A2", frequency=99.0))
    old = bench.ask("select model_id from models where section_id = 't1/A1'")
    done = bench.register(hammer(frequency=151.0, **second))
    assert done.n_units == 1
    assert bench.ask("select frequency_hz from modes_current order by 1") == [(99.0,), (151.0,)]
    assert bench.ask("select count(*) from modes") == [(3,)], "the old row stays"
    new = bench.ask("select model_id from models_current where section_id = 't1/A1'")
    assert bench.ask("select old_id, new_id, reason from supersedes where kind = 'model'") == [
        (*old[0], *new[0], reason)
    ]
    assert bench.ask("select count(*) from recordings_current where section_id = 't1/A1'") == [(1,)]


def test_the_old_model_becomes_current_again_if_a_change_of_the_configuration_is_reverted(bench, hammer):
    bench.register(hammer(frequency=150.0, key="k1"))
    bench.register(hammer(frequency=151.0, key="k2"))
    third = bench.register(hammer(frequency=150.0, key="k1"))
    assert bench.ask("select frequency_hz from modes_current") == [(150.0,)]
    assert "modes" not in third.rows, "its rows are already registered"
    fourth = bench.register(hammer(frequency=151.0, key="k2"))
    assert bench.ask("select frequency_hz from modes_current") == [(151.0,)]
    assert len({r for (r,) in bench.ask("select run_id from runs")}) == 4 and "modes" not in fourth.rows


def test_a_run_records_its_start_and_end(bench, hammer):
    before = datetime.now(UTC).replace(tzinfo=None)
    bench.register(hammer(key="k1"))
    bench.register(hammer(key="k2"), started_at=datetime(2024, 5, 13, 2, 0))
    (given, _), (began, ended) = bench.ask("select started_at_utc, ended_at_utc from runs order by all")
    assert given == datetime(2024, 5, 13, 2, 0) and before <= began <= ended


def test_a_repaired_file_is_no_longer_in_quarantine(bench, hammer, quarantined):
    bench.register(quarantined(section="A1"), quarantined(section="A2"))
    assert bench.ask("select count(*) from quarantine_open") == [(2,)]
    bench.register(hammer(section="A1"))
    assert bench.ask("select section_id from quarantine_open") == [("t1/A2",)]
    assert bench.ask("select reason from supersedes where kind = 'quarantine'") == [("repaired",)]
    assert bench.ask("select count(*) from quarantine") == [(2,)]


def test_a_file_that_fails_in_the_same_way_after_an_update_keeps_one_row(bench, quarantined):
    bench.register(quarantined(key="x"))
    bench.register(quarantined(key="y"))
    assert bench.ask("select count(*) from quarantine") == bench.ask("select count(*) from quarantine_open") == [(1,)]


def test_tables_of_the_configuration_are_replaced_and_measured_sections_are_kept(bench, hammer):
    turnouts = [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in ("t1", "t2")]
    events = [
        {
            "event_id": "e", "turnout_id": "t1", "event_at_utc": "2026-02-01T00:00:00", "kind": "tamping",
            "resets_ballast": True, "resets_railpad": False,
        }
    ]  # fmt: skip
    sections = [
        {"section_id": "t1/A7", "turnout_id": "t1", "label": "A7", "panel": "CP", "track": "main", "position_m": 1.0}
    ]
    bench.register(hammer(section="A1"), tables={"turnouts": turnouts, "events": events, "sections": sections})
    bench.register(tables={"turnouts": turnouts[:1], "events": [], "sections": sections})
    assert bench.ask("select turnout_id from turnouts") == [("t1",)]
    assert bench.ask("select count(*) from events") == [(0,)]
    assert bench.ask("select section_id, panel from sections order by 1") == [("t1/A1", None), ("t1/A7", "CP")]


def test_a_section_that_the_layout_no_longer_has_is_marked(bench, hammer):
    """A section that was never in a layout has not left one; a section that comes back has no mark."""
    at = {"turnout_id": "t1", "panel": "CP", "track": "main", "position_m": 1.0}
    both = [at | {"section_id": f"t1/{label}", "label": label} for label in ("A7", "A8")]
    query = "select label, panel, left_layout from sections order by 1"
    bench.register(hammer(section="A1"), tables={"sections": both})
    assert bench.ask(query) == [("A1", None, None), ("A7", "CP", False), ("A8", "CP", False)]
    bench.register(tables={"sections": both[:1]})
    assert bench.ask(query) == [("A1", None, None), ("A7", "CP", False), ("A8", "CP", True)]
    bench.register(hammer(section="A7", day="2026-02-05"), tables={"sections": both[:1]})
    assert bench.ask(query) == [("A1", None, None), ("A7", "CP", False), ("A8", "CP", True)]
    bench.register(tables={"sections": both})
    assert bench.ask(query) == [("A1", None, None), ("A7", "CP", False), ("A8", "CP", False)]


def test_two_registrations_at_the_same_time_give_the_union(tmp_path, hammer):
    (tmp_path / "work").mkdir()
    code = (
        "import sys; from turnout.registry.job import register; from turnout.workflow.batches import read_results;"
        "[register([b], sys.argv[1], read=read_results) for b in sys.argv[2:]]"
    )
    writers = []
    for writer in range(2):
        batches = [
            write_batch(tmp_path / "work", [hammer(f"w{writer}", f"S{k}", frequency=100.0 + k)]) for k in range(3)
        ]
        arguments = [sys.executable, "-c", code, str(tmp_path / "registry"), *map(str, batches)]
        writers.append(subprocess.Popen(arguments))
    assert [w.wait(timeout=120) for w in writers] == [0, 0]
    with duckdb.connect(str(tmp_path / "registry" / "registry.duckdb"), read_only=True) as connection:
        found = connection.execute("select section_id from modes_current order by 1").fetchall()
        assert connection.execute("select generation from registry_info").fetchall() == [(6,)]
    assert found == [(f"w{w}/S{k}",) for w in range(2) for k in range(3)]
