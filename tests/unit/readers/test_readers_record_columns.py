"""Records that a file numbers in a column, a group or a set: names of the numbers, and missing numbers."""

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording

N = 30
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
NAMES = ("record", "Record", "impact", "Impact No", "hit", "rec_nr", "segment", "Schlag-Nr.", "Hit #")


def outcome(folder, format, name, numbers, lengths=None):
    """Numbers of samples of the records, and the problems."""
    number = np.repeat(numbers, lengths or [N] * len(numbers))
    force, rail = np.random.default_rng(3).normal(size=(2, len(number))) * [[900.0], [30.0]]
    if format == "csv":
        rows = "\n".join(f"{f:.9g};{a:.9g};{k:g}" for f, a, k in zip(force, rail, number))
        (folder / "a.csv").write_text(f"force;rail;{name}\n{rows}\n", encoding="utf-8")
    else:
        pq.write_table(pa.table({"force": force, "rail": rail, name: number}), folder / "a.parquet")
    result = read(f"a.{format}", folder, RawDescription(SENSORS, rate=2e4))
    return [r.n_sample for r in result.recordings], [(e.where, e.reason) for e in result.errors]


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("name", NAMES)
def test_a_missing_number_is_reported_and_the_other_impacts_are_read(format, name, tmp_path):
    assert outcome(tmp_path, format, name, (1, 2, 4, 5)) == ([N] * 4, [("record 3 of 5", "truncated")])
    lost = [("record 2 of 6", "truncated"), ("record 3 of 6", "truncated")]
    assert outcome(tmp_path, format, name, (7, 10, 11, 12)) == ([N] * 4, lost)


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("numbers", [(0, 1, 2), (4, 5, 6), (10, 20, 30), (1, 3, 5, 7), (3, 2, 1), (101, 214, 388)])
def test_numbers_of_another_counter_are_not_reported_as_missing_records(format, numbers, tmp_path):
    assert outcome(tmp_path, format, "record", numbers) == ([N] * len(numbers), [])


@pytest.mark.parametrize("kind", [np.uint8, np.uint32, np.int64, np.float64])
@pytest.mark.parametrize(
    "name, numbers, n_record", [("record", (1, 2, 1, 2), 4), ("record", (3, 2, 1), 3), ("hit", (2, 1), 0)]
)
def test_numbers_that_fall_keep_all_records_in_the_order_of_the_file(kind, name, numbers, n_record, tmp_path):
    """Also for unsigned numbers, whose step from 2 to 1 is 255."""
    number = np.repeat(numbers, N).astype(kind)
    samples = np.arange(2.0 * len(number)).reshape(2, -1)
    pq.write_table(pa.table({"force": samples[0], "rail": samples[1], name: number}), tmp_path / "a.parquet")
    result = read("a.parquet", tmp_path, RawDescription(SENSORS, rate=2e4))
    assert [r.samples[0, 0] for r in result.recordings] == [1.0 * N * k for k in range(n_record)]
    assert [e.reason for e in result.errors] == ["channel_unknown"] * (n_record == 0)


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize(
    "numbers, lengths",
    [
        ((0, 1), (7, 53)),
        ((1, 2, 3), (9, 11, 7)),
        ((5,), (40,)),
        ((1, 0), (9, 9)),
        ((*range(7), *range(6, 39)), [1] * 40),  # 6 comes twice: it counts no samples
        ((0.5, 1.5), (9, 9)),
    ],
)
def test_a_flag_of_the_contact_does_not_divide_a_record(format, numbers, lengths, tmp_path):
    assert outcome(tmp_path, format, "hit", numbers, lengths) == ([], [("record 1 of 1", "channel_unknown")])


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("name", ["Impact No", "hit_nr", "Record #"])
def test_the_number_of_a_single_impact_is_not_read_as_a_channel(format, name, tmp_path):
    """Channel numbers of a layout are then equal for files of one impact and of several impacts."""
    assert outcome(tmp_path, format, name, (7,)) == ([N], [])


@pytest.mark.parametrize("first", ["time", "Impact No"])
def test_a_layout_that_counts_a_column_that_is_no_channel_is_an_error(first, tmp_path):
    """Formerly, the last channel was missing; each other channel had the samples of its neighbour."""
    numbers = np.repeat([1, 2], N) if first == "Impact No" else np.arange(2 * N) / 2e4
    rows = "".join(f"{number:g};{k % 7};{k % 5};{k % 3}\n" for k, number in enumerate(numbers))
    (tmp_path / "a.csv").write_text(f"{first};force;rail;web\n{rows}")
    others = (RawChannel("first", 0, "ignored"), RawChannel("web", 3, "ignored"))
    sensors = (RawChannel("force", 1, "force", unit="N"), RawChannel("rail", 2, "acceleration", unit="m/s²"))
    result = read("a.csv", tmp_path, RawDescription((*others, *sensors), rate=2e4))
    assert not result.recordings and "there is no channel 3; the file has 3" in str(result.errors[0])
    absent = RawChannel("first", "aux", "ignored"), RawChannel("web", 2, "ignored")
    moved = (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", unit="m/s²"))
    assert len(read("a.csv", tmp_path, RawDescription((*absent, *moved), rate=2e4)).recordings) > 0


def test_records_that_texts_number_are_an_error_in_parquet(tmp_path):
    """Otherwise two records would be read as one with a jump."""
    table = pa.table({"force": np.arange(60.0), "rail": np.arange(60.0), "Record": ["1"] * 30 + ["2"] * 30})
    pq.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(ReadError, match=r"column 'Record': it holds text or objects, such as '1'"):
        read("a.parquet", tmp_path, RawDescription(SENSORS, rate=2e4))


def write_groups(path, format, numbers):
    samples = np.random.default_rng(3).normal(size=(len(numbers), 2, N)) * [[900.0], [30.0]]
    if format == "h5":
        with h5py.File(path, "w") as file:
            for number, (force, rail) in zip(numbers, samples):
                file[f"hit_{number}/force"], file[f"hit_{number}/rail"] = force, rail
    elif format == "tdms":
        with nptdms.TdmsWriter(str(path)) as writer:
            for number, pair in zip(numbers, samples):
                channels = zip(("force", "rail"), pair)
                writer.write_segment([nptdms.ChannelObject(f"impact {number}", *channel) for channel in channels])
    else:
        channels = (Channel("force", "force"), Channel("rail", "acceleration"))
        write([Recording(pair, 2e4, channels) for pair in samples], path, "uff58")
        text = path.read_text(encoding="utf-8")
        for k in range(len(numbers), 0, -1):
            text = text.replace(f"\n    1         0{k:5d}", f"\n    1         0{numbers[k - 1]:5d}")
        path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize("format", ["h5", "tdms", "uff"])
@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ((1, 2, 4, 5), [3]),
        ((1, 3), [2]),
        ((1, 3, 5), []),
        ((3, 4, 5), []),
        ((10, 20, 45), []),
        ((1, 2, 6), [3, 4, 5]),
        ((1, 2, 8), []),
    ],
)
def test_missing_numbers_of_groups_and_sets_are_reported_in_the_same_way(format, numbers, lost, tmp_path):
    write_groups(tmp_path / f"a.{format}", format, numbers)
    result = read(f"a.{format}", tmp_path, RawDescription(SENSORS, rate=2e4))
    assert len(result.recordings) == len(numbers)
    assert [(e.reason, e.where.split(" of ")[0]) for e in result.errors] == [("truncated", f"record {k}") for k in lost]
