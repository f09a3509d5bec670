"""A measurement whose files were moved counts at its new place alone."""

import pytest

from turnout.fleet.state import batch_paths


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

    monkeypatch.setattr("turnout.fleet.shard._Run._withdraw_vanished", killed)
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
