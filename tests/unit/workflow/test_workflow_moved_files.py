"""A measurement whose files were moved counts at its new place alone."""

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


def test_a_measurement_that_was_moved_counts_once_and_one_that_was_deleted_stays(fleet):
    """A folder of the wrong day is renamed, one file goes to the day it belongs to, one is deleted on purpose."""
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
    assert len(batch_paths([fleet.state])) == n_batch  # withdrawn once
    (fleet.raw / "t0/2024-05-31").rename(fleet.raw / "t0/2024-05-13")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9] and fleet.lengths()["t0/hammer/A/2024-05-31"] == []


def test_a_measurement_that_was_moved_counts_once_though_the_job_was_killed_before_it_knew(fleet, monkeypatch):
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


def test_a_measurement_that_was_moved_to_where_it_cannot_be_read_stays(fleet):
    """The unit that holds the file now gives no row: those that there are are not taken back."""
    fleet.run()
    fleet.put("t0/2024-05-31/A_2.txt", "damaged")
    (fleet.raw / "t0/2024-05-13/A_1.txt").rename(fleet.raw / "t0/2024-05-31/A_1.txt")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]


def test_a_campaign_that_was_moved_to_another_turnout_counts_there_alone(fleet):
    fleet.run()
    (fleet.raw / "t1/2024-05-13").rename(fleet.raw / "t2/2024-05-31")
    fleet.run()
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [] and fleet.lengths()["t2/hammer/A/2024-05-31"] == [9]
    (fleet.raw / "t2/2024-05-31").rename(fleet.raw / "t1/2024-05-13")
    fleet.run()
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9] and fleet.lengths()["t2/hammer/A/2024-05-31"] == []
    assert fleet.run().processed == 0


class TwoShards(Fleet):
    """t0 to t3 are of one shard, t4 of the other; what their jobs leave, in any order, is looked through."""

    stages = {"hammer": None}

    def night(self, order):
        CALLS.clear()
        write_plans(self.configuration, self.raw, self.plan.parent, 2)
        for kind, gather in self.stages.items():
            for name in order:
                stage = Stage(kind, length, "1", gather=gather)
                plan = self.plan.with_name(f"{name}.json")
                run_shard(plan, self.state_of(kind, name), stage, self.configuration, self.raw)
        return self.look_through()

    def look_through(self):
        return withdraw_moved(self.folder / "work", self.stages, SHARDS, self.configuration.settings["fleet"])

    def state_of(self, kind, shard):
        return self.folder / "work" / kind / f"{shard}.json"

    def lengths(self, kind="hammer"):
        states = [self.state_of(kind, name) for name in SHARDS]
        tables = {r.unit: r.tables for path in batch_paths(states) for r in read_results(path)}
        return {u: [r["n_samples"] for r in t.get("recordings", [])] for u, t in tables.items()}


@pytest.mark.parametrize("order", [SHARDS, SHARDS[::-1]])
def test_a_campaign_that_was_moved_to_a_turnout_of_another_shard_counts_there_alone(tmp_path, order):
    assert shard_of("t0", 2) != shard_of("t4", 2)
    fleet = TwoShards(tmp_path, 5)
    assert fleet.night(order) == 0
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t4/2024-05-31")
    assert fleet.night(order) == 1
    assert fleet.lengths() == {f"t{i}/hammer/A/2024-05-13": [9] if i else [] for i in range(5)} | {
        "t4/hammer/A/2024-05-31": [9]
    }
    old = fleet.state.with_name(f"{shard_of('t0', 2)}.json")
    assert read_postponed(old) == (1, {})  # what builds on it is asked for again
    assert fleet.night(order) == 0 and CALLS == [] and read_postponed(old) == (1, {})
    (fleet.raw / "t4/2024-05-31").rename(fleet.raw / "t0/2024-05-13")
    assert fleet.night(order) == 1
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9] and fleet.lengths()["t4/hammer/A/2024-05-31"] == []


def test_what_was_moved_is_withdrawn_though_the_job_was_killed_before_it_was_written(tmp_path, monkeypatch):
    fleet = TwoShards(tmp_path, 5)
    fleet.night(SHARDS)
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t4/2024-05-31")

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("turnout.workflow.duplicate_files.withdrawal", killed)
        fleet.night(SHARDS)
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]
    assert fleet.look_through() == 1
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == []


def test_the_same_file_at_two_turnouts_counts_at_both_while_the_plan_of_one_is_not_there(tmp_path):
    """Without its plan nobody can say that a unit is gone."""
    fleet = TwoShards(tmp_path, 5)
    fleet.put("t4/2024-05-13/A_1.txt", "turnout 0")
    fleet.night(SHARDS)
    (fleet.plan.with_name(f"{shard_of('t0', 2)}.json")).unlink()
    assert fleet.look_through() == 0


def test_a_campaign_that_was_moved_to_where_it_cannot_be_read_stays_though_of_another_shard(tmp_path):
    fleet = TwoShards(tmp_path, 5)
    fleet.night(SHARDS)
    (fleet.raw / "t0/2024-05-13").rename(fleet.raw / "t4/2024-05-31")
    fleet.put("t4/2024-05-31/A_2.txt", "damaged")
    assert fleet.night(SHARDS) == 0
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [9]


def visit_of(plan, configuration):
    """The newest campaign of each turnout, as a stage of its own looks at it."""
    newest = {p.unit.turnout: p.unit for p in sorted(read_plan(plan), key=lambda p: p.unit.label)}
    for unit in newest.values():
        own = configuration.turnout(unit.turnout).hashes["mismatch"]
        yield PlannedUnit(
            replace(unit, kind="mismatch", label=unit.campaign, config_hash=own, section=None, campaign=None)
        )


def test_what_was_found_from_a_visit_that_was_moved_is_withdrawn_and_of_an_older_visit_stays(tmp_path):
    fleet = TwoShards(tmp_path, 5)
    fleet.stages = {"hammer": None, "mismatch": visit_of}
    fleet.put("t0/2024-06-13/A_1.txt", "wrongly filed")
    fleet.put("t1/2024-06-13/A_1.txt", "rightly filed")
    fleet.night(SHARDS)
    (fleet.raw / "t0/2024-06-13").rename(fleet.raw / "t4/2024-06-13")
    fleet.put("t1/2024-07-13/A_1.txt", "newer")
    assert fleet.night(SHARDS) == 2
    found = fleet.lengths("mismatch")
    assert {unit: found[unit] for unit in found if not unit.startswith(("t2", "t3"))} == {
        "t0/mismatch/2024-06-13": [], "t0/mismatch/2024-05-13": [9],
        "t1/mismatch/2024-06-13": [13], "t1/mismatch/2024-07-13": [5],
        "t4/mismatch/2024-05-13": [9], "t4/mismatch/2024-06-13": [13],
    }  # fmt: skip
    assert fleet.night(SHARDS) == 0
