"""Forms of names, numbers, columns and starts that mean one thing are read, and forms that mean two are not."""

import unicodedata
from datetime import UTC, datetime, timedelta

import h5py
import numpy as np
import pandas as pd
import pytest
from nptdms import ChannelObject, TdmsWriter

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
N = 300
START = datetime(2026, 5, 13, 10, 0, 0, 250_000)
EPOCH = START.replace(tzinfo=UTC).timestamp()  # s
SAMPLES = np.random.default_rng(7).normal(size=(2, N)) * [[900.0], [30.0]]
SAMPLES = SAMPLES.round(4)
FORCE, RAIL = SAMPLES
SI = ("N", "m/s²")


def outcome(path, sources=("force", "rail"), units=(None, None), rate=RATE, further=()):
    """Samples and start of the only recording, and all messages."""
    channels = tuple(map(RawChannel, ("force", "rail"), sources, ("force", "acceleration"), units))
    channels += tuple(RawChannel(name, name, "ignored") for name in further)
    try:
        result = read(path.name, path.parent, RawDescription(channels, rate=rate))
    except ReadError as error:
        return None, None, str(error)
    recordings = result.recordings
    messages = "; ".join(map(str, result.errors))
    if len(recordings) != 1:
        return None, None, messages
    assert abs(recordings[0].rate / RATE - 1.0) < (1e-4 if rate is None else 1e-9)
    return recordings[0].samples, recordings[0].started_at, messages


def text_file(folder, head, columns, separator=";", forms=("{:.4f}",) * 9, change=lambda row: row, encoding="utf-8"):
    rows = [separator.join(form.format(x) for form, x in zip(forms, row)) for row in zip(*columns)]
    path = folder / "a.csv"
    path.write_bytes((head + "".join(f"{change(row)}\n" for row in rows)).encode(encoding))
    return path


def is_read(samples):
    if samples is None:
        return False
    np.testing.assert_allclose(samples, SAMPLES, rtol=0.0, atol=1e-3)
    return True


HEAD = "rate: 20000\nforce [N];rail [m/s²]\n"


@pytest.mark.parametrize("name", ["längs", "Längs", "LÄNGS", unicodedata.normalize("NFD", "längs"), "längs [m/s²]"])
def test_two_spellings_that_look_the_same_are_one_channel(tmp_path, name):
    head = HEAD.replace("rail", unicodedata.normalize("NFD", "längs"))
    assert is_read(outcome(text_file(tmp_path, head, SAMPLES), ("force", name))[0])
    frame = pd.DataFrame({"t [s]": np.arange(N) / RATE, "force [N]": FORCE, "längs [m/s²]": RAIL})
    frame.to_parquet(tmp_path / "a.parquet")
    assert is_read(outcome(tmp_path / "a.parquet", ("force", name))[0])


@pytest.mark.parametrize("format", ["parquet", "npz", "h5"])
def test_a_channel_may_be_named_without_its_unit_in_every_format(tmp_path, format):
    columns = {"t [ms]": 1e3 * np.arange(N) / RATE, "force [kN]": FORCE / 1e3, "rail (mm/s²)": 1e3 * RAIL}
    path = tmp_path / f"a.{format}"
    if format == "parquet":
        pd.DataFrame(columns).to_parquet(path)
    elif format == "npz":
        np.savez(path, **columns)
    else:
        with h5py.File(path, "w") as file:
            for name, column in columns.items():
                file[name.replace("/", "∕")] = column  # a slash would be a group
        columns = {}
    units = (None, None) if columns else (None, "mm/s²")
    assert is_read(outcome(path, units=units)[0])


def test_a_name_without_its_unit_that_two_channels_have_is_an_error(tmp_path):
    np.savez(tmp_path / "a.npz", **{"force [N]": FORCE, "rail [g]": RAIL, "rail [m/s²]": RAIL, "fs": RATE})
    samples, _, message = outcome(tmp_path / "a.npz")
    assert samples is None and "there is no channel 'rail'" in message
    assert is_read(outcome(tmp_path / "a.npz", ("force", "rail [m/s²]"), further=("rail [g]",))[0])


@pytest.mark.parametrize("gap", [" ", "  ", "        ", "\t"])
def test_a_line_of_units_in_brackets_between_blanks_has_a_unit_for_each_column(tmp_path, gap):
    head = gap.join(["Time", "force", "rail"]) + "\n" + gap.join(["[ms]", "[N]", "(m/s²)"]) + "\n"
    columns = (1e3 * np.arange(N) / RATE, *SAMPLES)
    assert is_read(outcome(text_file(tmp_path, head, columns, gap))[0])


NOTATIONS = {
    "minus sign": lambda row: row.replace("-", "\u2212"),
    "dash": lambda row: row.replace("-", "\u2013"),
    "kept blanks": lambda row: "\u00a0" + row.replace(";", "\u00a0;\u00a0") + "\u00a0",
    "quoted minus signs": lambda row: f'"{row}"'.replace(";", '";"').replace("-", "\u2212"),
}


@pytest.mark.parametrize("notation", NOTATIONS)
@pytest.mark.parametrize("separator", [";", "\t"])
def test_another_notation_of_a_number_is_read(tmp_path, notation, separator):
    head = HEAD.replace(";", separator)

    def change(row):
        return NOTATIONS[notation](row.replace(separator, ";")).replace(";", separator)

    assert is_read(outcome(text_file(tmp_path, head, SAMPLES, separator, change=change))[0])


@pytest.mark.parametrize("mark", ["D", "d"])
def test_an_exponent_of_fortran_is_read(tmp_path, mark):
    path = text_file(tmp_path, HEAD, SAMPLES, forms=("{:.8e}",) * 2, change=lambda row: row.replace("e", mark))
    assert is_read(outcome(path)[0])


@pytest.mark.parametrize("cell", ["1\u00a0234,5", "5\u20137", "±5", "1D2", "5-"])
def test_a_sign_within_a_number_is_an_error(tmp_path, cell):
    path = text_file(tmp_path, HEAD, SAMPLES)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:50], f"{cell};0,5\n", *lines[50:]]))
    samples, _, message = outcome(path)
    assert samples is None and "line 51" in message


@pytest.mark.parametrize("first", [0, 1])
def test_a_count_of_the_samples_needs_no_name(tmp_path, first):
    path = text_file(tmp_path, "rate: 20000\nNr.;force [N];rail [m/s²]\n", (first + np.arange(N), *SAMPLES))
    assert is_read(outcome(path)[0])


@pytest.mark.parametrize("column", [np.delete(np.arange(N + 1), 200), np.arange(N) % 100, 5 + np.arange(N), RAIL])
def test_any_other_column_needs_a_name(tmp_path, column):
    path = text_file(tmp_path, "rate: 20000\nfurther;force [N];rail [m/s²]\n", (column, *SAMPLES))
    samples, _, message = outcome(path)
    assert samples is None and "further" in message


def test_a_column_that_holds_titles_alone_is_no_channel(tmp_path):
    head = "rate: 20000\nName;force [N];rail [m/s²]\n"
    path = text_file(tmp_path, head, SAMPLES, change=lambda row: f";{row}")
    assert is_read(outcome(path)[0])
    samples, _, message = outcome(path, ("force", "Name"), units=(None, "m/s²"), further=("rail",))
    assert samples is None and "missing" in message


@pytest.mark.parametrize("name", ["unix_time", "epoch", "Zeitpunkt", "ts", "x"])
@pytest.mark.parametrize("unit", [1.0, 1e3, 1e6])
def test_an_axis_of_absolute_times_is_one_under_any_name(tmp_path, name, unit):
    stamps = np.rint(unit * EPOCH * 1e3) / 1e3 + unit * np.arange(N) / RATE
    path = text_file(tmp_path, f"{name};force [N];rail [m/s²]\n", (stamps, *SAMPLES), forms=("{:.6f}",) * 3)
    for further, rate in (((), RATE), ((name,), RATE), ((), None)):
        samples, start, message = outcome(path, further=further, rate=rate)
        assert is_read(samples) and abs(start.replace(tzinfo=None) - START) < timedelta(milliseconds=1), message
    assert "wrong" in outcome(path, rate=25600.0)[2] or "25600" in outcome(path, rate=25600.0)[2]


@pytest.mark.parametrize("start", [0.0, 12.5, 5e7, 4e12])
def test_an_even_rise_that_is_no_time_of_a_logger_needs_a_name(tmp_path, start):
    path = text_file(tmp_path, "x;force [N];rail [m/s²]\n", (start + np.arange(N) / RATE, *SAMPLES))
    samples, _, message = outcome(path)
    assert samples is None and "'x'" in message


ENTRIES = {
    "start_ms": 1e3 * EPOCH,
    "acquired_at": EPOCH,
    "trigger_at_us": int(1e6 * EPOCH),
    "mess_ns": int(1e9 * EPOCH),
    "measured_at": int(1e3 * EPOCH),
}
OTHER_NUMBERS = ("record_id", "measurement_number", "trigger_count", "messstelle", "recorder_serial", "start_sample")


@pytest.mark.parametrize("name", ENTRIES)
def test_a_large_number_under_the_name_of_a_moment_is_the_start(tmp_path, name):
    np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, fs=RATE, **{name: ENTRIES[name]})
    samples, start, _ = outcome(tmp_path / "a.npz", units=SI)
    assert is_read(samples) and abs(start.replace(tzinfo=None) - START) < timedelta(milliseconds=1)


@pytest.mark.parametrize("name", OTHER_NUMBERS)
def test_a_large_number_under_another_name_is_no_start(tmp_path, name):
    np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, fs=RATE, **{name: int(EPOCH)})
    samples, start, message = outcome(tmp_path / "a.npz", units=SI)
    assert is_read(samples) and start is None and "start time" not in message


@pytest.mark.parametrize("name", ["instant", "when", "moment"])
def test_a_time_stamp_under_an_unknown_name_is_reported(tmp_path, name):
    np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, fs=RATE, **{name: np.datetime64(START)})
    samples, start, message = outcome(tmp_path / "a.npz", units=SI)
    assert is_read(samples) and start is None and f"'{name}: 2026-05-13T10:00:00.250" in message
    np.savez(tmp_path / "b.npz", force=FORCE, rail=RAIL, fs=RATE, calibrated_on=np.datetime64(START))
    assert outcome(tmp_path / "b.npz", units=SI)[2] == ""


@pytest.mark.parametrize("name", ["start_time", "acquired", "t0", "when", "calibrated"])
@pytest.mark.parametrize(
    ("unit", "origin", "seconds"),
    [
        ("days", datetime(2000, 1, 1), 86400.0),
        ("seconds", datetime(2020, 1, 1), 1.0),
        ("ms", datetime(1970, 1, 1), 1e-3),
    ],
)
def test_a_unit_with_an_origin_belongs_to_the_number_beside_it(tmp_path, name, unit, origin, seconds):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"], file.attrs["fs"] = FORCE, RAIL, RATE
        file[name] = (START - origin).total_seconds() / seconds
        file[name].attrs["units"] = f"{unit} since {origin:%Y-%m-%d}"
    samples, start, message = outcome(tmp_path / "a.h5", units=SI)
    assert is_read(samples)
    if name in ("start_time", "acquired", "t0"):
        assert abs(start.replace(tzinfo=None) - START) < timedelta(milliseconds=1) and message == ""
    else:
        assert start is None and ("start time 'when [" in message) == (name == "when")


@pytest.mark.parametrize("offset", [0.0, 0.5, -0.125])
def test_a_waveform_begins_at_its_time_stamp_and_its_offset(tmp_path, offset):
    """As npTDMS itself computes absolute times."""
    waveform = {"wf_increment": 1.0 / RATE, "wf_start_time": np.datetime64(START), "wf_start_offset": offset}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject("g", name, x, {**waveform, "unit_string": unit})
                for name, x, unit in zip(("force", "rail"), SAMPLES, SI)
            ]
        )
    samples, start, _ = outcome(tmp_path / "a.tdms")
    assert is_read(samples) and start.replace(tzinfo=None) == START + timedelta(seconds=offset)
