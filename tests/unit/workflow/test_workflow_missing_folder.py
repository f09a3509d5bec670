"""A turnout without its raw folder, and names of files that would break a line."""

import pytest
from tests.unit.config.one_section import LAYOUT

from turnout.config import load_configuration
from turnout.workflow.scan import scan


def problems(folder, raw):
    """What the scan of a turnout with this raw folder reports."""
    (folder / "config/layouts").mkdir(parents=True, exist_ok=True)
    (folder / "config/layouts/main.yaml").write_text(LAYOUT)
    (folder / "config/turnouts.tsv").write_text(f"turnout\tlayout\traw\nt1\tmain\t{raw}\n")
    (folder / "raw").mkdir(exist_ok=True)
    return [str(p) for p in scan(load_configuration(folder / "config").turnout("t1"), folder / "raw").problems]


def test_a_folder_that_does_not_exist_is_told_from_one_without_recordings(tmp_path):
    (problem,) = problems(tmp_path, "line/t1")
    assert problem.startswith("line/t1, folder: there is no such folder. Put the recordings there")
    (tmp_path / "raw/line/t1").mkdir(parents=True)
    (problem,) = problems(tmp_path, "line/t1")
    assert problem.startswith("line/t1, folder: no file matches a pattern of the layout")


@pytest.mark.parametrize(
    ("raw", "there", "difference"),
    [
        ("line/T1", "line/t1", "capitals"),
        ("Größe", "Gro\u0308ße", "the form of an accented letter"),
        ("Gro\u0308ße", "Größe", "the form of an accented letter"),
        ("t1", "t1 ", "dots or blanks"),
    ],
)
def test_a_folder_of_nearly_the_same_name_is_named(tmp_path, raw, there, difference):
    (tmp_path / "raw" / there).mkdir(parents=True)
    (problem,) = problems(tmp_path, raw)
    assert f"there is no such folder, but {there.split('/')[-1]!r} differs from it only in" in problem
    assert difference in problem and "Rename that folder" in problem


@pytest.mark.parametrize("letter", ["\n", "\r", "\t", "\x1b", "\u2028", "\x85"])
def test_a_name_that_would_break_a_line_is_escaped(tmp_path, letter):
    folder = tmp_path / "raw/t1/hammer/2024-01-01"
    folder.mkdir(parents=True)
    (folder / f"A7_{letter}1.npz").write_text("")
    (folder / f"A7{letter}.npz").mkdir()
    (name, *_) = problems(tmp_path, "t1")
    assert letter not in name and repr(letter)[1:-1] in name
