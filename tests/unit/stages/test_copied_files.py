"""Two copies of one recording are one measurement: a diagnosis has no more evidence than with one copy."""

import shutil

import pytest
import small_turnout as small

from turnout.config import load_configuration, with_raw
from turnout.records import Unit
from turnout.stages.copied_files import without_copies
from turnout.stages.mismatch_inputs import gather_inputs
from turnout.stages.track_files import track_of
from turnout.workflow.scan import scan


@pytest.fixture
def raw(tmp_path):
    def make(**units):
        """Units of hammer tests, each with its files and their bytes."""
        found = []
        for label, contents in units.items():
            for name, content in contents.items():
                (tmp_path / name).write_bytes(content)
            files = tuple((name, len(content), 0) for name, content in contents.items())
            found.append(Unit("t1", "hammer", label, files, ""))
        return found, tmp_path

    return make


def remaining_names(units):
    return {unit.label: [path for path, *_ in unit.files] for unit in units}


@pytest.mark.parametrize("order", [1, -1])
def test_the_first_by_name_of_equal_files_is_used_in_any_order_of_the_units(raw, order):
    units, folder = raw(
        b={"b1": b"one", "b2": b"two"}, a={"a1": b"one"}, c={"c1": b"two"}, d={"d1": b"six", "d2": b"six"}
    )
    left, notes = without_copies(units[::order], folder)
    assert remaining_names(left) == {"a": ["a1"], "b": ["b2"], "d": ["d1"]}
    assert notes == [
        "b1: same bytes as a1; not used",
        "c1: same bytes as b2; not used",
        "d2: same bytes as d1; not used",
    ]


def test_files_of_equal_size_of_another_kind_or_unreadable_files_are_no_copies(raw):
    units, folder = raw(a={"a1": b"one"}, b={"b1": b"two"}, c={"c1": b"six"})
    units.append(Unit("t1", "passage", "d", (("a1", 3, 0),), ""))
    (folder / "c1").unlink()
    assert without_copies(units, folder) == (units, [])


def test_a_copied_test_is_used_once_in_a_diagnosis_and_the_copy_is_reported(tmp_path, repository, monkeypatch):
    small.write_configuration(tmp_path, repository)
    small.write_hammer_tests(tmp_path)
    monkeypatch.chdir(tmp_path)
    turnout = with_raw(load_configuration("config").turnout("t1"), tmp_path / "raw")

    def gathered():
        return gather_inputs(scan(turnout, tmp_path / "raw").units, turnout, tmp_path / "raw", track_of(turnout)[0], {})

    once = gathered()
    (original, *_) = sorted((tmp_path / "raw").rglob("A_1.h5"))
    shutil.copy(original, original.with_name("A_2.h5"))
    twice = gathered()
    assert [len(t.recordings) for t in twice.tests] == [len(t.recordings) for t in once.tests]
    assert any("A_2.h5: same bytes as" in note.text for note in twice.notes) and not once.notes
