"""The same bytes twice in one turnout's folder count once, at every moment."""

import shutil

from turnout.fleet.state import batch_paths


def test_a_copy_is_said_and_counts_once_its_original_is_gone(fleet):
    """A file exported under a second name, and then the first one deleted: it counts once, at every moment."""
    fleet.run()
    day, other = fleet.raw / "t0/2024-05-13", fleet.raw / "t0/2024-05-31"
    shutil.copytree(day, other)
    assert fleet.run().processed == 1
    first, second = "t0/hammer/A/2024-05-13", "t0/hammer/A/2024-05-31"
    assert fleet.lengths()[first] == [9] and fleet.lengths()[second] == []
    (said,) = fleet.rows()[second]["quarantine"]
    assert said["reason_code"] == "duplicate" and said["path"].endswith("2024-05-31/A_1.txt")
    assert said["found"] == "same bytes as t0/2024-05-13/A_1.txt"
    n_batch = len(batch_paths([fleet.state]))
    assert fleet.run().processed == 0 and len(batch_paths([fleet.state])) == n_batch
    shutil.rmtree(day)
    assert fleet.run().processed == 1
    assert fleet.lengths()[first] == [] and fleet.lengths()[second] == [9]
    assert fleet.run().processed == 0 and fleet.lengths()[second] == [9]


def test_a_copy_whose_original_is_measured_anew_counts_for_itself(fleet):
    """And one that holds more than the other is no copy of it."""
    shutil.copytree(fleet.raw / "t0/2024-05-13", fleet.raw / "t0/2024-05-31")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-31"] == []
    fleet.put("t0/2024-05-13/A_1.txt", "measured anew")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [13] and fleet.lengths()["t0/hammer/A/2024-05-31"] == [9]
    fleet.put("t0/2024-05-13/A_1.txt", "turnout 0")
    fleet.put("t0/2024-05-31/A_2.txt", "and more")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [] and fleet.lengths()["t0/hammer/A/2024-05-31"] == [9, 8]


def test_the_same_file_at_two_turnouts_is_no_copy(fleet):
    fleet.put("t1/2024-05-13/A_1.txt", "turnout 0")
    fleet.run()
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9]
