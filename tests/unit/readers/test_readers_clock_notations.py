"""Times of samples in other notations: days of the year, weeks, ISO durations, fractions behind a colon."""

from datetime import datetime, timedelta

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.clock_texts import seconds_of_clock
from turnout.records import RawChannel, RawDescription

N = 120
START = datetime(2026, 11, 28, 7, 28, 14)
SAMPLES = np.random.default_rng(8).normal(size=(2, N)) * [[900.0], [30.0]]
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
DATED = {
    "day of the year": "%Y-%jT%H:%M:%S.%f", "day of the year, colons": "%Y:%j:%H:%M:%S.%f",
    "day of the year, digits": "%Y%j %H:%M:%S.%f", "week": "%G-W%V-%uT%H:%M:%S.%f", "month": "%d-%b-%Y %H:%M:%S.%f",
    "day and month": "%d %b %Y %H:%M:%S.%f", "digits": "%Y%m%dT%H%M%S.%f", "colon": "%Y-%m-%d %H:%M:%S:%f",
    "usual": "%d.%m.%Y %H:%M:%S,%f",
}  # fmt: skip
ELAPSED = {
    "duration": lambda s: f"PT{s:.6f}S", "long duration": lambda s: f"P0DT0H0M{s:.6f}S",
    "colon": lambda s: f"00:00:00:{1e6 * s:06.0f}", "ms and µs": lambda s: f"00:00:00:000.{1e6 * s:03.0f}",
    "days": lambda s: f"0.00:00:{s:09.6f}",
}  # fmt: skip


def write_csv(path, texts):
    rows = "\n".join(f"{text};{f:.12g};{a:.12g}" for text, (f, a) in zip(texts, SAMPLES.T))
    path.write_text(f"time;force;rail\n{rows}\n", encoding="utf-8")


def write_parquet(path, texts):
    pq.write_table(pa.table({"time": texts, "force": SAMPLES[0], "rail": SAMPLES[1]}), path)


def write_hdf5(path, texts):
    with h5py.File(path, "w") as file:
        file["time"], file["force"], file["rail"] = texts, *SAMPLES


def write_npz(path, texts):
    np.savez(path, time=np.array(texts), force=SAMPLES[0], rail=SAMPLES[1])


def write_tdms(path, texts):
    with nptdms.TdmsWriter(str(path)) as writer:
        channels = zip(("time", "force", "rail"), (texts, *SAMPLES))
        writer.write_segment([nptdms.ChannelObject("impact", name, values) for name, values in channels])


FORMATS = {"csv": write_csv, "parquet": write_parquet, "h5": write_hdf5, "npz": write_npz, "tdms": write_tdms}


def outcome(path, rate):
    result = read(path.name, path.parent, RawDescription(SENSORS, rate=rate))
    return result.errors[0].reason if result.errors else result.recordings[0].started_at


def texts_of(notation, step):
    if notation in DATED:
        return [(START + timedelta(microseconds=step * k)).strftime(DATED[notation]) for k in range(N)]
    return [ELAPSED[notation.removeprefix("elapsed ")](1e-6 * step * k) for k in range(N)]


@pytest.mark.parametrize("notation", [*DATED, *(f"elapsed {name}" for name in ELAPSED)])
@pytest.mark.parametrize("format", FORMATS)
def test_each_notation_gives_rate_and_start_in_every_format(notation, format, tmp_path):
    path, step = tmp_path / f"a.{format}", 8 if "µs" in notation else 50
    FORMATS[format](path, texts_of(notation, step))
    assert outcome(path, 1e6 / step) == (START if notation in DATED else None)
    assert outcome(path, 25600.0) == "wrong_rate"


@pytest.mark.parametrize("separator", [";", " "])
@pytest.mark.parametrize("day", ["%Y-%j", "%d-%b-%Y", "%G-W%V-%u", "%d.%m.%Y"])
@pytest.mark.parametrize("start", [START, datetime(2025, 12, 31, 23, 59, 59, 999000)])
def test_a_column_of_days_can_have_any_notation(day, separator, start, tmp_path):
    stamps = [start + timedelta(microseconds=50 * k) for k in range(N)]
    cells = [[stamp.strftime(day), stamp.strftime("%H:%M:%S.%f")] for stamp in stamps]
    rows = [[*cell, f"{f:.9g}", f"{a:.9g}"] for cell, (f, a) in zip(cells, SAMPLES.T)]
    lines = [separator.join(row) for row in (["day", "time", "force", "rail"], *rows)]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert outcome(tmp_path / "a.csv", 2e4) == start
    assert outcome(tmp_path / "a.csv", 25600.0) == "wrong_rate"


@pytest.mark.parametrize("format", ["parquet", "h5", "npz", "tdms"])
def test_times_in_an_unknown_notation_are_an_error(format, tmp_path):
    """Otherwise the rate of the layout would be used although the file states one."""
    path = tmp_path / f"a.{format}"
    FORMATS[format](path, [f"07h28m14.{50 * k:06d}" for k in range(N)])
    try:
        error = read(path.name, tmp_path, RawDescription(SENSORS, rate=2e4)).errors[0]
    except ReadError as caught:
        error = caught
    assert "'time': it holds '07h28m14.000000', and so no known times" in str(error)


@pytest.mark.parametrize("name", ["time", "start_time"])
@pytest.mark.parametrize("notation", ["%Y-%m-%dT%H:%M:%S", "%d %b %Y %H:%M"])
def test_one_text_per_record_is_not_read_as_the_times_of_samples(name, notation, tmp_path):
    starts = [datetime(2026, 11, 28, 7) + timedelta(minutes=k) for k in range(70)]
    texts = np.array([start.strftime(notation) for start in starts])
    np.savez(tmp_path / "a.npz", data=np.random.default_rng(3).normal(size=(70, 2, N)), **{name: texts})
    sensors = (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", unit="m/s²"))
    result = read("a.npz", tmp_path, RawDescription(sensors, rate=2e4))
    assert [r.started_at for r in result.recordings] == (starts if name == "start_time" else [None] * 70)
    assert result.errors == ()


@pytest.mark.parametrize("format", ["parquet", "tdms"])
def test_a_start_that_is_repeated_in_every_row_is_the_start(format, tmp_path):
    FORMATS[format](tmp_path / f"a.{format}", [f"{START:%Y-%m-%d %H:%M:%S}"] * N)
    assert outcome(tmp_path / f"a.{format}", 2e4) == START


def test_records_of_parquet_start_at_their_first_time(tmp_path):
    table = pa.table(
        {"time": texts_of("usual", 50), "record": [1] * 40 + [2] * 80, "force": SAMPLES[0], "rail": SAMPLES[1]}
    )
    pq.write_table(table, tmp_path / "a.parquet")
    recordings = read("a.parquet", tmp_path, RawDescription(SENSORS, rate=2e4)).recordings
    assert [r.started_at for r in recordings] == [START, START + timedelta(microseconds=2000)]


TEXTS = {  # first text, last text, seconds between them
    "midnight": ("23:59:59.5", "00:00:00.5", 1.0),
    "midnight with dates": ("31.12.2026 23:59:59", "01.01.2027 00:00:01", 2.0),
    "noon": ("11:59:59.5 AM", "12:00:00.0 PM", 0.5), "after noon": ("12:59:59 PM", "01:00:00 PM", 1.0),
    "zone": ("2026-10-25T02:59:59+02:00", "2026-10-25T02:00:00+01:00", 1.0),
    "minute 60": ("10:00:00", "10:60:00", np.nan), "hour 13 PM": ("13:00:00 PM", "13:00:01 PM", np.nan),
    "second 60": ("23:59:60.0", "23:59:60.5", 0.5), "hours of a count": ("25:00:00", "25:00:01", 1.0),
    "day of the year": ("2024-366T23:59:59", "2025-001T00:00:00", 1.0),
    "no such day": ("2024-366T23:59:59", "2025-366T00:00:00", np.nan),
    "second 61": ("10:00:61", "10:00:62", np.nan),
    "hour 24 of a date": ("1.5.2026 24:00:00", "1.5.2026 24:00:01", np.nan),
    "days that are counted": ("1.23:59:59.5", "1.00:00:00.5", -86399.0),
    "no padding": ("10:00:00:950", "10:00:00:100000", np.nan),
    "duration": ("PT59.5S", "PT1M0.5S", 1.0), "days": ("P1DT23H59M59S", "P2DT0H0M1S", 2.0),
}  # fmt: skip


@pytest.mark.parametrize("first, last, seconds", TEXTS.values(), ids=TEXTS)
def test_times_of_equal_and_of_mixed_forms_are_read_in_the_same_way(first, last, seconds):
    for texts in ([first, last], [first, last, f"{last} "]):  # the blank gives it another form
        assert seconds_of_clock(texts)[1] == pytest.approx(seconds, nan_ok=True)


@pytest.mark.parametrize(
    ("unit", "scale"), [("sec", 1.0), ("s", 1.0), ("ms", 1e3), ("µs", 1e6), ("min", 1 / 60), ("hr", 1 / 3600)]
)
def test_a_time_with_its_unit_in_each_cell_is_a_duration(unit, scale, tmp_path):
    """As MATLAB writes those of a timetable."""
    samples = np.random.default_rng(1).normal(size=200).round(4)
    rows = "".join(f"{k / 2e4 * scale:.13g} {unit},{x}\n" for k, x in enumerate(samples))
    (tmp_path / "a.csv").write_text("Time,rail\n" + rows, "utf-8")
    channels = (RawChannel("rail", "rail", "acceleration", "m/s²"),)
    (recording,) = read("a.csv", tmp_path, RawDescription(channels, rate=2e4, kind="passage")).recordings
    np.testing.assert_array_equal(recording.samples, [samples])
    (error,) = read("a.csv", tmp_path, RawDescription(channels, rate=1e4, kind="passage")).errors
    assert error.reason == "wrong_rate"
