"""Columns that number records under any name, in blocks or by a counter that begins again, and columns that do not."""

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 25600.0
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
LENGTHS = (600, 580, 590)
N = sum(LENGTHS)
FORCE, RAIL = np.random.default_rng(11).normal(size=(2, N)) * [[900.0], [30.0]]


def write_file(path, name, column, unit=""):
    columns = {"force": FORCE[: len(column)], "rail": RAIL[: len(column)], name: column}
    format = path.suffix[1:]
    if format == "csv":
        head = ";".join(f"{n} [{unit}]" if n == name and unit else n for n in columns)
        rows = "".join(f"{f:.6g};{a:.6g};{x:.9g}\n" for f, a, x in zip(*columns.values()))
        path.write_text(f"{head}\n{rows}", encoding="utf-8")
    elif format == "parquet":
        pq.write_table(pa.table(columns), path)
    elif format == "npz":
        np.savez(path, **columns)
    elif format == "mat":
        scipy.io.savemat(path, columns)
    elif format == "h5":
        with h5py.File(path, "w") as file:
            for n, x in columns.items():
                file[n] = x
    else:
        with nptdms.TdmsWriter(str(path)) as writer:
            writer.write_segment([nptdms.ChannelObject("g", n, x) for n, x in columns.items()])


def outcome(path, name, column, unit="", layout_unit=None, checked=()):
    """Numbers of samples of the records, and reasons of the errors."""
    write_file(path, name, column, unit)
    channels = (*SENSORS, RawChannel("x", name, "ignored", unit=layout_unit))
    result = read(path.name, path.parent, RawDescription(channels, rate=RATE, checked_entries=checked))
    return [r.n_sample for r in result.recordings], [e.reason for e in result.errors], [*map(str, result.errors)]


@pytest.mark.parametrize("format", ["csv", "parquet", "npz", "mat", "h5", "tdms"])
@pytest.mark.parametrize("numbers", [(1, 2, 3), (0, 1, 2), (3, 2, 1)])
def test_a_column_that_counts_in_blocks_is_an_error_under_any_name(format, numbers, tmp_path):
    column = np.repeat(numbers, LENGTHS).astype(float)
    lengths, reasons, messages = outcome(tmp_path / f"a.{format}", "qwxz", column)
    assert (lengths, reasons) == ([], ["wrong_length"])
    assert "'qwxz' changes 2 times" in messages[0] and "checked_entries: qwxz" in messages[0]


@pytest.mark.parametrize("format", ["csv", "parquet", "npz", "h5", "tdms"])
@pytest.mark.parametrize("first", [0.0, 1.0])
@pytest.mark.parametrize("step", [1.0, 1e3 / RATE])
def test_a_count_or_an_axis_that_begins_again_is_reported_under_any_name(format, first, step, tmp_path):
    column = np.concatenate([first + step * np.arange(n) for n in LENGTHS])
    lengths, reasons, messages = outcome(tmp_path / f"a.{format}", "qwxz", column)
    assert (lengths, reasons) == ([], ["wrong_length"]) and "'qwxz' begins again 2 times" in messages[0]


@pytest.mark.parametrize("name", ["Impact No", "Hit #", "record"])
def test_a_column_that_says_number_divides_blocks_of_any_length(name, tmp_path):
    write_file(tmp_path / "a.csv", name, np.repeat([1, 2, 3], LENGTHS))
    result = read("a.csv", tmp_path, RawDescription(SENSORS, rate=RATE))
    assert [r.n_sample for r in result.recordings] == [*LENGTHS] and not result.errors
    assert np.allclose(result.recordings[1].signal("force"), FORCE[600:1180], rtol=1e-5, atol=0.0)


FLAGS = {
    "trigger": np.repeat([0, 1], [200, N - 200]), "pulse": np.repeat([0, 1, 0], [200, 40, N - 240]),
    "state of 5 V": np.repeat([0, 5], [200, N - 200]), "square wave": np.arange(N) // 64 % 2, "constant": np.full(N, 7),
    "noise": np.rint(FORCE), "one byte": np.arange(N) % 256, "count": np.arange(N), "bits": np.arange(N) % 4,
    "fast states": np.arange(N) // 8, "seconds since 1970": 1_715_609_130 + np.arange(N) // int(RATE / 64) // 64,
    "late state": np.repeat([3, 4], [N - 1, 1])[::-1],
}  # fmt: skip


@pytest.mark.parametrize("format", ["csv", "npz"])
@pytest.mark.parametrize("name", FLAGS)
def test_a_flag_or_a_counter_does_not_cost_a_record(format, name, tmp_path):
    assert outcome(tmp_path / f"a.{format}", "qwxz", FLAGS[name])[:2] == ([N], [])


AMBIGUOUS = {
    "numbers from 7 on, or degrees": np.repeat([7, 8, 9], LENGTHS), "falling": np.repeat([9, 8, 7], LENGTHS),
    "numbers in wide steps": np.repeat([101, 214, 388], LENGTHS),
    "0 and 1 in like parts": np.repeat([0, 1], [900, N - 900]), "counts to 1000": 1 + np.arange(N) % 1000,
    "two sections": np.repeat([1, 2, 1, 2], [400, 450, 460, 460]),
    "held values": np.repeat([21, 25, 22, 24, 20], N // 5),
}  # fmt: skip


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_a_form_that_leaves_it_open_is_a_remark(name, tmp_path):
    lengths, reasons, _ = outcome(tmp_path / "a.csv", "qwxz", AMBIGUOUS[name])
    assert (lengths, reasons) == ([len(AMBIGUOUS[name])], ["entry_unknown"])


def test_the_layout_or_a_unit_can_say_that_a_column_numbers_nothing(tmp_path):
    column = np.repeat([20, 21, 22], LENGTHS)
    assert outcome(tmp_path / "a.csv", "qwxz", column)[1] == ["entry_unknown"]
    assert outcome(tmp_path / "a.csv", "qwxz", column, unit="°C")[:2] == ([N], [])
    assert outcome(tmp_path / "a.csv", "qwxz", column, layout_unit="°C")[:2] == ([N], [])
    assert outcome(tmp_path / "a.csv", "qwxz", column, checked=("QWXZ",))[:2] == ([N], [])


def test_whole_seconds_of_a_clock_are_no_numbers_of_records(tmp_path):
    """At 500 Hz each second has 500 samples, and the first and the last one fewer: that is a remark only."""
    seconds = (np.arange(N) + 130) // 500
    write_file(tmp_path / "a.csv", "qwxz", seconds)
    channels = (*SENSORS, RawChannel("x", "qwxz", "ignored"))
    result = read("a.csv", tmp_path, RawDescription(channels, rate=500.0))
    assert len(result.recordings) == 1 and [e.reason for e in result.errors] == ["entry_unknown"]
    result = read("a.csv", tmp_path, RawDescription(channels, rate=2000.0))
    assert not result.recordings and [e.reason for e in result.errors] == ["wrong_length"]


def test_a_vector_beside_a_matrix_that_numbers_the_records_is_reported(tmp_path):
    matrix = np.array([FORCE, RAIL])
    for vector, n_record in ((np.repeat([1, 2, 3], LENGTHS), 0), (np.zeros(N, dtype=int), 1)):
        np.savez(tmp_path / "a.npz", data=matrix, channels=["force", "rail"], fs=RATE, qwxz=vector)
        result = read("a.npz", tmp_path, RawDescription(SENSORS, rate=RATE))
        assert len(result.recordings) == n_record and len(result.errors) == 1 - n_record
        assert n_record or "'qwxz' changes 2 times" in str(result.errors[0])


@pytest.mark.parametrize("format", ["parquet", "npz"])
def test_texts_that_change_in_blocks_are_reported_and_flags_are_not(format, tmp_path):
    for texts, n_record in (
        (("qw 1", "qw 2", "qw 3"), 0),
        (("off", "on", "off"), 1),
        (("qw", "qw", "qw"), 1),
    ):
        write_file(tmp_path / f"a.{format}", "qwxz", np.repeat(texts, LENGTHS))
        result = read(f"a.{format}", tmp_path, RawDescription(SENSORS, rate=RATE))
        assert len(result.recordings) == n_record and len(result.errors) == 1 - n_record
        assert n_record or "'qwxz' changes 2 times, from 0 to 2" in str(result.errors[0])
