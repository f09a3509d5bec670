"""Texts of SignalExpress, with labels above the values of the channels, and starts of single channels."""

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
FORCE, RAIL = np.random.default_rng(1).normal(size=(2, 400)).round(4)
ROWS = "".join(f"{f}\t{r}\n" for f, r in zip(FORCE, RAIL))
TIME = "05/13/2026 08:30:00.500"


def text_of(starts=(TIME, TIME), steps=("0.0002", "0.0002"), rows=ROWS, more=""):
    dt, start = "\t".join(steps), "\t".join(starts)
    return f"channel names:\nforce\trail\n{more}start times:\n{start}\ndt:\n{dt}\ndata:\n{rows}"


def read_text(tmp_path, text, **options):
    (tmp_path / "a.txt").write_text(text, "utf-8")
    return read("a.txt", tmp_path, RawDescription(CHANNELS, rate=5000.0, time_zone="Europe/Zurich"), **options)


@pytest.mark.parametrize("options", [{}, {"max_duration": 0.01, "max_whole_file_size": 0}])
@pytest.mark.parametrize(
    "text",
    [
        text_of(),
        "\ufeff" + text_of(more="units:\nN\tm/s^2\n"),
        text_of().replace("\n", "\r\n"),
        "\n".join(line + "\t" for line in text_of().splitlines()) + "\n",
        text_of(steps=("0,0002", "0,0002"), rows=ROWS.replace(".", ","), starts=["13.05.2026 08:30:00,500"] * 2),
    ],
    ids=["plain", "units", "crlf", "tabs", "comma"],
)
def test_labels_above_the_values_are_a_head(text, options, tmp_path):
    recording = read_text(tmp_path, text, **options).recordings[0]
    np.testing.assert_array_equal(recording.samples, [FORCE, RAIL])
    assert str(recording.started_at) == "2026-05-13 06:30:00.500000"


@pytest.mark.parametrize(
    ("text", "reason", "word"),
    [
        (text_of(steps=("0.0002", "0.0004")), "wrong_rate", "two rates"),
        (text_of(steps=("0.0001", "0.0001")), "wrong_rate", "10000 Hz instead of 5000 Hz"),
        (text_of(starts=(TIME, TIME.replace("00.500", "01.500"))), "clock_drift", "differ by 1 s"),
    ],
)
def test_a_head_that_contradicts_the_layout_or_itself_is_an_error(text, reason, word, tmp_path):
    result = read_text(tmp_path, text)
    assert not result.recordings and result.errors[0].reason == reason and word in result.errors[0].problem


@pytest.mark.parametrize("n", [16, 20, 27, 28, 40, 90])
def test_a_head_that_was_cut_off_is_an_error(n, tmp_path):
    with pytest.raises(ReadError):
        read_text(tmp_path, text_of()[:n])


def write_line(tmp_path, first, second):
    (tmp_path / "a.csv").write_text(f"Start\t{first}\t{second}\nforce\trail\n{ROWS}")
    return "a.csv"


def write_pairs(tmp_path, first, second):
    rows = "".join(f"{k / 5000:.4f}\t{f}\t{k / 5000:.4f}\t{r}\n" for k, (f, r) in enumerate(zip(FORCE, RAIL)))
    head = f"Time Stamp:\t{first}\t\t{second}\nDelta X:\t0.0002\t\t0.0002\nX_Value\tforce\tX_Value\trail\n"
    (tmp_path / "b.txt").write_text(head + rows)
    return "b.txt"


def write_comma(tmp_path, first, second):
    rows = ROWS.replace(".", ",")
    (tmp_path / "c.txt").write_text(f"t0\t{first},5\t{second},5\ndelta t\t0,0002\t0,0002\n\nforce\trail\n{rows}")
    return "c.txt"


def write_mat(tmp_path, first, second):
    structs = {
        name: {"data": x, "fs": 5000.0, "start_time": start}
        for name, x, start in (("force", FORCE, first), ("rail", RAIL, second))
    }
    scipy.io.savemat(tmp_path / "a.mat", structs)
    return "a.mat"


def write_hdf5(tmp_path, first, second):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, x, start in (("force", FORCE, first), ("rail", RAIL, second)):
            file[name] = x
            file[name].attrs.update(start_time=start, fs=5000.0)
    return "a.h5"


def write_list(tmp_path, first, second):
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["force"], file["rail"] = FORCE, RAIL
        file.attrs.update(start_times=[first, second], fs=5000.0)
    return "b.h5"


@pytest.mark.parametrize("writer", [write_line, write_pairs, write_comma, write_mat, write_hdf5, write_list])
@pytest.mark.parametrize("second", ["2026-05-13 08:30:00", "2026-05-13 08:30:02"])
def test_channels_that_began_at_different_times_are_no_record(writer, second, tmp_path):
    name = writer(tmp_path, "2026-05-13 08:30:00", second)
    result = read(name, tmp_path, RawDescription(CHANNELS, rate=5000.0))
    if second.endswith("00"):
        assert str(result.recordings[0].started_at)[:19] == "2026-05-13 08:30:00" and result.errors == ()
    else:
        assert not result.recordings and "clock_drift" in [error.reason for error in result.errors]


@pytest.mark.parametrize("writer", [write_line, write_mat, write_hdf5])
def test_a_channel_whose_clock_was_never_set_does_not_contradict_the_others(writer, tmp_path):
    name = writer(tmp_path, "2026-05-13 08:30:00", "1904-01-01 00:00:00")
    result = read(name, tmp_path, RawDescription(CHANNELS, rate=5000.0))
    assert str(result.recordings[0].started_at)[:19] == "2026-05-13 08:30:00"
