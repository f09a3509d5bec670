"""Files of visits: those that no longer serve are removed, and no others."""

from turnout.stages.stored_visits import remove_other_visits


def test_only_files_of_other_visits_of_the_same_turnout_are_removed(tmp_path):
    digests = "0123456789ab", "ba9876543210"  # of two groups of sections
    for turnout in ("T1", "T10"):
        (tmp_path / turnout).mkdir()
        for visit in ("2026-01-05", "2026-01-05-2", "2026-02-05"):
            for digest in digests:
                (tmp_path / turnout / f"{visit}-{digest}.npz").touch()
    (tmp_path / "T1" / "notes.txt").touch()
    remove_other_visits(tmp_path, "T1", {"2026-01-05": [], "2026-03-05": []})
    left = {path.name for path in (tmp_path / "T1").iterdir()}
    assert left == {*(f"2026-01-05-{digest}.npz" for digest in digests), "notes.txt"}
    assert len(list((tmp_path / "T10").iterdir())) == 6


def test_a_folder_that_does_not_exist_yet_is_no_error(tmp_path):
    remove_other_visits(tmp_path, "T1", ())
    assert not (tmp_path / "T1").exists()
