"""Starts whose date and time of day are two entries, and starts of files with several records."""

from datetime import UTC, datetime

import h5py
import nptdms
import numpy as np
import pytest
import soundfile

from turnout.readers import read
from turnout.readers.entries import Entry
from turnout.readers.source import RawRecord
from turnout.readers.split_starts import with_stated_starts
from turnout.records import RawChannel, RawDescription

FORCE = np.random.default_rng(6).normal(size=(3, 200)).round(4)
START = datetime(2026, 5, 13, 10, 0, 5)
HAMMER = RawDescription((RawChannel("force", "force", "force", unit="N"),), rate=1000.0)


def write_text(path, entries):
    rows = "\n".join(str(x) for x in FORCE[0])
    path.write_text("".join(f"{n};{v}\n" for n, v in entries.items()) + f"Rate;1000 Hz\nforce\n{rows}\n")


def write_hdf5(path, entries):
    with h5py.File(path, "w") as file:
        file["force"] = FORCE[0]
        file.attrs.update({"sampling_rate": 1000.0, **entries})


def write_tdms(path, entries):
    with nptdms.TdmsWriter(path) as file:
        channel = nptdms.ChannelObject("g", "force", FORCE[0], {"wf_increment": 0.001})
        file.write_segment([nptdms.RootObject(entries), nptdms.GroupObject("g", {}), channel])


def write_npz(path, entries):
    np.savez(path, force=FORCE[0], fs=1000.0, **entries)


FORMS = {"csv": write_text, "h5": write_hdf5, "tdms": write_tdms, "npz": write_npz}
PAIRS = [
    {"Date": "2026-05-13", "Time": "10:00:05"},
    {"Datum": "13.05.2026", "Uhrzeit": "10:00:05"},
    {"Start date": "2026-05-13", "Start time": "10:00:05"},
    {"start_time": "10:00:05", "start_date": "2026/05/13"},
    {"Date": "13 May 2026", "Time": "10:00:05"},
    {"Date": "05/13/2026", "Time": "10:00:05 AM"},
    {"Date": "2025-01-01", "Time": "08:00:00", "Recording date": "2026-05-13", "Recording time": "10:00:05"},
    {"Date": "2026-05-13", "Time": "10:00:05", "Calibration date": "2025-01-01", "Calibration time": "09:00:00"},
]


def starts(path, description=HAMMER):
    result = read(path.name, path.parent, description)
    remarks = [e for e in result.errors if e.reason in ("start_unknown", "clock_backwards")]
    return [r.started_at for r in result.recordings], remarks


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("entries", PAIRS, ids=lambda e: " ".join(e)[:40])
def test_a_date_and_a_time_of_day_in_two_entries_are_read_as_a_start(entries, form, tmp_path):
    FORMS[form](tmp_path / f"a.{form}", entries)
    assert starts(tmp_path / f"a.{form}") == ([START], [])


def test_date_and_time_of_day_in_the_comment_of_an_audio_file_are_read(tmp_path):
    with soundfile.SoundFile(tmp_path / "a.wav", "w", 1000, 1, "DOUBLE") as file:
        file.comment = '{"channels": ["force"], "units": ["N"], "Date": "2026-05-13", "Time": "10:00:05"}'
        file.write(FORCE[0] / 10)
    assert starts(tmp_path / "a.wav") == ([START], [])


@pytest.mark.parametrize("form", FORMS)
def test_a_pair_that_cannot_be_read_is_reported(form, tmp_path):
    FORMS[form](tmp_path / f"a.{form}", {"Date": "05/06/2026", "Time": "10:00"})
    (start,), (remark,) = starts(tmp_path / f"a.{form}")
    assert start is None and "05/06/2026 10:00:00: day or month first?" in remark.problem
    FORMS[form](tmp_path / f"b.{form}", {"Start date": "2026-05-13"})
    (start,), (remark,) = starts(tmp_path / f"b.{form}")
    assert start is None and "'2026-05-13' has no time of day" in remark.problem


@pytest.mark.parametrize("form", FORMS)
def test_a_zone_in_the_name_of_the_time_of_day_is_used_for_the_start(form, tmp_path):
    FORMS[form](tmp_path / f"a.{form}", {"Date": "2026-05-13", "Time (UTC+2)": "12:00:05"})
    assert starts(tmp_path / f"a.{form}") == ([START], [])


NAMES = ("Start Time", "start-time", "Recorded on", "Date/Time")
BEGINS = [f"2026-05-13T10:0{k}:05" for k in range(3)]


@pytest.mark.parametrize("name", NAMES)
def test_every_record_has_the_start_that_its_group_states(name, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k, begin in enumerate(BEGINS):
            file[f"impact_{k}/force"] = FORCE[k]
            file[f"impact_{k}"].attrs.update({"sampling_rate": 1000.0, name: begin})
    expected = [datetime.fromisoformat(b) for b in BEGINS]
    assert starts(tmp_path / "a.h5") == (expected, [])
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([nptdms.RootObject({"Date/Time": "2026-05-12T08:00:00"})])
        for k, begin in enumerate(BEGINS):
            group = nptdms.GroupObject(f"g{k}", {name: begin})
            file.write_segment([group, nptdms.ChannelObject(f"g{k}", "force", FORCE[k], {"wf_increment": 0.001})])
    assert starts(tmp_path / "a.tdms") == (expected, [])


@pytest.mark.parametrize("name", NAMES)
def test_a_start_of_the_file_is_used_for_all_its_records(name, tmp_path):
    rows = "".join(f"{k};{x}\n" for k in range(3) for x in FORCE[k])
    (tmp_path / "a.csv").write_text(f"{name};2026-05-13T10:00:05\nRate;1000 Hz\nrecord;force\n{rows}")
    assert starts(tmp_path / "a.csv") == ([START] * 3, [])


@pytest.mark.parametrize("name", ["Start Time", "start_time"])
def test_each_record_has_its_start_from_a_list_of_starts(name, tmp_path):
    np.savez(
        tmp_path / "a.npz", **{"samples": FORCE[:, None], "channels": ["force"], "fs": 1000.0, name: np.array(BEGINS)}
    )
    expected = [datetime.fromisoformat(b) for b in BEGINS]
    assert starts(tmp_path / "a.npz") == (expected, [])


def test_a_start_of_the_file_does_not_replace_a_missing_start_of_a_record(tmp_path):
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([nptdms.RootObject({"Recorded on": "2026-05-12T08:00:00"})])
        for k, begin in enumerate(BEGINS):
            stamp = {"wf_start_time": np.datetime64(begin)} if k != 1 else {}
            channel = nptdms.ChannelObject(f"g{k}", "force", FORCE[k], {"wf_increment": 0.001, **stamp})
            file.write_segment([nptdms.GroupObject(f"g{k}", {}), channel])
    found, remarks = starts(tmp_path / "a.tdms")
    expected = [datetime.fromisoformat(b).replace(tzinfo=UTC).replace(tzinfo=None) for b in BEGINS]
    assert found == [expected[0], None, expected[2]]
    assert [e.problem for e in remarks] == ["it lacks the start time that the other records have"]


def test_records_without_a_start_entry_are_not_copied():
    entry = Entry("the file", "Operator", "M. Jensen")
    records = [RawRecord(("force",), (row,), entries=(entry,)) for row in FORCE]
    assert all(out is record for out, record in zip(with_stated_starts(records), records, strict=True))


def test_the_start_of_an_unset_clock_stays_where_no_entry_states_another():
    """The format alone states it: it is reported later, and a record without it would lose that report."""
    record = RawRecord(("force",), (FORCE[0],), started_at=datetime(1904, 1, 1))
    assert with_stated_starts([record])[0].started_at == datetime(1904, 1, 1)
    later = RawRecord(
        ("force",), (FORCE[0],), (), (Entry("the file", "start", "2026-05-13 10:00:05"),), record.started_at
    )
    assert with_stated_starts([later])[0].started_at == START
