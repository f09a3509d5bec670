"""A stored visit is of other versions if its recordings or the notes beside them are others; else it stays."""

import shutil

import pytest
import small_turnout as small

from turnout.config import load_configuration, with_raw
from turnout.stages.mismatch_groups import visits
from turnout.stages.visit_versions import by_content, version_by_files, version_of
from turnout.workflow.scan import scan

VISITS = ("2025-08-01", "2025-11-01")
TRAINS = "passed_at_utc,train_type,speed_kmh,axle_load_t\n"
CAMPAIGNS = "campaign,started_at_utc,rail_temperature_c\n"


@pytest.fixture
def folder(tmp_path, repository):
    """Two visits, each with a test and a train. No recording is read, so any bytes will do."""
    small.write_configuration(tmp_path, repository)
    raw = tmp_path / "raw" / "t1"
    for day in VISITS:
        for path in (f"hammer/{day}/A_1.h5", f"passages/{day.replace('-', '')}T100000Z.h5"):
            (raw / path).parent.mkdir(parents=True, exist_ok=True)
            (raw / path).write_text(path)
    (raw / "trains.csv").write_text(f"{TRAINS}2025-08-01T10:00,locomotive,90,20\n2025-11-01T10:00,locomotive,90,20\n")
    return tmp_path


def versions(folder, of=by_content):
    turnout = with_raw(load_configuration(folder / "config").turnout("t1"), folder / "raw")
    units = visits(scan(turnout, folder / "raw").units, [])
    assert set(units) == set(VISITS)
    return of({visit: version_of(members, turnout, folder / "raw", None, "1") for visit, members in units.items()})


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("trains.csv", f"{TRAINS}2025-08-01T10:00,locomotive,90,20\n2025-11-01T10:00,coach,90,20\n"),
        ("trains.csv", f"{TRAINS}2025-08-01T10:00,locomotive,90,20\n2025-11-01T10:00,locomotive,90,12\n"),
        ("trains.csv", f"{TRAINS}2025-08-01T10:00,locomotive,90,20\n"),
        ("campaigns.csv", f"{CAMPAIGNS}2025-11-01,2025-11-01T09:00,-4\n"),
    ],
)
def test_corrected_notes_change_the_version_of_their_visit_alone(folder, name, text):
    """Otherwise the calibrated model stated "0 passages used" after the type of their train had been entered."""
    before = versions(folder)
    (folder / "raw" / "t1" / name).write_text(text)
    after = versions(folder)
    assert after[VISITS[0]] == before[VISITS[0]] and after[VISITS[1]] != before[VISITS[1]]
    assert {k for k, v in after[VISITS[1]].items() if v != before[VISITS[1]][k]} == {"notes"}


def test_the_order_of_rows_and_a_copied_folder_change_nothing(folder, tmp_path):
    before = versions(folder)
    lines = (folder / "raw" / "t1" / "trains.csv").read_text().splitlines()
    (folder / "raw" / "t1" / "trains.csv").write_text("\n".join([lines[0], *reversed(lines[1:])]))
    shutil.copytree(folder / "raw", tmp_path / "copied", copy_function=shutil.copyfile)
    shutil.rmtree(folder / "raw")
    (tmp_path / "copied").rename(folder / "raw")
    assert versions(folder) == before


def test_a_copy_of_a_recording_changes_nothing(folder):
    """Neither under the name of a passage of another time, which has another row of trains.csv."""
    path = folder / "raw" / "t1" / "trains.csv"
    path.write_text(f"{path.read_text()}2025-11-06T10:00,coach,90,20\n")
    before = versions(folder)
    passages = folder / "raw" / "t1" / "passages"
    shutil.copyfile(passages / "20251101T100000Z.h5", passages / "20251106T100000Z.h5")
    assert versions(folder) == before


def test_without_reading_recordings_the_same_versions_are_known(folder):
    turnout = with_raw(load_configuration(folder / "config").turnout("t1"), folder / "raw")
    whole = versions(folder, of=dict)
    for visit, members in visits(scan(turnout, folder / "raw").units, []).items():
        expected = {k: v for k, v in whole[visit].items() if k != "recordings"}
        assert version_by_files(members, turnout, None, "1") == expected
