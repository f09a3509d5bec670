"""A work file that a full disk or a power failure truncated is restored without computing any unit again."""

import json

import pytest
from length_fleet import CALLS

from turnout.errors import RegistryError
from turnout.stages.trend import trend_job
from turnout.workflow.launch import launch
from turnout.workflow.nightly import _batches, _planned_units, _report
from turnout.workflow.plan import read_plan, write_plans
from turnout.workflow.quality_gate import check_quality
from turnout.workflow.retries import attempt, attempts, read_postponed
from turnout.workflow.state import batch_paths

PARTS = [0.0, 0.3, 0.7, 0.95]


def cut(path, share):
    """Keep only the first ``share`` of a file."""
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])


@pytest.mark.parametrize("share", PARTS)
def test_a_truncated_state_is_restored_from_its_batches(fleet, share, caplog):
    fleet.run()
    fleet.put("t1/2024-05-13/A_1.txt", "measured again")
    fleet.put("t1/2024-06-13/A_1.txt", "and later")
    fleet.run()
    before, rows = fleet.state.read_bytes(), fleet.rows()
    cut(fleet.state, share)
    assert fleet.rows() == rows  # for a reader before its job has run
    assert fleet.run().processed == 0 and CALLS == []
    assert fleet.state.read_bytes() == before and fleet.rows() == rows
    assert str(fleet.state) in caplog.text and "made again" in caplog.text


def test_the_last_written_batch_of_a_unit_is_used_to_restore_a_truncated_state(fleet):
    fleet.run()
    for text in ("measured again", "measured once more", "turnout 1"):
        fleet.put("t1/2024-05-13/A_1.txt", text)
        fleet.run()
    cut(fleet.state, 0.5)
    assert fleet.run().processed == 0
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9]


def test_only_the_units_of_a_truncated_batch_are_computed_again(fleet):
    fleet.run()
    fleet.put("t1/2024-06-13/A_1.txt", "later")
    fleet.run()
    before, (_, second) = fleet.lengths(), batch_paths([fleet.state])
    cut(fleet.state, 0.5)
    cut(second, 0.9)
    assert fleet.run().processed == 1 and CALLS == ["t1/A/2024-06-13"]
    assert fleet.lengths() == before


def test_the_job_of_a_truncated_state_is_requested_if_no_plan_has_changed(fleet, monkeypatch):
    fleet.run()
    monkeypatch.chdir(fleet.folder)
    launch({}, scan=True)
    assert read_postponed(fleet.state) == (0, {})
    cut(fleet.state, 0.5)
    launch({}, scan=False)  # one job of a run
    assert read_postponed(fleet.state) == (0, {})
    launch({}, scan=True)
    assert read_postponed(fleet.state) == (1, {})
    fleet.run()
    launch({}, scan=True)
    assert read_postponed(fleet.state) == (1, {})


@pytest.mark.parametrize("content", ["", '{"generation": 7, "fil', '{"a": 1}'])
def test_an_unreadable_list_of_the_registry_stops_the_run_before_any_job(fleet, monkeypatch, content):
    """The last line of the nightly run states its message; a job that fails would only name its log."""
    fleet.run()
    monkeypatch.chdir(fleet.folder)
    generation = fleet.folder / "results/registry/_generation.json"
    generation.parent.mkdir(parents=True, exist_ok=True)
    generation.write_text(content)
    fleet.put("t1/2024-07-13/A_1.txt", "new")
    before = fleet.plan.read_bytes()
    with pytest.raises(RegistryError, match=r"_generation\.json: (not a generation file|written by another version)"):
        launch({}, scan=True)
    assert fleet.plan.read_bytes() == before
    launch({}, scan=False)  # one job of a run


@pytest.mark.parametrize("share", PARTS)
def test_a_truncated_plan_is_written_again_if_its_shard_was_not_requested(fleet, share):
    fleet.put("t0/2024-05-13/Ä_1.txt", "of which the name takes two bytes")
    folder = fleet.plan.parent
    write_plans(fleet.configuration, fleet.raw, folder, 2)
    whole = {path: path.read_bytes() for path in folder.iterdir()}
    for path in whole:
        cut(path, share)
        write_plans(fleet.configuration, fleet.raw, folder, 2, turnouts=["t0"])
        assert {path: path.read_bytes() for path in folder.iterdir()} == whole


def test_a_run_without_a_readable_plan_reports_the_known_units(fleet):
    fleet.run()
    cut(fleet.plan, 0.5)
    assert _report(1, set(), set(), "", fleet.folder / "work").units == 3


def test_a_vanished_unit_is_not_counted_as_processed(fleet, monkeypatch):
    """Its files were deleted: the run computed nothing for it."""
    monkeypatch.chdir(fleet.folder)
    path = fleet.put("t0/2024-07-13/A_1.txt", "soon gone") or fleet.raw / "t0/2024-07-13/A_1.txt"
    fleet.run()
    work = fleet.folder / "work"
    before, planned = _batches(work), _planned_units(work)
    fleet.put("t1/2024-07-13/A_1.txt", "new")
    path.unlink()
    fleet.run()
    report = _report(0, before, planned, "", work)
    assert (report.processed, report.vanished, report.quarantined) == (1, 1, 0)


def test_a_plan_that_is_truncated_at_any_byte_is_written_again(fleet):
    write_plans(fleet.configuration, fleet.raw, fleet.plan.parent, 1)
    content = fleet.plan.read_bytes()
    for length in range(len(content)):
        fleet.plan.write_bytes(content[:length])
        write_plans(fleet.configuration, fleet.raw, fleet.plan.parent, 1)
        assert fleet.plan.read_bytes() == content
    assert len(list(read_plan(fleet.plan))) == 3


@pytest.mark.parametrize("left", [b"", bytes(1)])  # an empty file, or a block that was never written
def test_a_truncated_number_of_attempts_requests_its_job(tmp_path, monkeypatch, left):
    monkeypatch.chdir(tmp_path)
    with attempt("register", attempts("register")):
        pass
    seen = attempts("register")
    (tmp_path / "work/attempts/register").write_bytes(left)
    again = attempts("register")
    assert again != seen
    with attempt("register", again):
        pass
    assert attempts("register") == again


@pytest.mark.parametrize("share", PARTS)
def test_after_a_truncated_verdict_all_units_are_checked_again(fleet, share):
    (fleet.folder / "config/config.yaml").write_text("fleet: {quarantine_units: 1}\n")
    fleet.run()
    output = fleet.folder / "work/verdict.json"
    assert check_quality([fleet.state], fleet.configuration, output).units == 3
    assert check_quality([fleet.state], fleet.configuration, output).units == 0
    cut(output, share)
    assert check_quality([fleet.state], fleet.configuration, output).units == 3
    assert len(json.loads(output.read_text())["judged"]) == 1


@pytest.mark.parametrize("share", PARTS)
def test_after_a_truncated_state_of_the_trend_every_year_is_written_again(fleet, share, monkeypatch):
    from turnout.registry.job import register

    root, state = fleet.folder / "registry", fleet.folder / "work/trend.json"
    register([], root, read=iter)
    names = (root / "_generation.json", state, fleet.folder / "config")
    done = trend_job(*names)
    cut(state, share)
    assert trend_job(*names) == done == json.loads(state.read_text())
