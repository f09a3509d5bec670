"""Samples that were lost without a mark: codes, gaps of a counter, unwritten chunks, masks, compressed files.

Each case is read correctly or rejected with its place; a measured value of the same form is read.
"""

import bz2
import gzip
import io
import lzma
import tarfile
import zipfile

import h5py
import numpy as np
import pyarrow as pa
import pytest
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet

from turnout.errors import ReadError
from turnout.readers import read, read_unconverted
from turnout.readers.interpret import errors_without_layout
from turnout.readers.missing_codes import count_alone, missing_code
from turnout.records import RawChannel, RawDescription

N = 3000
FORCE = np.random.default_rng(5).normal(0.0, 1.0, N)
FORCE[600:630] += 4000.0 * np.sin(np.pi * np.arange(30) / 30) ** 2
RAIL = np.random.default_rng(6).normal(0.0, 20.0, N)
CHANNELS = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²"))
HAMMER, PASSAGE = (RawDescription(CHANNELS, kind=kind, rate=20000.0) for kind in ("hammer", "passage"))


def text_of(rows, head="force [N];rail [m/s²]"):
    return head + "\n" + "".join(f"{row}\n" for row in rows)


def rows_of(rail=RAIL):
    return [f"{a:.5f};{b:.6g}" for a, b in zip(FORCE, rail)]


def reason_of(root, name, description=HAMMER):
    """Reason and message of the only error; no recording remains."""
    try:
        result = read(name, root, description)
    except ReadError as error:
        return error.reason, str(error)
    (error,) = result.errors
    assert not result.recordings
    return error.reason, str(error)


@pytest.mark.parametrize("samples", [[700], [0], [N - 1], [700, 701, 702, 2000]])
@pytest.mark.parametrize("code", [-9999.0, 999.0, -999.25, 99999.9, -32768.0, 9999.99, 1e20])
def test_a_code_for_a_missing_sample_is_not_read_as_a_measured_value(code, samples, tmp_path):
    rail = RAIL.copy()
    rail[samples] = code
    (tmp_path / "a.csv").write_text(text_of(rows_of(rail)))
    reason, message = reason_of(tmp_path, "a.csv")
    assert reason == "not_finite"
    assert f"channel 'rail': {len(samples)} of {N} samples are {code:.7g}, a usual code for a missing one" in message
    source, _, raw = read_unconverted("a.csv", tmp_path)
    (problem,) = [error.problem for error in errors_without_layout(raw, source)]
    assert problem == ("1 sample is missing" if len(samples) == 1 else f"{len(samples)} samples are missing")
    passage = read("a.csv", tmp_path, PASSAGE)
    assert [c.name for c in passage.recordings[0].channels] == ["force"]  # only this channel is lost


@pytest.mark.parametrize("samples", [[700, 2000], [700, 701, 702, 2000]])
@pytest.mark.parametrize("code", [-99.0, -99.9, -99.99, -99.999])
def test_a_code_with_two_nines_before_the_decimal_point_is_not_read_as_a_measured_value(code, samples, tmp_path):
    rail = 0.25 * RAIL
    rail[samples] = code
    (tmp_path / "a.csv").write_text(text_of(rows_of(rail)))
    reason, message = reason_of(tmp_path, "a.csv")
    assert reason == "not_finite" and f"{len(samples)} of {N} samples are {code:.7g}, a usual code" in message


@pytest.mark.parametrize(("code", "is_missing"), [(-99.99, True), (-99.9, False), (-99.0, False), (99.99, False)])
def test_a_single_value_with_few_nines_is_accepted(code, is_missing, tmp_path):
    rail = 0.25 * RAIL
    rail[700] = code
    (tmp_path / "a.csv").write_text(text_of(rows_of(rail)))
    assert bool(read("a.csv", tmp_path, PASSAGE).errors) == is_missing


@pytest.mark.parametrize("flank", [-40.0, -1.0])
def test_a_pulse_that_is_clipped_at_such_a_value_is_accepted(flank, tmp_path):
    """The samples beside the limit are lower than all others: the signal approaches the limit."""
    rail = np.round(RAIL / np.abs(RAIL).max() / 2.0, 3)
    rail[700:704] = [flank, -99.99, -99.99, flank]
    (tmp_path / "a.csv").write_text(text_of(rows_of(rail)))
    assert [error.reason for error in read("a.csv", tmp_path, PASSAGE).errors if error.reason == "not_finite"] == []


@pytest.mark.parametrize("dtype", ["f4", "f8", "i4"])
def test_a_code_is_found_in_any_type_and_in_a_record_that_is_read_in_parts(dtype, tmp_path):
    n = 300_000  # the code lies in the second block
    rail = np.round(np.random.default_rng(1).normal(0.0, 20.0, n)).astype(dtype)
    rail[262_144] = -9999
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = 20000.0
        file["rail"], file["force"] = rail, np.random.default_rng(2).normal(size=n)
    channels = (CHANNELS[0], RawChannel("rail", "rail", "acceleration", unit="0.02 m/s²!"))
    result = read("a.h5", tmp_path, RawDescription(channels, "passage", rate=20000.0), 1.0, max_whole_file_size=0)
    (error,) = result.errors
    assert error.reason == "not_finite" and f"1 of {n} samples are -9999" in str(error)
    assert [c.name for c in result.long_recordings[0].channels] == ["force"]


def test_a_value_of_this_form_with_similar_neighbours_is_accepted(tmp_path):
    rail = RAIL.copy()
    rail[700:707] = [200.0, 600.0, 950.0, 999.0, 900.0, 500.0, 100.0]
    (tmp_path / "a.csv").write_text(text_of(rows_of(rail)))
    result = read("a.csv", tmp_path, HAMMER)
    assert result.errors == () and result.recordings[0].signal("rail").max() == 999.0


@pytest.mark.parametrize("gap", [400, 2000])
def test_a_jump_of_a_counter_is_an_error_and_its_restart_is_accepted(gap, tmp_path):
    ignored = RawDescription((*CHANNELS, RawChannel("n", "n", "ignored")), rate=20000.0)
    count = np.arange(N)
    count[gap:] += 17
    (tmp_path / "a.csv").write_text(text_of(map("{};{}".format, count, rows_of()), "n;force [N];rail [m/s²]"))
    reason, message = reason_of(tmp_path, "a.csv", ignored)
    assert reason == "truncated" and "samples are missing" in message and str(gap - 1) in message
    for count in (np.arange(N), np.arange(N) % 256, 1 + np.arange(N) % 1000):  # over one impact
        (tmp_path / "a.csv").write_text(text_of(map("{};{}".format, count, rows_of()), "n;force [N];rail [m/s²]"))
        result = read("a.csv", tmp_path, ignored)
        assert len(result.recordings) == 1 and not result.errors


@pytest.mark.parametrize("name, unit", [("n", ""), ("qwxz", ""), ("qwxz", "qwx"), ("Čas", "ms")])
@pytest.mark.parametrize("step", [1.0, 0.05])
def test_a_count_or_an_axis_that_falls_evenly_is_an_error(name, unit, step, tmp_path):
    """Formerly, samples with the newest first were read against the time."""
    ignored = RawDescription((*CHANNELS, RawChannel("n", name, "ignored")), rate=20000.0)
    head = f"{name} [{unit}];force [N];rail [m/s²]" if unit else f"{name};force [N];rail [m/s²]"
    falling = 7.0 + step * np.arange(N)[::-1]
    (tmp_path / "a.csv").write_text(text_of(map("{:.9g};{}".format, falling, rows_of()), head), encoding="utf-8")
    assert reason_of(tmp_path, "a.csv", ignored)[0] == "clock_backwards"
    (tmp_path / "a.csv").write_text(
        text_of(map("{:.9g};{}".format, falling, rows_of()), "n [°C];force [N];rail [m/s²]"), encoding="utf-8"
    )
    fallen = RawDescription((*CHANNELS, RawChannel("n", "n", "ignored")), rate=20000.0)
    assert read("a.csv", tmp_path, fallen).errors == ()


@pytest.mark.parametrize("code", [2**31 - 1, -(2**31 - 1), 2**31, -(2**31), 2**23 - 1, 2**15, -9999])
def test_each_code_of_a_converter_is_found_among_numbers_with_decimals(code, tmp_path):
    rail = RAIL.copy()
    rail[700] = code
    (tmp_path / "a.csv").write_text(text_of(f"{a:.5f};{b:.12g}" for a, b in zip(FORCE, rail)))
    reason, message = reason_of(tmp_path, "a.csv")
    assert reason == "not_finite" and "1 of " in message


def test_a_code_that_a_type_of_numbers_does_not_have_is_not_counted():
    column = np.array([5, -(2**31), 7, 3], dtype=np.int32)
    assert count_alone(column, 2.0**31) == 0 and count_alone(column, -(2.0**31)) == 1
    assert count_alone(np.array([5, 99999, 7], dtype=np.int32), 99999.9) == 0


@pytest.mark.parametrize("row", ["0.5;OVER", "0.5;(0.4)", "0.5;---.--", "0.5;#"])
def test_a_cell_without_a_number_in_the_first_row_is_an_error(row, tmp_path):
    (tmp_path / "a.csv").write_text(text_of([row, *rows_of()]))
    _, message = reason_of(tmp_path, "a.csv")
    assert f"line 2: {row.split(';')[1]!r} is no number, in the first row of samples" in message


@pytest.mark.parametrize("line", ["Range;5000", "hammer;beside the rail", "N;m/s²"])
def test_a_label_below_the_names_is_not_read_as_a_row_of_samples(line, tmp_path):
    (tmp_path / "a.csv").write_text(text_of([line, *rows_of()]))
    assert read("a.csv", tmp_path, HAMMER).recordings[0].n_sample == N


@pytest.mark.parametrize(
    ("line", "reason"),
    [("Units: kN, g", ("entry_unknown", "unit_unknown")), ("Sampling rate: 25.6 kHz", ("wrong_rate",))],
)
def test_statements_below_the_numbers_are_compared_with_the_layout(line, reason, tmp_path):
    (tmp_path / "a.csv").write_text(text_of([*rows_of(), line, "End of data"], "force;rail"))
    found, message = reason_of(tmp_path, "a.csv")
    assert found in reason and f"line {N + 2}" in message


def test_empty_columns_without_a_name_are_not_read_as_channels(tmp_path):
    rows = [";" + row.replace(";", ";;") + ";" for row in rows_of()]
    (tmp_path / "a.csv").write_text(text_of(rows, ";force [N];;rail [m/s²];"))
    (recording,) = read("a.csv", tmp_path, HAMMER).recordings
    np.testing.assert_allclose(recording.signal("rail"), RAIL, rtol=1e-5)


@pytest.mark.parametrize(
    ("cell", "remedy"),
    [
        ("0,25", "one decimal mark"),
        ("0.25-", "without other signs"),
        ("±0.25", "without other signs"),
        ("OVER", "Copy"),
    ],
)
def test_the_remedy_depends_on_the_content_of_the_cell(cell, remedy, tmp_path):
    (tmp_path / "a.csv").write_text(text_of([*rows_of()[:50], f"0.5;{cell}", *rows_of()]), encoding="utf-8")
    _, message = reason_of(tmp_path, "a.csv")
    assert "line 52" in message and remedy in message


@pytest.mark.parametrize("encoding", ["utf-32", "utf-16"])
def test_text_in_wide_characters_is_read(encoding, tmp_path):
    (tmp_path / "a.csv").write_text(text_of(rows_of()), encoding=encoding)
    assert read("a.csv", tmp_path, HAMMER).recordings[0].n_sample == N


@pytest.mark.parametrize("part", ["chunks", "whole"])
def test_unwritten_samples_of_hdf5_are_not_read_as_zeros(part, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = 20000.0
        file["force"] = FORCE
        rail = file.create_dataset("rail", (N,), "f8", chunks=(500,) if part == "chunks" else None)
        if part == "chunks":
            rail[:1500] = RAIL[:1500]
    reason, message = reason_of(tmp_path, "a.h5")
    assert reason == "truncated" and "dataset '/rail'" in message and "never written" in message
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["rail"][:] = RAIL
        axis = file.create_dataset("sample", (N,), "f4")  # netCDF writes no values for such an axis
        axis.attrs["NAME"] = f"This is a netCDF dimension but not a netCDF variable. {N:>10}"
    assert "rail" not in reason_of(tmp_path, "a.h5")[1]  # the axis is a channel that the layout does not name


@pytest.mark.parametrize("format", ["npz", "h5", "parquet"])
def test_a_mask_of_samples_is_an_error_and_an_empty_mask_is_accepted(format, tmp_path):
    for is_masked in (True, False):
        mask = np.arange(N) == (500 if is_masked else -1)
        path = tmp_path / f"a.{format}"
        if format == "npz":
            np.savez(path, force=FORCE, rail=RAIL, rate=20000.0, invalid=mask)
        elif format == "parquet":
            parquet.write_table(pa.table({"force": FORCE, "rail": RAIL, "invalid": mask}), path)
        else:
            with h5py.File(path, "w") as file:
                file.attrs["rate"] = 20000.0
                file["force"], file["rail"], file["invalid"] = FORCE, RAIL, mask
        if is_masked:
            reason, message = reason_of(tmp_path, path.name)
            assert reason == "channel_unknown" and "'invalid'" in message
        else:
            assert read(path.name, tmp_path, HAMMER).errors == ()


CLOCKS = {
    "10:00:{:09.6f}": "time of day", "2026-05-13T10:00:{:09.6f}Z": "ISO 8601", "13.05.2026 10:00:{:09.6f}": "day first",
    "05/13/2026 10:00:{:09.6f} AM": "AM and PM",
}  # fmt: skip


def write_with_clock(format, path, clock):
    """Force, rail and a column of text, without a rate."""
    if format == "npz":
        np.savez(path, force=FORCE, rail=RAIL, timestamp=np.array(clock))
    elif format == "h5":
        with h5py.File(path, "w") as file:
            file["force"], file["rail"], file["timestamp"] = FORCE, RAIL, clock
    elif format == "parquet":
        parquet.write_table(pa.table({"force": FORCE, "rail": RAIL, "timestamp": clock}), path)
    else:
        with TdmsWriter(path) as file:
            columns = {"timestamp": clock, "force": FORCE, "rail": RAIL}
            file.write_segment([ChannelObject("test", name, values) for name, values in columns.items()])


@pytest.mark.parametrize("format", ["npz", "h5", "parquet", "tdms"])
@pytest.mark.parametrize("clock", CLOCKS, ids=CLOCKS.values())
def test_a_column_of_clock_times_is_compared_with_the_rate(clock, format, tmp_path):
    path = tmp_path / f"a.{format}"
    for rate in (20000.0, 25600.0):
        write_with_clock(format, path, [clock.format(k / rate) for k in range(N)])
        if rate == 20000.0:
            assert read(path.name, tmp_path, HAMMER).recordings[0].rate == rate
        else:
            reason, message = reason_of(tmp_path, path.name)
            assert reason == "wrong_rate" and "25600" in message
    texts = [clock.format(k / 20000) for k in range(N)]
    write_with_clock(format, path, [*texts[:700], *texts[800:], *(clock.format((N + k) / 20000) for k in range(100))])
    assert "samples are missing" in reason_of(tmp_path, path.name)[1]
    write_with_clock(format, path, [*texts[:700], "no signal", *texts[701:]])
    assert "the time of sample 700 is 'no signal'" in reason_of(tmp_path, path.name)[1]
    write_with_clock(format, path, [texts[0]] * N)  # the start, repeated in every row
    assert read(path.name, tmp_path, HAMMER).errors == ()


def value_of(number, decimal_mark="."):
    return f"{number:.5f}".replace(".", decimal_mark)


@pytest.mark.parametrize("mark", [".", ","])
@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("force [N]|rail [m/s²]", "{}|{}"),
        ("|force|rail|\n|N|m/s²|", "| {} | {} |"),
        ("force rail", "{} {}"),
        ("force [N]  rail (m/s²)", "   {}   {}  "),
        ("# force rail", "{} {}"),
        ("Spring campaign\nhammer test\nforce rail\nN m/s²", "{} {}"),
    ],
)
def test_columns_between_bars_or_blanks_are_read(head, row, mark, tmp_path):
    rows = [row.format(value_of(a, mark), value_of(b, mark)) for a, b in zip(FORCE, RAIL)]
    (tmp_path / "a.txt").write_text(text_of(rows, head), encoding="utf-8")
    result = read("a.txt", tmp_path, HAMMER)
    assert result.errors == ()
    np.testing.assert_allclose(result.recordings[0].samples, [FORCE, RAIL], atol=1e-5)
    for line, cell in enumerate(("OVER", "0.5 0.5", ""), start=2 + head.count("\n") + 700):
        damaged = [*rows[:700], *rows[700 : line - 2 - head.count("\n")], row.format("0.5", cell), *rows[700:]]
        (tmp_path / "a.txt").write_text(text_of(damaged, head), encoding="utf-8")
        assert reason_of(tmp_path, "a.txt")[0] in ("unreadable", "not_finite")


@pytest.mark.parametrize("line", ["Sample rate 25600 Hz", "dt 3.90625e-05", "Units: kN"])
def test_statements_above_columns_between_blanks_are_compared_with_the_layout(line, tmp_path):
    (tmp_path / "a.txt").write_text(text_of([row.replace(";", " ") for row in rows_of()], f"{line}\nforce rail"))
    assert reason_of(tmp_path, "a.txt")[0] in ("wrong_rate", "unit_unknown", "entry_unknown")


@pytest.mark.parametrize("separator", [",", ";"])
def test_names_behind_a_hash_are_read(separator, tmp_path):
    rows = [row.replace(";", separator) for row in rows_of()]
    (tmp_path / "a.csv").write_text(text_of(rows, f"# rate: 20000\n# force{separator}rail"))
    assert read("a.csv", tmp_path, HAMMER).recordings[0].n_sample == N


@pytest.mark.parametrize(
    ("clock", "separator", "mark"),
    [
        ("10:00:{}", ";", "."), ("2026-05-13T10:00:{}Z", ",", "."), ("13.05.2026 10:00:{}", ";", ","),
        ("13.05.2026;10:00:{}", ";", ","), ("05/13/2026 10:00:{} AM", "\t", "."), ("2026-05-13 10:00:{}", " ", "."),
        ("2026-05-13 10:00:{}", "|", ","),
    ],
)  # fmt: skip
def test_the_time_of_day_of_each_row_gives_the_rate(clock, separator, mark, tmp_path):
    texts = [clock.format(value_of(10 + k / 20000, mark)) for k in range(N)]
    is_split = len(clock.split(separator)) > 1  # date and time are two columns
    head = separator.join(["day", "clock", "force", "rail"] if is_split else ["clock", "force", "rail"])

    def write_rows(texts):
        rows = [separator.join((x, value_of(a, mark), value_of(b, mark))) for x, a, b in zip(texts, FORCE, RAIL)]
        (tmp_path / "a.txt").write_text(text_of(rows, head))

    write_rows(texts)
    recording = read("a.txt", tmp_path, RawDescription(CHANNELS)).recordings[0]
    assert recording.rate == pytest.approx(20000.0, rel=1e-4)
    np.testing.assert_allclose(recording.samples, [FORCE, RAIL], atol=1e-5)
    write_rows([clock.format(value_of(10 + k / 12500, mark)) for k in range(N)])
    assert reason_of(tmp_path, "a.txt")[0] == "wrong_rate"
    write_rows([*texts[:700], *texts[800:]])
    assert "samples are missing" in reason_of(tmp_path, "a.txt")[1]


def packed(program):
    data = text_of(rows_of()).encode()
    if program in ("gzip", "bzip2", "xz"):
        return {"gzip": gzip, "bzip2": bz2, "xz": lzma}[program].compress(data)
    stream = io.BytesIO()
    if program == "tar":
        with tarfile.open(fileobj=stream, mode="w") as archive:
            archive.addfile(member := tarfile.TarInfo("A7_1.csv"))
            assert member.size == 0
    else:
        with zipfile.ZipFile(stream, "w") as archive:
            archive.writestr("A7_1.csv", data)
    return stream.getvalue()


@pytest.mark.parametrize("name", ["A7_1.csv", "A7_1.packed"])
@pytest.mark.parametrize("program", ["gzip", "bzip2", "xz", "tar", "ZIP"])
def test_a_compressed_file_is_identified(program, name, tmp_path):
    (tmp_path / name).write_bytes(packed(program))
    _, message = reason_of(tmp_path, name)
    assert program in message and "Unpack it" in message


def test_a_code_in_single_precision_is_found_and_similar_values_are_accepted():
    """The highest code of a 16-bit converter means clipping, and 1000 is no code for a missing sample."""
    assert missing_code(float(np.float32(1e20))) == 1e20 and missing_code(-32768.0) == -32768.0
    assert [missing_code(value) for value in (32766.0, -32766.0, 1000.0, 1.0001e20)] == [None] * 4
    physical = np.array([0.5, 2.0, 32767.0, 1.0])
    assert (count_alone(physical, 32767.0), count_alone(np.rint(physical), 32767.0)) == (1, 0)
