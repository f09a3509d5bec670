"""Files of the shared inputs whose rate or start was misread because of its position or its number of digits."""

import runpy
import shutil
from dataclasses import replace

import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
# Folder -> rate of its files, None where a file contradicts itself or has too few digits for a rate.
RATES = {
    "02_tdms_time_channel": dict.fromkeys(("time_channel", "sample_rate_words", "sampling_frequency_words"), 25600.0),
    "06_parquet_index": {
        **dict.fromkeys(("index_unnamed", "index_timestamp", "index_time", "column_datetime"), 25600.0),
        "gap_timestamp": None,
    },
    "14_csv_step_words": dict.fromkeys(
        "interval interval_us period increment samples_per_second sps ksps scan known".split(), 25600.0
    ),
    "34_uff_step_digits": {
        "g_10kHz": 10000.0, "g_25kHz": 25000.0, "g_12500": 12500.0, "g_16kHz": 16000.0, "full_10kHz": 10000.0,
        "e1_25kHz": None, "e1_20400": None,
    },
    "35_wav_comment": {"resampled": None, "no_rate": 25600.0},
}  # fmt: skip


@pytest.fixture
def make(shared_recordings, tmp_path, monkeypatch):
    """Function that creates the files of an input and returns their folder."""

    def run(name):
        shutil.copy(shared_recordings / "gen.py", tmp_path)
        shutil.copy(shared_recordings / "uff58.py", tmp_path)
        folder = tmp_path / name
        folder.mkdir()
        shutil.copy(shared_recordings / name / "make.py", folder)
        monkeypatch.chdir(folder)
        runpy.run_path(str(folder / "make.py"))
        return folder

    return run


@pytest.mark.parametrize("name", RATES)
def test_files_are_read_at_their_rate_and_rejected_at_another_rate(name, make):
    folder = make(name)
    for stem, rate in RATES[name].items():
        (path,) = folder.glob(f"{stem}.*")
        alone = read(path.name, folder, RawDescription(SENSORS))
        assert {r.rate for r in alone.recordings} == ({rate} if rate else set()), stem
        assert bool(alone.errors) == (rate is None), stem
        ignored = RawChannel("axis", "Time", "ignored")
        wrong = read(path.name, folder, RawDescription((*SENSORS, ignored), rate=20000.0))
        assert wrong.recordings == () and {e.reason for e in wrong.errors} <= {"wrong_rate", "truncated"}, stem


def test_start_times_of_a_clock_change_and_of_an_epoch_are_reported(make):
    folder = make("21_night_work")
    described = RawDescription(SENSORS, rate=20000.0, time_zone="Europe/Copenhagen")
    night = read("night.csv", folder, described)
    assert night.errors == () and f"{night.recordings[0].started_at:%d %H:%M}" == "12 22:30"
    assert read("slashes.csv", folder, described).recordings[0].started_at == night.recordings[0].started_at
    (error,) = read("gap_hour.csv", folder, described).errors
    assert error.reason == "start_unknown" and "does not exist" in error.problem
    folder = make("30_tdms_1904")
    result = read("relative.tdms", folder, replace(described, time_zone="UTC"))
    (error,) = result.errors
    assert error.where == "records 1 to 10" and "1904" in error.problem
    assert len(result.recordings) == 10 and {r.started_at for r in result.recordings} == {None}
