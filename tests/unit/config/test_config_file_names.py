"""Names that some file systems treat as equal or do not allow: capitals, Unicode forms, endings, reserved names."""

import unicodedata

import pytest

from turnout.config.consistency import check_consistency
from turnout.config.document import load
from turnout.config.file_names import file_key, name_problem
from turnout.config.load import load_configuration
from turnout.config.turnouts_table import read_table
from turnout.errors import ConfigErrors

COMPOSED = "Århus"
DECOMPOSED = unicodedata.normalize("NFD", COMPOSED)
SAME = {
    "T1": "t1",
    COMPOSED: DECOMPOSED,
    COMPOSED + "x": DECOMPOSED.lower() + "X",
    "t1.": "t1",
    "a/t1 ": "a/t1",
    "Weiß": "WEISS",
}


def table(folder, *rows):
    path = folder / "turnouts.tsv"
    path.write_text("turnout\tlayout\traw\n" + "".join(f"{row}\n" for row in rows), encoding="utf-8")
    rows, errors = read_table(path, "turnouts.tsv")
    return [row.id for row in rows], [str(error) for error in errors]


@pytest.mark.parametrize("name", SAME)
def test_names_that_some_file_system_treats_as_the_same_have_one_key(name):
    assert name != SAME[name] and file_key(name) == file_key(SAME[name])


@pytest.mark.parametrize(
    "name", ["aux", "CON", "nul.txt", "a/Com1", "LPT9.d/x", "t1.", "t1 ", "a:b", "what?", "x\\y", "a\x07"]
)
def test_names_that_some_file_system_does_not_allow_are_reported(name):
    assert name_problem(name)


@pytest.mark.parametrize("name", ["T1", "console", "com10", "a.b", "line 7/t1", "../t1", COMPOSED])
def test_other_names_are_accepted(name):
    assert name_problem(name) is None


def test_ids_that_differ_only_in_capitals_are_an_error(tmp_path):
    ids, (error,) = table(tmp_path, "T1\tmain\t", "t1\tmain\t")
    assert ids == ["T1"]
    assert "line 3, column 1: turnout 't1' and 'T1' differ only in capitals" in error


@pytest.mark.parametrize("one, other", [("line/T1", "LINE/t1"), (f"{COMPOSED}/1", f"{DECOMPOSED}/1")])
def test_raw_folders_that_are_the_same_on_some_file_system_are_an_error(tmp_path, one, other):
    ids, (error,) = table(tmp_path, f"T1\tmain\t{one}", f"T2\tmain\t{other}")
    assert ids == ["T1"] and "line 3, column 9" in error and "are one folder on some file systems" in error


@pytest.mark.parametrize(
    "row, place", [("aux\tmain\t", "column 1"), ("T1\tmain\tline/nul", "column 9"), ("T1\tmain\tline./t1", "column 9")]
)
def test_a_reserved_name_of_a_turnout_is_an_error(tmp_path, row, place):
    ids, (error,) = table(tmp_path, row)
    assert not ids and f"line 2, {place}" in error


@pytest.mark.parametrize(
    "labels, problem", [(("A7", "a7"), "differ only in capitals"), (("A7", "aux"), "Windows reserves")]
)
def test_labels_of_sections_are_valid_and_different_file_names(tmp_path, labels, problem):
    path = tmp_path / "layout.yaml"
    path.write_text("sections:\n" + "".join(f"  {label}: {{panel: CP}}\n" for label in labels))
    (error,) = check_consistency(load(path, "layout.yaml"))
    assert "layout.yaml, line 3, column 3" in str(error) and problem in str(error)


@pytest.mark.parametrize("folder", ["layouts", "overrides", "tracks", "vehicles"])
def test_files_of_the_configuration_differ_in_more_than_capitals(tmp_path, folder):
    (tmp_path / folder).mkdir()
    (tmp_path / "turnouts.tsv").write_text("turnout\tlayout\n")
    for name in ("Main.yaml", "main.yaml"):
        (tmp_path / folder / name).write_text("")
    with pytest.raises(ConfigErrors, match=f"{folder}/main.yaml.*are one file on some file systems"):
        load_configuration(tmp_path, None, None)
