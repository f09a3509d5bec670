"""Units of the diagnosis of changes are computed again when the recorded maintenance of the turnout changes."""

from pathlib import Path

import pytest
import small_turnout as small

from turnout.config import load_configuration
from turnout.stages import change_units
from turnout.workflow.plan import write_plans


@pytest.fixture
def folder(tmp_path, repository, monkeypatch):
    small.write_configuration(tmp_path, repository)
    for day in ("2025-08-01", "2025-11-01"):
        for section in "AB":
            path = tmp_path / f"raw/t1/hammer/{day}/{section}_1.npz"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"only its name is read")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(change_units, "open_alarms", lambda registry: {"t1": ["A"]})
    return tmp_path


def note_with(table):
    """Note of the only unit if events.csv has this content."""
    Path("config/events.csv").write_text(table)
    configuration = load_configuration("config")
    write_plans(configuration, Path("raw"), Path("work/plan"), 1)
    (unit,) = change_units.alarmed_groups(Path("work/plan"), configuration)
    return unit.note


@pytest.mark.parametrize(
    ("header", "row", "changed"),
    [
        ("turnout,section,date,kind", "t1,,2025-09-01,tamping", "t1,,2025-09-01,grinding"),
        ("date,kind,section,turnout", "2025-09-01,tamping,,t1", "2025-09-01,grinding,,t1"),
        ('"turnout","section","date","kind"', '"t1","A","2025-09-01","tamping"', '"t1","B","2025-09-01","tamping"'),
        ("turnout,section,date,kind", " t1,,2025-09-01,tamping", " t1,,2025-09-02,tamping"),
    ],
)
def test_maintenance_in_a_table_of_any_form_is_part_of_the_unit(folder, header, row, changed):
    notes = [note_with("\n".join([header, *rows]) + "\n") for rows in ([], [row], [changed])]
    assert len(set(notes)) == 3


def test_maintenance_of_another_turnout_does_not_cause_a_new_computation(folder):
    header = "turnout,section,date,kind,resets,note\n"
    first = note_with(f"{header}t1,A,2025-09-01,tamping,,\n")
    assert note_with(f"{header}t2,,2025-09-01,tamping,,\nt1,A,2025-09-01,tamping,,by hand\n") == first
