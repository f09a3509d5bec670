"""Starts under the name t0, as date vectors of MATLAB, and in the notations of several programs, in all formats."""

from datetime import datetime

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import soundfile
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from turnout.readers import read
from turnout.readers.time_texts import parse_time, time_of_vector
from turnout.records import RawChannel, RawDescription

LAYOUT = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
    rate=20000.0,
)
NOISE = np.random.default_rng(0).normal(size=(2, 128)).round(4)
SIGNALS = dict(zip(("force", "rail"), NOISE))
START = datetime(2026, 5, 13, 8, 30, 12, 250000)
VECTOR = [2026, 5, 13, 8, 30, 12.25]
MATLAB_DAYS = 740115 + (8 * 3600 + 30 * 60 + 12.25) / 86400  # datenum(2026, 5, 13) = 740115
SECONDS = 1778661012.25  # since 1970


def write_csv(path, name, value):
    rows = "".join(f"{f};{a}\n" for f, a in NOISE.T)
    path.with_suffix(".csv").write_text(f"fs: 20000\n{name}: {value}\nforce;rail\n{rows}", encoding="utf-8")


def write_mat(path, name, value):
    scipy.io.savemat(path.with_suffix(".mat"), {**SIGNALS, "fs": 20000.0, name: value})


def write_npz(path, name, value):
    np.savez(path.with_suffix(".npz"), **SIGNALS, fs=20000.0, **{name: value})


def write_hdf5(path, name, value):
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for channel, samples in SIGNALS.items():
            file[channel] = samples
        file.attrs.update({"fs": 20000.0, name: value})


def write_tdms(path, name, value):
    steps = {"wf_increment": 5e-5}
    channels = [ChannelObject("G", channel, samples, steps) for channel, samples in SIGNALS.items()]
    with TdmsWriter(str(path.with_suffix(".tdms"))) as writer:
        writer.write_segment([RootObject(), GroupObject("G", {name: value}), *channels])


def write_parquet(path, name, value):
    table = pa.table(SIGNALS).replace_schema_metadata({"fs": "20000", name: str(value)})
    pq.write_table(table, path.with_suffix(".parquet"))


WRITERS = (write_csv, write_mat, write_npz, write_hdf5, write_tdms, write_parquet)


def start_of(write, name, value, folder):
    write(folder / "a", name, value)
    (file,) = folder.iterdir()
    (recording,) = (result := read(file.name, folder, LAYOUT)).recordings
    np.testing.assert_allclose(recording.read(0, 128), NOISE, atol=1e-12)
    return recording.started_at, result.errors


def is_near(start):
    return start is not None and abs((start - START).total_seconds()) < 1e-3


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("value", ["2026-05-13T08:30:12.250", "13.05.2026 08:30:12,250", SECONDS, MATLAB_DAYS])
@pytest.mark.parametrize("name", ["t0", "T0"])
def test_t0_is_the_start_if_it_is_a_time(write, value, name, tmp_path):
    start, errors = start_of(write, name, value, tmp_path)
    assert is_near(start)
    assert not errors


@pytest.mark.parametrize("write", WRITERS)
def test_t0_of_0_is_no_start(write, tmp_path):
    assert start_of(write, "t0", 0.0, tmp_path) == (None, ())


@pytest.mark.parametrize("write", [write_csv, write_mat, write_npz, write_hdf5])
@pytest.mark.parametrize("name", ["start_time", "t0", "Recorded"])
def test_a_date_vector_is_a_start(write, name, tmp_path):
    """Formerly, the year alone was taken, or nothing."""
    start, errors = start_of(write, name, VECTOR, tmp_path)
    assert is_near(start)
    assert not errors


@pytest.mark.parametrize("write", [write_mat, write_npz, write_hdf5])
def test_a_date_vector_under_another_name_is_reported(write, tmp_path):
    start, errors = start_of(write, "clock", VECTOR, tmp_path)
    assert start is None
    assert [error.reason for error in errors] == ["start_unknown"]


@pytest.mark.parametrize(
    "value", [[2026, 13, 5, 8, 30, 12], [2026, 5, 13, 8, 30, 75], [1.5, 2, 3, 4, 5, 6], [2026, 5.5, 13, 8, 30, 12]]
)
def test_six_numbers_that_are_no_time_are_no_start(value, tmp_path):
    start, _ = start_of(write_npz, "start_time", value, tmp_path)
    assert start is None


@pytest.mark.parametrize(
    "line",
    [
        "Start: 2026.05.13 08:30:12:250",
        "Start: 2026-05-13 08:30:12:250000",
        "Start: [2026 5 13 8 30 12.25]",
        "StartTime,2026,5,13,8,30,12.25",
        "Started 13 May 2026 08:30:12:250",
        "Start: Wed, 13 May 2026 08:30:12.250 +0000",
    ],
)
def test_notations_of_a_line(line, tmp_path):
    rows = "".join(f"{f};{a}\n" for f, a in NOISE.T)
    (tmp_path / "a.csv").write_text(f"{line}\nfs: 20000\nforce;rail\n{rows}")
    (recording,) = read("a.csv", tmp_path, LAYOUT).recordings
    assert is_near(recording.started_at)


@pytest.mark.parametrize(
    "text",
    [
        "May 13, 2026 08:30:12.250",
        "May 13 2026 08:30:12.250",
        "May 13th, 2026 08:30:12.250",
        "Wed, May 13, 2026 08:30:12.250",
        "Mi, 13.05.2026 08:30:12,250",
        "onsdag 13.05.2026 08:30:12.250",
        "mer. 13/05/2026 08:30:12.250",
    ],
)
def test_the_month_or_a_weekday_may_come_first(text, tmp_path):
    """Formerly, a month in front was left out as if it were a weekday."""
    start, errors = start_of(write_csv, "Start", text, tmp_path)
    assert is_near(start)
    assert not errors


@pytest.mark.parametrize("word", ["PST", "CET", "before", "end"])
def test_a_word_before_a_date_that_is_no_weekday_is_not_left_out(word):
    """The zone would be lost, or the start be that of something else."""
    assert parse_time(f"{word} 2026-05-13 08:30:12") is None


@pytest.mark.parametrize(
    "value", [[[1, 2], [3]], [1, 2, 3, 4, 5, [6, 7]], [2026, np.nan, 1, 1, 1, 1], [2026, np.inf, 1, 1, 1, 1], []]
)
def test_a_list_that_is_no_date_vector_is_no_error(value):
    assert time_of_vector(value) is None


@pytest.mark.parametrize(
    "text", ["13 mai 2026 à 08h30", "13.05.2026 08h30", "13/05/2026 à 8 h 30", "13. Mai 2026 um 08:30 Uhr"]
)
def test_hours_and_minutes(text, tmp_path):
    start, errors = start_of(write_csv, "Start", text, tmp_path)
    assert (start, errors) == (START.replace(second=0, microsecond=0), ())


def test_a_time_stamp_without_a_name_is_reported(tmp_path):
    rows = "".join(f"{f};{a}\n" for f, a in NOISE.T)
    (tmp_path / "a.csv").write_text(f"# Wed May 13 08:30:12 2026\nfs: 20000\nforce;rail\n{rows}")
    result = read("a.csv", tmp_path, LAYOUT)
    assert [error.reason for error in result.errors] == ["start_unknown"]
    assert "Wed May 13 08:30:12 2026" in str(result.errors[0])


CLOCKS = [f"08:30:12.{250000 + 50 * k:06d}" for k in range(128)]


@pytest.mark.parametrize(
    ("head", "clocks", "start"),
    [
        ("Date;13.05.2026", CLOCKS, START),
        ("Datum: 2026-05-13", CLOCKS, START),
        ("Calibration date: 2026-01-02", CLOCKS, None),
        ("Date;13.05.2026", [f"00:00:00.{50 * k:06d}" for k in range(128)], None),  # counts from the beginning
    ],
)
def test_the_day_in_the_head_and_the_time_of_day_of_the_first_row_are_the_start(head, clocks, start, tmp_path):
    rows = "".join(f"{clock};{f};{a}\n" for clock, (f, a) in zip(clocks, NOISE.T))
    (tmp_path / "a.csv").write_text(f"{head}\nTime;force;rail\n{rows}")
    result = read("a.csv", tmp_path, LAYOUT)
    assert (result.recordings[0].started_at, result.errors) == (start, ())


def test_the_day_in_the_metadata_and_the_time_of_day_in_a_column_of_text(tmp_path):
    table = pa.table({"Time": CLOCKS, **SIGNALS}).replace_schema_metadata({"Date": "2026-05-13"})
    pq.write_table(table, tmp_path / "a.parquet")
    assert read("a.parquet", tmp_path, LAYOUT).recordings[0].started_at == START


@pytest.mark.parametrize(("text", "start"), [("2026-05-13T08:30:12.250", START), ("2026-05-13", None)])
def test_the_creation_date_of_an_audio_file_is_its_start(text, start, tmp_path):
    path = tmp_path / "a.wav"
    with soundfile.SoundFile(path, "w", 20000, 2, subtype="FLOAT") as file:
        file.date = text
        file.write(NOISE.T)
    channels = tuple(RawChannel(c.name, k, c.quantity, unit=c.unit) for k, c in enumerate(LAYOUT.channels))
    result = read("a.wav", tmp_path, RawDescription(channels, rate=20000.0))
    assert (result.recordings[0].started_at, result.errors) == (start, ())


@pytest.mark.parametrize("write", [write_mat, write_npz, write_hdf5, write_tdms])
def test_an_entry_that_is_called_by_a_level_alone_is_reported(write, tmp_path):
    _, errors = start_of(write, "dB", 20.0, tmp_path)
    assert [error.reason for error in errors] == ["entry_unknown"]
    assert "scale" in str(errors[0])


@pytest.mark.parametrize("write", [write_mat, write_npz, write_hdf5, write_tdms])
def test_a_level_of_0_changes_nothing(write, tmp_path):
    assert start_of(write, "dB", 0.0, tmp_path) == (None, ())


@pytest.mark.parametrize("n_part", [6, 5])
def test_six_entries_with_the_parts_of_a_date_are_a_start(n_part, tmp_path):
    parts = dict(zip(["year", "month", "day", "hour", "minute", "second"][:n_part], VECTOR))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for channel, samples in SIGNALS.items():
            file[channel] = samples
        file.attrs.update({"fs": 20000.0, **parts})
    (recording,) = read("a.h5", tmp_path, LAYOUT).recordings
    assert recording.started_at == (START if n_part == 6 else None)
