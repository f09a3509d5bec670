"""Files as other programs export them: each is read to within rounding, or rejected with its true reason."""

import time

import h5py
import nptdms
import numpy as np
import pandas
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from tests.unit.readers.cpu_limit import ended_after

import turnout
from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.entries import entries_of_text
from turnout.readers.foreign_formats import FOREIGN_FORMATS
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording

RATE = 20000.0
N = 400
TIME = np.arange(N) / RATE
FORCE = np.round(4000.0 * np.exp(-(((TIME - 0.005) / 0.0004) ** 2)) + np.sin(9000.0 * TIME), 3)
RAIL = np.round(60.0 * np.exp(-TIME / 0.004) * np.sin(2 * np.pi * 560.0 * TIME) + 0.1, 4)
HEAD = "force [N];rail [m/s²]\n"


def layout(unit_of_force=None, unit_of_rail=None, force="force", rail="rail"):
    channels = (
        RawChannel("force", force, "force", unit=unit_of_force),
        RawChannel("rail", rail, "acceleration", unit=unit_of_rail),
    )
    return RawDescription(channels, rate=RATE)


IN_SI = layout("N", "m/s²")


def rows(*columns, separator=";"):
    texts = [[x if isinstance(x, str) else f"{x:.6f}" for x in column] for column in columns or (FORCE, RAIL)]
    return "".join(separator.join(row) + "\n" for row in zip(*texts, strict=True))


def read_text(folder, text, description=None):
    (folder / "A7.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read("A7.csv", folder, description or layout())


def assert_right(result):
    assert not result.errors, result.errors
    (recording,) = result.recordings
    np.testing.assert_allclose(recording.signal("force"), FORCE, atol=1e-6)
    np.testing.assert_allclose(recording.signal("rail"), RAIL, atol=1e-6)


def only_error(result):
    assert not result.recordings
    (error,) = result.errors
    return error


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16"])
def test_a_text_in_utf_16_is_read_with_and_without_a_byte_order_mark(tmp_path, encoding):
    assert_right(read_text(tmp_path, (HEAD + rows()).encode(encoding)))


def test_the_end_mark_of_a_dos_text_is_not_read_as_a_row(tmp_path):
    assert_right(read_text(tmp_path, HEAD + rows() + "\x1a"))


def test_an_end_mark_does_not_complete_a_row_without_line_break(tmp_path):
    result = read_text(tmp_path, HEAD + rows() + "1.5\x1a")
    assert [error.reason for error in result.errors] == ["truncated"]


@pytest.mark.parametrize("text", ["t0=0 dt=0.0000390625", "n: 400 fs: 25600 Hz", "t0 = 0 sampling rate = 25.6 kHz"])
def test_several_statements_in_one_line_are_each_compared_with_the_layout(tmp_path, text):
    error = only_error(read_text(tmp_path, f"{text}\n{HEAD}{rows()}"))
    assert error.reason == "wrong_rate"
    assert "sampled at 25600 Hz instead of 20000 Hz" in str(error)


@pytest.mark.parametrize("end", ["=", "!!", "b :", ""])
def test_the_time_to_split_a_line_does_not_grow_exponentially(end):
    """With backtracking, n pairs can be split in 2^n ways, which takes some hours for this text."""
    with ended_after(60.0):
        list(entries_of_text("a=1 s " * 40 + end, "line 1"))
        list(entries_of_text("a: 1 s b " * 40 + end, "line 1"))


@pytest.mark.parametrize("text", ["t0=0 dt=0.00005", "n: 400 fs: 20000 Hz"])
def test_several_correct_statements_in_one_line_are_accepted(tmp_path, text):
    assert_right(read_text(tmp_path, f"{text}\n{HEAD}{rows()}"))


def two_time_columns(lag):
    head = "t1 [s];force [N];t2 [s];rail [m/s²]\n"
    return head + rows([f"{t:.8f}" for t in TIME], FORCE, [f"{t + lag:.8f}" for t in TIME], RAIL)


@pytest.mark.parametrize(("lag", "words"), [(2e-3, "40 samples after"), (-1e-3, "20 samples before")])
def test_two_time_columns_with_different_starts_are_rejected(tmp_path, lag, words):
    error = only_error(read_text(tmp_path, two_time_columns(lag)))
    assert error.reason == "clock_drift"
    assert f"column 't2' begins {words} its time column" in str(error)


@pytest.mark.parametrize("lag", [0.0, 0.4 / RATE, 1.7e9])
def test_time_columns_of_a_multiplexer_or_with_another_origin_are_accepted(tmp_path, lag):
    assert_right(read_text(tmp_path, two_time_columns(lag)))


@pytest.mark.parametrize("mark", ["9.9E37", "9.91E+37", "-9.9E37", "1E38", "n/a", "null", "---", "1.#QNAN", "-1.#IND"])
def test_marks_of_missing_samples_are_not_read_as_samples(tmp_path, mark):
    force = [f"{x:.3f}" for x in FORCE]
    force[100] = mark
    error = only_error(read_text(tmp_path, HEAD + rows(force, RAIL)))
    assert error.reason == "not_finite"
    assert "1 of 400 samples are missing or not finite, the first is sample 100" in str(error)


def test_a_mark_of_a_missing_sample_in_a_binary_format_is_not_read_as_a_sample(tmp_path):
    force = FORCE.copy()
    force[100] = 9.91e37
    np.savez(tmp_path / "A7.npz", force=force, rail=RAIL)
    assert only_error(read("A7.npz", tmp_path, IN_SI)).reason == "not_finite"


@pytest.mark.parametrize("name", ["Kraft <kN>", "Kraft.kN", "Kraft/kN", "Kraft - kN", "Kraft: kN", "Kraft kN"])
def test_a_unit_behind_a_name_is_compared_with_the_layout(tmp_path, name):
    text = f"{name};rail [m/s²]\n" + rows(FORCE / 1e3, RAIL)
    error = only_error(read_text(tmp_path, text, layout("N", None, force=name)))
    assert error.reason == "unit_unknown"
    assert "'kN'" in str(error) and "'N'" in str(error)


@pytest.mark.parametrize("as_row", [False, True])
def test_vectors_stored_as_matrices_of_one_column_are_channels(tmp_path, as_row):
    shape = (1, N) if as_row else (N, 1)
    with h5py.File(tmp_path / "A7.h5", "w") as file:
        file["force"], file["rail"], file["fs"] = FORCE.reshape(shape), RAIL.reshape(shape), [[RATE]]
    assert_right(read("A7.h5", tmp_path, IN_SI))
    np.savez(tmp_path / "A7.npz", force=FORCE.reshape(shape), rail=RAIL, fs=RATE)
    assert_right(read("A7.npz", tmp_path, IN_SI))


def test_a_single_matrix_of_one_column_is_one_channel(tmp_path):
    np.savez(tmp_path / "A7.npz", data=FORCE[:, None], fs=RATE)
    description = RawDescription((RawChannel("force", "0", "force", unit="N"),), rate=RATE)
    (recording,) = read("A7.npz", tmp_path, description).recordings
    np.testing.assert_array_equal(recording.signal("force"), FORCE)


def test_decimal_numbers_of_parquet_are_read(tmp_path):
    table = pa.table({"force": pa.array(FORCE).cast(pa.decimal128(12, 3)), "rail": RAIL})
    pq.write_table(table, tmp_path / "A7.parquet")
    assert_right(read("A7.parquet", tmp_path, IN_SI))


@pytest.mark.parametrize("format", ["parquet", "mat", "h5"])
def test_the_error_of_a_channel_without_real_numbers_states_its_content(tmp_path, format):
    if format == "parquet":
        pandas.DataFrame({"force": [str(x) for x in FORCE], "rail": RAIL}).to_parquet(tmp_path / "A7.parquet")
    elif format == "mat":
        scipy.io.savemat(tmp_path / "A7.mat", {"force": FORCE + 1j, "rail": RAIL})
    else:
        with h5py.File(tmp_path / "A7.h5", "w") as file:
            file["force"], file["rail"] = [str(x) for x in FORCE], RAIL
    error = only_error(read(f"A7.{format}", tmp_path, IN_SI))
    assert f"'force' holds {'complex numbers' if format == 'mat' else 'text or objects'}, no real numbers" in str(error)


@pytest.mark.parametrize(
    ("cells", "words"),
    [("08:30:00:12;1.0;2.0", "time of a clock"), ("1.0/2.0/3.0", "the last line reads '1.0/2.0/3.0'")],
)
def test_the_error_of_unreadable_rows_states_their_content(tmp_path, cells, words):
    with pytest.raises(ReadError, match=words):
        read_text(tmp_path, "Zeit;force;rail\n" + f"{cells}\n" * 30)


def test_the_error_of_a_time_that_stands_still_proposes_more_digits(tmp_path):
    times = [f"{t:.5f}" for t in TIME]
    text = "Time [s];force [N];rail [m/s²]\n" + rows([*times[:100], times[99], *times[101:]], FORCE, RAIL)
    assert "the time with more digits if it was rounded" in str(only_error(read_text(tmp_path, text)))


def test_the_error_of_a_transposed_table_does_not_list_all_columns(tmp_path):
    text = "".join(";".join(f"{x:.4f}" for x in row) + "\n" for row in (FORCE, RAIL, 2.0 * RAIL))
    error = only_error(read_text(tmp_path, text, layout("N", "m/s²", force="0", rail="1")))
    assert "and 386 more" in str(error)


@pytest.mark.parametrize(("late", "is_gap"), [(0.4, False), (0.6, True), (1.0, True)])
def test_a_jump_of_the_time_by_half_a_step_or_more_is_reported_as_missing_samples(tmp_path, late, is_gap):
    time = TIME + late / RATE * (np.arange(N) >= 200)
    text = "Time [s];force [N];rail [m/s²]\n" + rows([f"{t:.9f}" for t in time], FORCE, RAIL)
    result = read_text(tmp_path, text)
    assert [error.reason for error in result.errors] == (["truncated"] if is_gap else [])


@pytest.mark.parametrize(
    ("column", "is_axis"),
    [
        (np.arange(N), False),  # counts the samples
        (1.5 * np.arange(N), True),
        (TIME * RATE / 25600.0, True),
        ((np.arange(N) + 30 * (np.arange(N) >= 200)) / 25600.0, True),  # an axis may have one gap
        ((np.arange(N) + 30 * (np.arange(N) >= 200) + 30 * (np.arange(N) >= 300)) / 25600.0, True),
        ((np.arange(N) + 30 * (np.arange(N) // 20)) / 25600.0, False),  # a gap in each 20 steps
        (np.arange(1.0, N + 1.0) ** 2, False),  # rises too unevenly
        (-TIME, True),  # the newest sample may be the first one
        (-(TIME**2), False),
    ],
)
def test_an_evenly_rising_column_is_compared_with_the_rate_even_if_it_is_ignored(tmp_path, column, is_axis):
    channels = (*layout().channels, RawChannel("other", "Uhr", "ignored"))
    text = "Uhr;force [N];rail [m/s²]\n" + rows([f"{x:.8f}" for x in column], FORCE, RAIL)
    result = read_text(tmp_path, text, RawDescription(channels, rate=RATE))
    assert bool(result.errors) == is_axis, result.errors


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (b"MDF     4.10    ", "a measurement file of ASAM (MDF). Export the recording from the program that wrote it"),
        (b"|CF,2,1,1;1;|CK,1,3,1,1;", "a file of imc FAMOS. Export the recording from the program that wrote it"),
        (b'<?xml version="1.0"?>\n<sie version="1.0">', "an XML file, such as DIAdem's TDM or Somat's SIE. Export"),
        (b"ARROW1\x00\x00", "an Arrow or Feather file. Write its table as Parquet."),
        (b"\x93NUMPY\x01\x00v\x00", "one NumPy array, without names of channels. Save every channel under its name"),
        (b"TDSh\x0e\x00\x00\x00", "the index of a TDMS file, without samples. Copy the file with the ending .tdms"),
        (b"\r\n<!DOCTYPE html>\n", "a web page, such as that of a login. Log in and download the recording again."),
        (
            b"version https://git-lfs.github.com/spec/v1\n",
            "a pointer of Git LFS, without samples. Fetch the file itself",
        ),
    ],
)
@pytest.mark.parametrize("ending", ["csv", "dat", "tdms", "raw"])
def test_a_file_of_a_foreign_format_is_identified_and_the_error_states_a_remedy(head, message, ending, tmp_path):
    (tmp_path / f"A7.{ending}").write_bytes(head + bytes(range(256)) * 20)
    with pytest.raises(ReadError) as caught:
        read(f"A7.{ending}", tmp_path, layout())
    assert f"A7.{ending}, byte 0: it is {message}" in str(caught.value)


@pytest.mark.parametrize(("entry", "start"), [(entry, start) for entry in FOREIGN_FORMATS for start in entry.starts])
def test_the_start_of_every_foreign_format_is_recognised_only_at_its_place(entry, start, tmp_path):
    is_foreign = []
    for front in (b"", b"\xef\xbb\xbf \n"):
        (tmp_path / "A7.csv").write_bytes(bytes(entry.offset) + front + start + bytes(300))
        with pytest.raises(ReadError) as caught:
            read("A7.csv", tmp_path, layout())
        is_foreign.append(f"it is {entry.label}. {entry.remedy}" in str(caught.value))
    assert is_foreign == [True, entry.is_text]


def test_two_columns_of_one_name_in_parquet_are_an_error(tmp_path):
    table = pa.Table.from_arrays([pa.array(FORCE), pa.array(RAIL), pa.array(RAIL)], names=["force", "rail", "rail"])
    pq.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(ReadError) as caught:
        read("a.parquet", tmp_path, IN_SI)
    assert str(caught.value).endswith(
        "several columns have the name 'rail'. Write the file again with a name of its own for each column."
    )


@pytest.mark.parametrize("first", ["0", "0,00000", "0E0"])
def test_decimal_commas_in_quotation_marks_are_read_if_the_first_number_has_none(first, tmp_path):
    columns = [[f'"{t:.6f}"'.replace(".", ",") for t in TIME]]
    columns[0][0] = f'"{first}"'
    columns += [[f'"{x:.9g}"'.replace(".", ",") for x in signal] for signal in (FORCE, RAIL)]
    assert_right(read_text(tmp_path, "time [s],force [N],rail [m/s²]\n" + rows(*columns, separator=",")))


@pytest.mark.parametrize("first", ["0", '"1,234"'])
def test_separators_of_thousands_are_not_read_as_decimal_commas(first, tmp_path):
    force = [f'"{x:,}"' if abs(x) >= 1000 else f"{x}" for x in np.rint(FORCE).astype(int)]
    force[0] = first
    rail = [f"{x}" for x in np.rint(RAIL).astype(int)]
    with pytest.raises(ReadError, match="thousands"):
        read_text(tmp_path, "force [N],rail [m/s²]\n" + rows(force, rail, separator=","))


@pytest.mark.parametrize("name", ["Samples", "Sample count", "No of samples", "Number of points", "Data points"])
def test_a_stated_number_of_samples_under_any_usual_name_is_compared_with_the_rows(name, tmp_path):
    assert_right(read_text(tmp_path, f"{name};{N}\n{HEAD}{rows()}"))
    error = only_error(read_text(tmp_path, f"{name};{N + 100}\n{HEAD}{rows()}"))
    assert error.reason == "truncated" and f"has {N} of the {N + 100} samples" in str(error)


@pytest.mark.parametrize("name", ["Samples", "Number of points"])
def test_a_column_that_counts_samples_is_not_read_as_a_stated_number(name, tmp_path):
    counts = [f"{k}" for k in range(5000, 5000 + N)]
    description = RawDescription((*layout().channels, RawChannel("number", name, "ignored")), rate=RATE)
    assert_right(read_text(tmp_path, f"{name};{HEAD}{rows(counts, FORCE, RAIL)}", description))


def test_lvm_samples_with_another_decimal_mark_than_in_the_header_are_an_error(tmp_path):
    channels = (Channel("force", "force"), Channel("rail", "acceleration"))
    write([Recording(np.vstack([FORCE, RAIL]), RATE, channels)], tmp_path / "a.lvm", "lvm")
    head, marker, samples = (tmp_path / "a.lvm").read_text(encoding="utf-8").rpartition("***End_of_Header***")
    (tmp_path / "a.lvm").write_text(head + marker + samples.replace(".", ","), encoding="utf-8")
    error = str(only_error(read("a.lvm", tmp_path, IN_SI)))
    assert "has another decimal mark than '.', which its header states. Export it again with one decimal mark" in error


TEXTS = {"event": ["start", "train passes"], "comment": ["Gain x10"], "operator": ["A. Müller"]}


@pytest.mark.parametrize("name", TEXTS)
def test_a_tdms_channel_of_text_is_read_as_metadata(tmp_path, name):
    """Formerly, it was read as a channel of another rate, and the record was lost. A stated scale is an error."""
    rng = np.random.default_rng(1)
    step = {"wf_increment": 1 / 2000.0}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        channels = [
            nptdms.ChannelObject("g", c, rng.normal(size=500), {**step, "unit_string": unit})
            for c, unit in (("force", "N"), ("rail", "m/s^2"))
        ]
        writer.write_segment([*channels, nptdms.ChannelObject("g", name, TEXTS[name])])
    if "Gain" in TEXTS[name][0]:
        with pytest.raises(ReadError, match="'text: Gain x10' in channel 'comment' may state a scale"):
            turnout.read(tmp_path / "a.tdms")
    else:
        assert not turnout.read(tmp_path / "a.tdms").errors


FOREIGN = {
    "binary": (b"DEWESoft Data File" + b"\x01\x02" * 300, "byte 18: 0x01 is no text"),
    "padded": (b"C 1 CLIENT".ljust(3200) + b"\x00" * 600, "is no text"),
    "a web page": (b"<table><tr><td>F</td></tr></table>" * 30, "no line of numbers"),
    "rich text": (b"{\\rtf1\\ansi F;a\\par 1;2\\par}", "no line of numbers"),
}


@pytest.mark.parametrize("content", FOREIGN)
def test_a_file_without_numbers_is_not_reported_as_truncated(tmp_path, content):
    data, problem = FOREIGN[content]
    (tmp_path / "a.txt").write_bytes(data)
    with pytest.raises(ReadError) as caught:
        turnout.read(tmp_path / "a.txt")
    assert problem in str(caught.value) and "line break" not in str(caught.value)


@pytest.mark.parametrize("filling", [" ", "\u00a0", ". ", "- ", " a"])
def test_a_long_line_of_the_header_is_read_fast(tmp_path, filling):
    """Formerly, the time grew with the third power of the number of blanks: 800 blanks took 8 s."""
    head = f"C 1 CLIENT{filling * 1000}%\nrate: 20000\n{HEAD}"
    (tmp_path / "a.csv").write_text(head + "".join(f"{f};{a}\n" for f, a in zip(FORCE, RAIL)), encoding="utf-8")
    begin = time.process_time()
    (recording,) = read("a.csv", tmp_path, layout()).recordings
    assert time.process_time() - begin < 5.0 and recording.samples.shape == (2, N)
