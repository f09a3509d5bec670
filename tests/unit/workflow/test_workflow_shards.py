"""The runner of shards: computed and stored units, and the state after a kill or a fault."""

import errno
import json
import os
import sys

import numpy as np
import pytest
from length_fleet import CALLS, Fleet, length

from turnout.config import load_configuration
from turnout.errors import InstallationError, TurnoutError
from turnout.readers import read
from turnout.workflow import tasks
from turnout.workflow.batches import read_batch, read_column, read_results
from turnout.workflow.current_results import DamagedBatch, current_results
from turnout.workflow.jobs import stage_job
from turnout.workflow.plan import write_plans
from turnout.workflow.quality_gate import check_quality, judge
from turnout.workflow.retries import read_postponed
from turnout.workflow.shard import run_shard
from turnout.workflow.state import State, batch_paths, load_state
from turnout.workflow.tasks import Stage


def test_a_run_computes_only_new_units(fleet):
    assert str(fleet.run()) == "hammer 00of01: 3 known, 3 processed, 0 quarantined"
    assert fleet.lengths() == {f"t{i}/hammer/A/2024-05-13": [9] for i in range(3)}
    assert fleet.run().processed == 0 and CALLS == []
    fleet.put("t1/2024-05-13/A_2.txt", "new")
    assert fleet.run().processed == 1 and CALLS == ["t1/A/2024-05-13"]
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9, 3]


def test_a_touched_file_is_not_computed_again_and_a_rewritten_file_is(fleet):
    fleet.run()
    path = fleet.raw / "t0/2024-05-13/A_1.txt"
    os.utime(path, (1, 1))
    assert fleet.run().processed == 0
    path.write_text("TURNOUT 0")  # as long as before
    os.utime(path, (2, 2))
    assert fleet.run().processed == 1


def test_new_code_and_a_new_configuration_compute_all_units_again(fleet):
    fleet.run()
    assert fleet.run(algo="2").processed == 3
    layout = fleet.folder / "config/layouts/main.yaml"
    layout.write_text(layout.read_text().replace("position: 1", "position: 2"))
    assert fleet.run(algo="2").processed == 3


def test_units_whose_configuration_is_newer_than_the_plan_wait(fleet):
    write_plans(fleet.configuration, fleet.raw, fleet.plan.parent, 1)
    layout = fleet.folder / "config/layouts/main.yaml"
    layout.write_text(layout.read_text().replace("position: 1", "position: 2"))
    summary = fleet.run(plan=False)
    assert (summary.processed, summary.stale) == (0, 3)
    assert fleet.run().processed == 3


def test_units_of_a_turnout_that_is_left_out_stay_also_if_no_plan_has_them(fleet):
    fleet.put("t0/2024-05-13/A_1.txt", "damaged")
    fleet.run()
    before = fleet.rows()
    (fleet.folder / "config/overrides").mkdir()
    (fleet.folder / "config/overrides/t0.yaml").write_text("sections: [")
    configuration = load_configuration(fleet.folder / "config", leave_out=True)
    fleet.plan.write_text("")  # truncated: its entries are lost
    write_plans(configuration, fleet.raw, fleet.plan.parent, 1)
    run_shard(fleet.plan, fleet.state, Stage("hammer", length, "1"), configuration, fleet.raw)
    assert len(before["t0/hammer/A/2024-05-13"]["quarantine"]) == 1 and fleet.rows() == before


def test_damage_and_faults_are_rows_of_the_quarantine_until_they_are_repaired(fleet):
    fleet.put("t0/2024-05-13/A_1.txt", "damaged")
    fleet.put("t1/2024-05-13/A_1.txt", "bug")
    summary = fleet.run()
    assert (summary.processed, summary.quarantined, summary.internal_errors) == (3, 2, 1)
    rows = fleet.rows()
    damaged, fault = (rows[f"t{i}/hammer/A/2024-05-13"]["quarantine"][0] for i in (0, 1))
    assert (damaged["reason_code"], damaged["place"], damaged["found"]) == ("unreadable", "byte 0", "damage")
    assert (fault["reason_code"], fault["found"]) == ("internal_error", "ZeroDivisionError: in the toy")
    assert "length" in fault["place"] and str(fleet.folder) not in json.dumps(fault)
    assert fleet.run().processed == 0
    fleet.put("t0/2024-05-13/A_1.txt", "sound again")
    fleet.run()
    assert fleet.rows()["t0/hammer/A/2024-05-13"]["quarantine"] == []


def test_strict_raises_the_error(fleet):
    fleet.put("t1/2024-05-13/A_1.txt", "bug")
    with pytest.raises(ZeroDivisionError):
        fleet.run(strict=True)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_fault_of_the_machine_postpones_only_its_unit(fleet, threads):
    fleet.put("t0/2024-05-13/A_1.txt", "bad sector")
    fleet.put("t1/2024-05-13/A_1.txt", "too large")
    printed = str(fleet.run(threads=threads))
    assert printed == "hammer 00of01: 3 known, 1 processed, 0 quarantined, 2 postponed"
    assert set(fleet.lengths()) == {"t2/hammer/A/2024-05-13"}
    jobs, units = read_postponed(fleet.state)
    assert jobs == 1 and units == {
        "t0/hammer/A/2024-05-13": "OSError: [Errno 5] Input/output error", "t1/hammer/A/2024-05-13": "MemoryError: ",
    }  # fmt: skip
    (complaint,) = judge([fleet.state], fleet.configuration).complaints
    assert "2 units wait for the next run, first t0/hammer/A/2024-05-13: OSError: [Errno 5]" in complaint

    fleet.put("t0/2024-05-13/A_1.txt", "readable")
    assert fleet.run(only=["t0"]).processed == 1
    assert read_postponed(fleet.state) == (2, {"t1/hammer/A/2024-05-13": "MemoryError: "})
    fleet.put("t1/2024-05-13/A_1.txt", "smaller")
    assert fleet.run().processed == 1
    assert read_postponed(fleet.state) == (2, {}) and judge([fleet.state], fleet.configuration).complaints == ()


def test_a_file_without_read_permission_is_read_after_it_gets_the_permission(fleet, monkeypatch):
    def closed(path):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(tasks, "sha256_of", closed)
    assert fleet.run().postponed == 3
    monkeypatch.undo()
    assert fleet.run().processed == 3


def count_samples(unit, turnout, raw_root, algo=""):
    """Rows with the number of samples of each file."""
    rows: dict[str, list] = {"recordings": [], "quarantine": []}
    for path, *_ in unit.files:
        (recording,) = read(path, raw_root, turnout.hammer.descriptions[unit.label.partition("/")[0]]).recordings
        rows["recordings"].append({"path": path, "n_samples": recording.n_sample, "kind": "hammer"})
    return rows


def test_a_file_with_a_read_error_of_the_disk_is_read_in_the_next_run(fleet, monkeypatch):
    for k in range(3):
        np.savez(fleet.raw / "a.npz", fs=51200.0, units=["N", "g"], data=np.arange(10.0 + 4 * k).reshape(2, -1))
        (fleet.raw / "a.npz").rename(fleet.raw / f"t{k}/2024-05-13/A_1.txt")
    load = np.load

    def bad(path, **more):
        if "t1" in str(path):
            raise OSError(errno.EIO, "Input/output error")
        return load(path, **more)

    monkeypatch.setattr("turnout.readers.npz.np.load", bad)
    summary = fleet.run(stage=Stage("hammer", count_samples, "1"))
    assert (summary.processed, summary.quarantined, summary.postponed) == (2, 0, 1)
    monkeypatch.undo()
    summary = fleet.run(stage=Stage("hammer", count_samples, "1"))
    assert (summary.processed, summary.quarantined, summary.postponed) == (1, 0, 0)
    assert fleet.lengths() == {f"t{k}/hammer/A/2024-05-13": [5 + 2 * k] for k in range(3)}


def test_a_read_error_during_the_hash_of_a_file_affects_only_its_unit(fleet, monkeypatch):
    fleet.run()
    os.utime(fleet.raw / "t0/2024-05-13/A_1.txt", (1, 1))
    sound = tasks.sha256_of

    def bad(path):
        if "t0" in str(path):
            raise OSError(errno.EIO, "Input/output error")
        return sound(path)

    monkeypatch.setattr(tasks, "sha256_of", bad)
    fleet.put("t1/2024-05-13/A_2.txt", "new")
    summary = fleet.run()
    assert (summary.processed, summary.postponed) == (1, 1) and len(fleet.lengths()) == 3
    monkeypatch.undo()
    summary = fleet.run()
    assert (summary.processed, summary.postponed) == (0, 0)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_full_disk_during_one_unit_postpones_only_that_unit(tmp_path, threads):
    fleet = Fleet(tmp_path, 4, "fleet: {checkpoint_units: 1}\n")
    fleet.put("t2/2024-05-13/A_1.txt", "full")
    assert fleet.run(threads=threads).postponed == 1
    fleet.put("t2/2024-05-13/A_1.txt", "room")
    assert set(fleet.lengths()) == {f"t{i}/hammer/A/2024-05-13" for i in (0, 1, 3)}
    assert fleet.run().processed == 1
    assert set(fleet.lengths()) == {f"t{i}/hammer/A/2024-05-13" for i in range(4)}


def test_a_full_disk_while_the_state_is_written_loses_no_result(fleet, monkeypatch):
    fleet.run()
    before = fleet.state.read_bytes()
    fleet.put("t0/2024-05-13/A_2.txt", "new")

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("turnout.files.os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        fleet.run()
    monkeypatch.undo()
    assert fleet.state.read_bytes() == before
    assert not list(fleet.state.parent.rglob("*.tmp"))
    assert fleet.run().processed == 1


def test_results_do_not_depend_on_checkpoints_or_processes(tmp_path):
    found = []
    for k, (settings, threads) in enumerate((("", 1), ("fleet: {checkpoint_units: 2}\n", 1), ("", 3))):
        fleet = Fleet(tmp_path / str(k), 7, settings)
        fleet.run(threads=threads)
        found.append(sorted((r.unit, r.key, r.status, json.dumps(r.tables)) for p in batch_paths([fleet.state])
                            for r in read_results(p)))  # fmt: skip
        assert len(load_state(fleet.state).batches) == (4 if settings else 1)
    assert found[0] == found[1] == found[2]


def test_a_batch_without_a_state_after_a_kill_is_removed(fleet, monkeypatch):
    fleet.run()
    fleet.put("t0/2024-05-13/A_2.txt", "new")
    monkeypatch.setattr(State, "save", lambda self, path: os._exit(9))
    child = os.fork()
    if child == 0:
        fleet.run()
    os.waitpid(child, 0)
    monkeypatch.undo()
    folder = fleet.state.with_suffix("")
    assert len(list(folder.glob("batch-*"))) == 2 and len(load_state(fleet.state).batches) == 1
    assert fleet.run().processed == 1
    assert {p.name for p in folder.iterdir()} == set(load_state(fleet.state).batches)


def test_rows_of_vanished_units_are_kept_and_their_open_quarantine_is_withdrawn(fleet):
    fleet.put("t0/2024-05-13/A_1.txt", "damaged")
    fleet.run()
    for i in (0, 1):
        (fleet.raw / f"t{i}/2024-05-13/A_1.txt").unlink()
    assert fleet.run().vanished == 2
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9]
    assert fleet.rows()["t0/hammer/A/2024-05-13"] == {}
    fleet.put("t0/2024-05-13/A_1.txt", "damaged")
    assert fleet.run().quarantined == 1


def test_a_file_that_vanishes_during_the_run_affects_only_its_unit(fleet):
    write_plans(fleet.configuration, fleet.raw, fleet.plan.parent, 1)
    (fleet.raw / "t0/2024-05-13/A_1.txt").unlink()
    summary = fleet.run(plan=False)
    assert (summary.processed, summary.quarantined) == (3, 1)


@pytest.mark.parametrize("has_its_time", [True, False])
def test_a_missing_file_is_computed_when_it_is_restored(has_its_time, fleet):
    """If it is copied back with its time, it equals the file in the plan of the run without it."""
    write_plans(fleet.configuration, fleet.raw, fleet.plan.parent, 1)
    path = fleet.raw / "t0/2024-05-13/A_1.txt"
    content, times = path.read_bytes(), (path.stat().st_atime_ns, path.stat().st_mtime_ns)
    path.unlink()
    assert fleet.run(plan=False).quarantined == 1
    assert fleet.run(plan=False).processed == 0  # still missing: nothing new
    path.write_bytes(content)
    if has_its_time:
        os.utime(path, ns=times)
    assert fleet.run().processed == 1 and fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]
    assert fleet.run().processed == 0


def test_a_file_that_changed_since_the_plan_is_computed_again(fleet):
    """The result is that of the new content; the next run repeats it, as the file may have been incomplete."""
    write_plans(fleet.configuration, fleet.raw, fleet.plan.parent, 1)
    fleet.put("t0/2024-05-13/A_1.txt", "longer than it was")
    assert fleet.run(plan=False).processed == 3
    assert fleet.run().processed == 1 and CALLS == ["t0/A/2024-05-13"]
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [18]
    assert fleet.run().processed == 0


def test_a_file_that_changes_while_it_is_computed_is_computed_again(fleet):
    """The new content has the same size and time: only the inode of the file differs."""
    path = fleet.raw / "t0/2024-05-13/A_1.txt"
    times = (path.stat().st_atime_ns, path.stat().st_mtime_ns)

    def compute(unit, turnout, raw_root, algo):
        rows = {
            "recordings": [{"recording_id": unit.turnout, "path": path.read_text() if unit.turnout == "t0" else ""}]
        }
        if unit.turnout == "t0" and path.read_text() != "TURNOUT 0":
            (path.parent / "new").write_text("TURNOUT 0")
            os.utime(path.parent / "new", ns=times)
            os.replace(path.parent / "new", path)
        return rows

    stage = Stage("hammer", compute, "1")
    assert fleet.run(stage=stage).processed == 3
    assert fleet.run(stage=stage).processed == 1
    assert fleet.rows()["t0/hammer/A/2024-05-13"]["recordings"][0]["path"] == "TURNOUT 0"
    assert fleet.run(stage=stage).processed == 0


def test_a_run_can_be_limited_to_one_turnout(fleet):
    assert fleet.run(only=["t1"]).processed == 1 and CALLS == ["t1/A/2024-05-13"]
    assert fleet.run().processed == 2


def test_a_context_is_part_of_the_key_and_an_argument_of_the_function(fleet):
    seen = []

    def compute(unit, turnout, raw_root, algo, context):
        seen.append((unit.turnout, context))
        return {}

    tokens = {"t0": "a", "t1": "a", "t2": "a"}
    stage = Stage("hammer", compute, "1", lambda turnout, settings: (tokens[turnout], turnout.upper()))
    fleet.run(stage=stage)
    assert seen == [("t0", "T0"), ("t1", "T1"), ("t2", "T2")]
    tokens["t1"] = "b"
    assert fleet.run(stage=stage).processed == 1


def test_a_row_that_cannot_be_written_is_a_fault_of_its_unit(fleet):
    def compute(unit, turnout, raw_root, algo):
        return {"recordings": [{"path": object()}]} if unit.turnout == "t1" else {}

    summary = fleet.run(stage=Stage("hammer", compute, "1"))
    assert (summary.processed, summary.internal_errors) == (3, 1)
    assert fleet.rows()["t1/hammer/A/2024-05-13"]["quarantine"][0]["found"].startswith(
        "TypeError: a row holds a object"
    )


@pytest.mark.parametrize("content", ['{"batches":[],"unit":{\n\n}}\n', "no JSON\n}}\n"])
def test_a_state_file_of_another_program_is_an_error(fleet, content):
    fleet.run()
    fleet.state.write_text(content)
    with pytest.raises(TurnoutError, match=r"not a state file .* Delete it and .*00of01\.done: its shard is then"):
        fleet.run()
    fleet.state.unlink()
    assert fleet.run().processed == 3


def test_a_batch_is_read_as_it_was_written(fleet):
    fleet.run()
    (path,) = batch_paths([fleet.state])
    assert [(u, t, len(r)) for u, t, r in read_batch(path)] == [
        (f"t{i}/hammer/A/2024-05-13", "recordings", 1) for i in range(3)
    ]
    assert read_column(path, "turnout", "status") == [("t0", "ok"), ("t1", "ok"), ("t2", "ok")]


@pytest.mark.parametrize("damage", ["cut", "gone"])
def test_the_units_of_a_damaged_batch_are_computed_again(fleet, damage, caplog):
    fleet.run()
    fleet.put("t1/2024-06-13/A_1.txt", "later")
    fleet.run()
    before, (first, second) = fleet.lengths(), batch_paths([fleet.state])
    if damage == "cut":
        first.write_bytes(first.read_bytes()[:-20])
    else:
        first.unlink()
    output = fleet.folder / "work/verdict.json"
    with pytest.raises(TurnoutError, match=rf"{first} cannot be read"):
        check_quality([fleet.state], fleet.configuration, output)
    assert read_postponed(fleet.state) == (1, {})  # so that the job runs, whatever its plan says
    assert fleet.run().processed == 3
    assert str(first) in caplog.text and "3 units are computed again" in caplog.text
    assert fleet.lengths() == before and second in batch_paths([fleet.state])
    check_quality([fleet.state], fleet.configuration, output)
    assert fleet.run().processed == 0


def test_a_stage_that_uses_a_damaged_batch_requests_it_again(fleet, monkeypatch):
    class Params(dict):
        __getattr__ = dict.__getitem__

    fleet.run()
    (batch,) = batch_paths([fleet.state])
    batch.unlink()
    monkeypatch.chdir(fleet.folder)
    module = type(sys)("upon_hammer")
    module.models = lambda turnout, settings: ("", list(current_results("work", "hammer", turnout)))
    monkeypatch.setitem(sys.modules, "upon_hammer", module)
    job = {"configuration": "config", "raw": "raw", "only": [], "strict": False}
    params = Params(kind="hammer", function="x:y", algo="1", job=job, context="upon_hammer:models")
    with pytest.raises(DamagedBatch, match="cannot be read"):
        stage_job("work/plan/00of01.json", "work/passage/00of01.done", params, 1)
    assert read_postponed(fleet.state) == (1, {})


def test_current_results_are_those_of_the_last_batch_and_the_last_number_of_shards(fleet):
    def results():
        return [(r.unit, r.algo) for r in current_results(fleet.folder / "work", "hammer", "t1")]

    fleet.run()
    assert results() == [("t1/hammer/A/2024-05-13", "1")]
    fleet.run(algo="2", only=["t1"])
    assert results() == [("t1/hammer/A/2024-05-13", "2")]
    assert len(batch_paths([fleet.state])) == 2  # the earlier result is still in its batch
    older = fleet.state.with_name("00of02.json")
    older.write_bytes(fleet.state.read_bytes())
    os.utime(older, ns=(0, 0))
    assert results() == [("t1/hammer/A/2024-05-13", "2")]


def test_a_token_can_depend_on_the_unit(fleet):
    fleet.put("t1/2024-06-13/A_1.txt", "later")
    newest = ["2024-05-13"]
    stage = Stage(
        "hammer", lambda unit, turnout, raw_root, algo, context: {}, "1",
        lambda turnout, settings: (lambda unit: str(unit.campaign > newest[0]), settings["fleet"].shards),
    )  # fmt: skip
    assert fleet.run(stage=stage).processed == 4
    newest[0] = "2024-06-13"
    assert fleet.run(stage=stage).processed == 1


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("text", ["no package", "no package for a record"])
def test_a_missing_package_stops_the_run_and_puts_no_file_in_quarantine(text, threads, fleet):
    fleet.put("t1/2024-05-13/A_1.txt", text)
    with pytest.raises(InstallationError, match="package h5py"):
        fleet.run(threads=threads)
    assert not any(tables.get("quarantine") for tables in fleet.rows().values())
    fleet.put("t1/2024-05-13/A_1.txt", "turnout 1")
    fleet.run()
    assert fleet.lengths() == {f"t{i}/hammer/A/2024-05-13": [9] for i in range(3)}
