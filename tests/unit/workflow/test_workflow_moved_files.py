"""A measurement whose files were moved is used only at its new place."""

import time
from dataclasses import replace

import pytest
from length_fleet import CALLS, Fleet, length

from turnout.workflow.batches import read_results
from turnout.workflow.duplicate_files import withdraw_moved
from turnout.workflow.plan import PlannedUnit, read_plan, shard_of, write_plans
from turnout.workflow.retries import read_postponed
from turnout.workflow.shard import run_shard
from turnout.workflow.state import batch_paths
from turnout.workflow.tasks import Stage

SHARDS = ["00of02", "01of02"]


def test_a_moved_measurement_is_used_once_and_a_deleted_measurement_is_kept(fleet):
    """A folder gets its correct day, one file moves to its correct day, and one file is deleted."""
    fleet.put("t1/2024-05-14/A_2.txt", "belongs to the day before")
    fleet.run()
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t0/2024-05-31")
    (fleet.raw / "t1/2024-05-14/A_2.txt").rename(fleet.raw / "t1/2024-05-13/A_2.txt")
    (fleet.raw / "t2/2024-05-13/A_1.txt").unlink()
    assert fleet.run().vanished == 3
    assert fleet.lengths() == {
        "t0/hammer/A/2024-05-13": [], "t0/hammer/A/2024-05-31": [9],
        "t1/hammer/A/2024-05-13": [9, 25], "t1/hammer/A/2024-05-14": [],
        "t2/hammer/A/2024-05-13": [9],
    }  # fmt: skip
    n_batch = len(batch_paths([fleet.state]))
    fleet.run()
    assert len(batch_paths([fleet.state])) == n_batch  # it is withdrawn only once
    (fleet.raw / "t0/2024-05-31").rename(fleet.raw / "t0/2024-05-13")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9] and fleet.lengths()["t0/hammer/A/2024-05-31"] == []


@pytest.mark.parametrize(("deleted", "remaining"), [(1, []), (2, [9, 1, 2])])
def test_a_measurement_that_was_moved_without_some_of_its_files_is_used_once(fleet, deleted, remaining):
    """The folder gets its correct day, and copies in it are deleted in the same night.

    Of a measurement of which most files were deleted, one misplaced file has moved: the rows of the others are kept.
    """
    for n in range(deleted):
        fleet.put(f"t0/2024-05-13/A_{n + 2}.txt", "x" * (n + 1))
    fleet.run()
    (fleet.raw / "t0/2024-05-31").mkdir()
    (fleet.raw / "t0/2024-05-13/A_1.txt").rename(fleet.raw / "t0/2024-05-31/A_1.txt")
    for n in range(deleted):
        (fleet.raw / f"t0/2024-05-13/A_{n + 2}.txt").unlink()
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-31"] == [9]
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == remaining


def test_a_moved_measurement_is_used_once_after_the_job_was_killed_before_the_withdrawal(fleet, monkeypatch):
    fleet.run()
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t0/2024-05-31")

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("turnout.workflow.shard._Run._withdraw_vanished", killed)
    with pytest.raises(KeyboardInterrupt):
        fleet.run()
    monkeypatch.undo()
    assert fleet.run().processed == 0
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [] and fleet.lengths()["t0/hammer/A/2024-05-31"] == [9]


def test_a_measurement_that_was_moved_to_an_unreadable_unit_is_kept(fleet):
    """The unit with the moved file gives no row, so the earlier rows are not withdrawn."""
    fleet.run()
    fleet.put("t0/2024-05-31/A_2.txt", "damaged")
    (fleet.raw / "t0/2024-05-13/A_1.txt").rename(fleet.raw / "t0/2024-05-31/A_1.txt")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]


def test_a_campaign_that_was_moved_to_another_turnout_is_used_only_there(fleet):
    fleet.run()
    (fleet.raw / "t1/2024-05-13").rename(fleet.raw / "t2/2024-05-31")
    fleet.run()
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [] and fleet.lengths()["t2/hammer/A/2024-05-31"] == [9]
    (fleet.raw / "t2/2024-05-31").rename(fleet.raw / "t1/2024-05-13")
    fleet.run()
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9] and fleet.lengths()["t2/hammer/A/2024-05-31"] == []
    assert fleet.run().processed == 0


class TwoShards(Fleet):
    """A fleet with t0 to t3 in one shard and t4 in the other; moved files are searched after the jobs."""

    stages = {"hammer": None}

    def run_night(self, order, compute=length, published=0):
        CALLS.clear()
        write_plans(self.configuration, self.raw, self.plan.parent, 2)
        for kind, gather in self.stages.items():
            for name in order:
                stage = Stage(kind, compute, "1", gather=gather)
                plan = self.plan.with_name(f"{name}.json")
                run_shard(plan, self.state_of(kind, name), stage, self.configuration, self.raw)
        return self.withdraw_moved_files(published)

    def withdraw_moved_files(self, published=0):
        limits = self.configuration.settings["fleet"]
        return withdraw_moved(self.folder / "work", self.stages, SHARDS, limits, published)

    def state_of(self, kind, shard):
        return self.folder / "work" / kind / f"{shard}.json"

    def lengths(self, kind="hammer"):
        states = [self.state_of(kind, name) for name in SHARDS]
        tables = {r.unit: r.tables for path in batch_paths(states) for r in read_results(path)}
        return {u: [r["n_samples"] for r in t.get("recordings", [])] for u, t in tables.items()}


@pytest.mark.parametrize("order", [SHARDS, SHARDS[::-1]])
def test_a_campaign_that_was_moved_to_a_turnout_of_another_shard_is_used_only_there(tmp_path, order):
    assert shard_of("t0", 2) != shard_of("t4", 2)
    fleet = TwoShards(tmp_path, 5)
    assert fleet.run_night(order) == 0
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t4/2024-05-31")
    assert fleet.run_night(order) == 1
    assert fleet.lengths() == {f"t{i}/hammer/A/2024-05-13": [9] if i else [] for i in range(5)} | {
        "t4/hammer/A/2024-05-31": [9]
    }
    old = fleet.state.with_name(f"{shard_of('t0', 2)}.json")
    assert read_postponed(old) == (1, {})  # later stages are requested again
    assert fleet.run_night(order) == 0 and CALLS == [] and read_postponed(old) == (1, {})
    (fleet.raw / "t4/2024-05-31").rename(fleet.raw / "t0/2024-05-13")
    assert fleet.run_night(order) == 1
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9] and fleet.lengths()["t4/hammer/A/2024-05-31"] == []


def test_a_moved_campaign_is_withdrawn_after_the_job_was_killed_before_the_withdrawal(tmp_path, monkeypatch):
    fleet = TwoShards(tmp_path, 5)
    fleet.run_night(SHARDS)
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t4/2024-05-31")

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("turnout.workflow.duplicate_files.withdrawal", killed)
        fleet.run_night(SHARDS)
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]
    assert fleet.withdraw_moved_files() == 1
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == []


def impacts_of(unit, turnout, raw_root, algo=""):
    """Rows of a file of peak forces [N], such as "812.31 905.27 # a comment"."""
    rows = length(unit, turnout, raw_root, algo)
    texts = [(raw_root / path).read_text().partition("#")[0].split() for path, *_ in unit.files]
    return rows | {"impacts": [{"peak_n": float(peak), "contact_ms": 0.4} for text in texts for peak in text]}


@pytest.mark.parametrize(
    "corrected, same",
    [
        ("812.31 905.27 799.64 1011.5 # a corrected name of a channel", True),
        ("812.31 905.27 799.64 1011.5 644.07 # the impact that was cut off", True),
        ("812.31 911.88 640.02 1002.5 # another test of that day", False),
    ],
)
def test_a_test_that_was_corrected_and_moved_in_one_night_is_used_only_there(tmp_path, corrected, same):
    fleet = TwoShards(tmp_path, 5)
    fleet.put("t0/2024-05-13/A_1.txt", "812.31 905.27 799.64 1011.5")
    fleet.run_night(SHARDS, impacts_of)
    published = time.time_ns()
    (fleet.raw / "t0/2024-05-13/A_1.txt").unlink()
    fleet.put("t4/2024-05-13/A_1.txt", corrected)
    assert fleet.run_night(SHARDS, impacts_of, published) == int(same)
    assert (fleet.lengths()["t0/hammer/A/2024-05-13"] == []) == same
    assert fleet.lengths()["t4/hammer/A/2024-05-13"] == [len(corrected)]
    fleet.put("t0/2024-05-13/A_1.txt", "812.31 905.27 799.64 1011.5")  # the file is back: both count again
    fleet.run_night(SHARDS, impacts_of, time.time_ns())
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [27]


def test_the_same_file_at_two_turnouts_is_used_at_both_while_a_plan_is_missing(tmp_path):
    """Without its plan it is unknown whether a unit has vanished."""
    fleet = TwoShards(tmp_path, 5)
    fleet.put("t4/2024-05-13/A_1.txt", "turnout 0")
    fleet.run_night(SHARDS)
    (fleet.plan.with_name(f"{shard_of('t0', 2)}.json")).unlink()
    assert fleet.withdraw_moved_files() == 0


def test_a_campaign_that_was_moved_to_an_unreadable_unit_of_another_shard_is_kept(tmp_path):
    fleet = TwoShards(tmp_path, 5)
    fleet.run_night(SHARDS)
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t4/2024-05-31")
    fleet.put("t4/2024-05-31/A_2.txt", "damaged")
    assert fleet.run_night(SHARDS) == 0
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]


def visit_of(plan, configuration):
    """The newest campaign of each turnout, as a separate stage uses it."""
    newest = {p.unit.turnout: p.unit for p in sorted(read_plan(plan), key=lambda p: p.unit.label)}
    for unit in newest.values():
        own = configuration.turnout(unit.turnout).hashes["mismatch"]
        yield PlannedUnit(
            replace(unit, kind="mismatch", label=unit.campaign, config_hash=own, section=None, campaign=None)
        )


def test_findings_of_a_moved_visit_are_withdrawn_and_those_of_an_older_visit_are_kept(tmp_path):
    fleet = TwoShards(tmp_path, 5)
    fleet.stages = {"hammer": None, "mismatch": visit_of}
    fleet.put("t0/2024-06-13/A_1.txt", "wrongly filed")
    fleet.put("t1/2024-06-13/A_1.txt", "rightly filed")
    fleet.run_night(SHARDS)
    (fleet.raw / "t0/2024-06-13").rename(fleet.raw / "t4/2024-06-13")
    fleet.put("t1/2024-07-13/A_1.txt", "newer")
    assert fleet.run_night(SHARDS) == 2
    found = fleet.lengths("mismatch")
    assert {unit: found[unit] for unit in found if not unit.startswith(("t2", "t3"))} == {
        "t0/mismatch/2024-06-13": [], "t0/mismatch/2024-05-13": [9],
        "t1/mismatch/2024-06-13": [13], "t1/mismatch/2024-07-13": [5],
        "t4/mismatch/2024-05-13": [9], "t4/mismatch/2024-06-13": [13],
    }  # fmt: skip
    assert fleet.run_night(SHARDS) == 0
