"""Two copies of a file in the folder of one turnout are used once at any time."""

import random
import shutil

import pytest
from length_fleet import CALLS, Fleet

from turnout.workflow.duplicate_files import files_at_two_turnouts
from turnout.workflow.state import batch_paths


def test_a_copy_is_reported_and_is_used_after_its_original_is_deleted(fleet):
    """A file is exported under a second name, and then the first file is deleted."""
    fleet.run()
    day, other = fleet.raw / "t0/2024-05-13", fleet.raw / "t0/2024-05-31"
    shutil.copytree(day, other)
    assert fleet.run().processed == 1
    first, second = "t0/hammer/A/2024-05-13", "t0/hammer/A/2024-05-31"
    assert fleet.lengths()[first] == [9] and fleet.lengths()[second] == []
    (row,) = fleet.rows()[second]["quarantine"]
    assert row["reason_code"] == "duplicate" and row["path"].endswith("2024-05-31/A_1.txt")
    assert row["found"] == "same bytes as t0/2024-05-13/A_1.txt"
    n_batch = len(batch_paths([fleet.state]))
    assert fleet.run().processed == 0 and len(batch_paths([fleet.state])) == n_batch
    shutil.rmtree(day)
    assert fleet.run().processed == 1
    assert fleet.lengths()[first] == [] and fleet.lengths()[second] == [9]
    assert fleet.run().processed == 0 and fleet.lengths()[second] == [9]


def test_a_copy_is_used_after_its_original_has_other_content(fleet):
    """A unit with more files than the other is not a copy of it."""
    shutil.copytree(fleet.raw / "t0/2024-05-13", fleet.raw / "t0/2024-05-31")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-31"] == []
    fleet.put("t0/2024-05-13/A_1.txt", "measured again")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [14] and fleet.lengths()["t0/hammer/A/2024-05-31"] == [9]
    fleet.put("t0/2024-05-13/A_1.txt", "turnout 0")
    fleet.put("t0/2024-05-31/A_2.txt", "and more")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-05-13"] == [] and fleet.lengths()["t0/hammer/A/2024-05-31"] == [9, 8]


def test_the_same_file_at_two_turnouts_is_used_at_both(fleet):
    fleet.put("t1/2024-05-13/A_1.txt", "turnout 0")
    fleet.run()
    assert fleet.lengths()["t1/hammer/A/2024-05-13"] == [9]


def remarks(fleet):
    rows = files_at_two_turnouts(fleet.folder / "work", ["hammer"], [fleet.plan.stem])
    return [(row["turnout_id"], row["path"], row["found"]) for row in rows if row["reason_code"] == "other_turnout"]


def test_the_same_file_at_two_turnouts_has_a_remark_at_each_until_one_is_deleted(fleet):
    """Nothing shows at which of the two turnouts it was measured."""
    fleet.put("t1/2024-05-13/A_2.txt", "turnout 0")
    fleet.run()
    first, second = "t0/2024-05-13/A_1.txt", "t1/2024-05-13/A_2.txt"
    assert remarks(fleet) == [
        ("t0", first, f"same bytes as {second}; it counts at both"),
        ("t1", second, f"same bytes as {first}; it counts at both"),
    ]
    (fleet.raw / first).unlink()
    fleet.run()
    assert remarks(fleet) == []


def test_copies_within_one_turnout_and_unusable_files_give_no_remark_of_two_turnouts(fleet):
    share_a_file(fleet)
    for turnout in ("t0", "t1"):
        fleet.put(f"{turnout}/2024-06-13/A_1.txt", "damaged")
    fleet.run()
    assert remarks(fleet) == []


FIRST, SECOND = "t0/hammer/A/2024-05-13", "t0/hammer/A/2024-05-31"


def share_a_file(fleet):
    """Two campaigns of a section, each with its own test; the second also has the first test of the first."""
    fleet.put("t0/2024-05-13/A_2.txt", "of the first day")
    fleet.put("t0/2024-05-31/A_2.txt", "turnout 0")
    fleet.put("t0/2024-05-31/A_3.txt", "of the second")


def duplicates(fleet, unit):
    rows = fleet.rows()[unit].get("quarantine", [])
    return [(row["path"], row["place"], row["found"]) for row in rows if row["reason_code"] == "duplicate"]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_file_of_two_campaigns_is_used_only_in_the_first(fleet, threads):
    share_a_file(fleet)
    fleet.run(threads=threads)
    assert fleet.lengths()[FIRST] == [9, 16] and duplicates(fleet, FIRST) == []
    assert fleet.lengths()[SECOND] == [13]
    assert duplicates(fleet, SECOND) == [("t0/2024-05-31/A_2.txt", "the file", "same bytes as t0/2024-05-13/A_1.txt")]
    n_batch = len(batch_paths([fleet.state]))
    assert fleet.run().processed == 0 and CALLS == [] and len(batch_paths([fleet.state])) == n_batch


def test_a_shared_file_is_used_in_the_second_campaign_after_it_is_deleted_from_the_first(fleet):
    share_a_file(fleet)
    fleet.run()
    (fleet.raw / "t0/2024-05-13/A_1.txt").unlink()
    fleet.run()
    assert fleet.lengths()[FIRST] == [16] and fleet.lengths()[SECOND] == [9, 13]
    assert duplicates(fleet, SECOND) == []
    assert fleet.run().processed == 0


def test_a_shared_file_is_used_once_after_the_job_was_killed_before_the_comparison(fleet, monkeypatch):
    share_a_file(fleet)

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("turnout.workflow.shard.copies", killed)
    with pytest.raises(KeyboardInterrupt):
        fleet.run()
    monkeypatch.undo()
    assert fleet.lengths()[SECOND] == [9, 13]
    fleet.run()
    assert CALLS == ["t0/A/2024-05-31"] and fleet.lengths()[SECOND] == [13]


def test_a_campaign_that_has_only_files_of_two_others_gives_no_row(fleet):
    share_a_file(fleet)
    fleet.put("t0/2024-06-13/A_1.txt", "of the second")
    fleet.put("t0/2024-06-13/A_2.txt", "of the first day")
    fleet.run()
    assert fleet.lengths()["t0/hammer/A/2024-06-13"] == []
    message = "same bytes as t0/2024-05-31/A_3.txt, t0/2024-05-13/A_2.txt"
    assert duplicates(fleet, "t0/hammer/A/2024-06-13") == [("t0/2024-06-13/A_1.txt", "the whole unit", message)]
    assert fleet.run().processed == 0


def test_a_file_that_is_shared_with_a_campaign_without_rows_is_used(fleet):
    share_a_file(fleet)
    fleet.put("t0/2024-05-13/A_2.txt", "damaged")
    fleet.run()
    assert fleet.lengths()[FIRST] == [] and fleet.lengths()[SECOND] == [9, 13]


def test_a_campaign_that_shares_files_with_two_others_leaves_out_both_files(fleet):
    share_a_file(fleet)
    fleet.put("t0/2024-05-31/A_4.txt", "a third one")
    fleet.run()
    assert fleet.lengths()[SECOND] == [13, 11]
    fleet.put("t0/2024-05-01/A_1.txt", "of the second")
    fleet.put("t0/2024-05-01/A_2.txt", "of an earlier day")
    fleet.run()
    assert fleet.lengths()[SECOND] == [11] and fleet.lengths()[FIRST] == [9, 16]
    assert [found for *_, found in duplicates(fleet, SECOND)] == [
        "same bytes as t0/2024-05-13/A_1.txt", "same bytes as t0/2024-05-01/A_1.txt",
    ]  # fmt: skip
    assert fleet.run().processed == 0 and CALLS == []


@pytest.mark.parametrize("seed", range(6))
def test_every_content_is_used_once_after_any_order_of_copies_and_deletions(tmp_path, seed):
    """Four campaigns of up to three files with six contents of different lengths; changes in ten nights."""
    fleet, draw = Fleet(tmp_path, 1), random.Random(seed)
    places = [f"t0/2024-0{month}-13/A_{test}.txt" for month in (5, 6, 7, 8) for test in (1, 2, 3)]
    for _ in range(10):
        for name in draw.sample(places, 3):
            if draw.random() < 0.3:
                (fleet.raw / name).unlink(missing_ok=True)
            else:
                fleet.put(name, "x" * draw.randint(1, 6))
        fleet.run()
        files = list(fleet.raw.glob("t0/*/*.txt"))
        days = {path.parent.name for path in files}
        counted = [n for unit, found in fleet.lengths().items() if unit.rsplit("/", 1)[1] in days for n in set(found)]
        assert sorted(counted) == sorted({path.stat().st_size for path in files})
        assert fleet.run().processed == 0 and CALLS == []
