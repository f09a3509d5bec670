"""A turnout with an error in its configuration waits; the others are computed, and its results stay as they were."""

import shutil

import pytest
import toy_fleet as toy

EVENTS = "turnout,section,date,kind\nT00001,A1,2024-02-01,tamping\nT00000,A1,2024-02-01,tamping\n"
ERRORS = {
    "an override": ("overrides/T00001.yaml", "sections:\n  A1: {position: x}\n"),
    "an id": ("turnouts.tsv", "turnout\tlayout\tline\nT00000\ttoy\tline 0\nT 00001\ttoy\tline 1\n"),
    "an event": ("events.csv", EVENTS.replace("T00001,A1,2024-02-01", "T00001,A1,1.2.2024")),
}


@pytest.fixture
def fleet(tmp_path):
    folder = toy.make(tmp_path, n_turnout=2)
    (folder / "config/events.csv").write_text(EVENTS)
    toy.run(folder)
    return folder


def of_turnout(rows, turnout):
    """Rows of the results and of the configuration, without those of the quarantine and of what replaces what."""
    tables = set(rows) - {"quarantine", "supersedes"}
    return {table: [row for row in rows[table] if any(turnout in str(cell) for cell in row)] for table in tables}


@pytest.mark.parametrize(("name", "text"), ERRORS.values(), ids=ERRORS)
def test_a_faulty_turnout_waits_and_has_the_right_rows_after_the_correction(fleet, tmp_path_factory, name, text):
    before = of_turnout(toy.rows(fleet), "T00001")
    assert len(before["events"]) == 1 and len(before["sections"]) == 2
    path = fleet / "config" / name
    valid = path.read_text() if path.exists() else None
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    if name != "events.csv":  # an event of it that is changed meanwhile waits, too, and does not stand beside the other
        (fleet / "config/events.csv").write_text(EVENTS.replace("02-01", "02-02"))
    for turnout in ("T00000", "T00001"):
        toy.add_raw(fleet, turnout, n_campaign=1, first=1)
    done = toy.run(fleet)
    assert name in done.stdout and "left out" in done.stdout
    rows = toy.rows(fleet)
    assert of_turnout(rows, "T00001") == before
    assert len(of_turnout(rows, "T00000")["recordings"]) == 4
    assert len(of_turnout(rows, "T00000")["events"]) == 1  # also if it is changed that night
    assert [row for row in rows["quarantine"] if "configuration_error" in row and f"config/{name}" in row]

    path.write_text(valid) if valid is not None else path.unlink()
    toy.run(fleet)
    other = shutil.copytree(fleet, tmp_path_factory.mktemp("other") / "fleet")
    toy.remove_outputs(other)
    toy.run(other)
    rows, undisturbed = toy.rows(fleet), toy.rows(other)
    for turnout in ("T00000", "T00001"):
        assert of_turnout(rows, turnout) == of_turnout(undisturbed, turnout)
