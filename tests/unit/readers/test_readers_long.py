"""Long records that are read in parts have the same channels, samples and errors as completely read records."""

from datetime import datetime

import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet as pq

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.writing import WRITERS, write
from turnout.records import Channel, LongRecording, RawChannel, RawDescription, Recording

RATE, N = 8000.0, 2**17 + 301  # no multiple of a block, and long enough to be read in parts from HDF5
READ_IN_PARTS = ("uff58b", "tdms", "hdf5", "rcmdx", "mat73", "wav", "csv", "parquet")


@pytest.fixture(scope="module")
def logged():
    """Three channels that differ in scale, offset and content."""
    rng = np.random.default_rng(17)
    samples = rng.normal(size=(3, N)) * [[30.0], [2.0], [0.1]] + [[-7.0], [0.0], [40.0]]
    channels = tuple(Channel(name, "acceleration") for name in ("left", "right", "sleeper"))
    return Recording(samples, RATE, channels, "passage", started_at=datetime(2024, 5, 13, 10, 0, 1))


def write_as_logger(recording, folder, format):
    """Write a file as a logger writes it: text and Parquet without the column that numbers records."""
    path = folder / f"x.{'mat' if format == 'mat73' else format}"
    if format not in ("csv", "parquet"):
        return write([recording], path, format)
    table = pa.table({c.name: row for c, row in zip(recording.channels, recording.samples)})
    if format == "parquet":
        table = table.replace_schema_metadata({"rate": str(RATE), "started_at": "2024-05-13T10:00:01"})
        unit = [f.with_metadata({"unit": "m/s²"}) for f in table.schema]
        pq.write_table(table.cast(pa.schema(unit, table.schema.metadata)), path, row_group_size=30_000)
        return path
    with path.open("w") as file:
        file.write(f"# rate: {RATE}\n# started_at: 2024-05-13T10:00:01\n")
        file.write(",".join(f"{c.name} [m/s²]" for c in recording.channels) + "\n")
        np.savetxt(file, recording.samples.T, fmt="%.17g", delimiter=",")
    return path


@pytest.fixture
def in_another_order():
    """Two channels as accelerations in reversed order, one with reversed sign; the third is ignored."""
    return RawDescription(
        (
            RawChannel("sleeper", "sleeper", "acceleration", unit="g!", sign=-1),
            RawChannel("left", "left", "acceleration"),
            RawChannel("right", "right", "ignored"),
        ),
        kind="passage",
        rate=RATE,
    )


@pytest.mark.parametrize("format", WRITERS)
def test_parts_of_a_record_equal_those_of_a_complete_read(format, logged, in_another_order, tmp_path):
    path = write_as_logger(logged, tmp_path, format)
    (whole,) = read(path.name, tmp_path, in_another_order).recordings
    result = read(path.name, tmp_path, in_another_order, max_duration=10.0, max_whole_file_size=0)
    assert result.recordings == () and result.errors == ()
    (long,) = result.long_recordings
    assert (long.n_sample, long.rate, long.channels) == (N, whole.rate, whole.channels)
    assert (long.started_at, long.source, long.record) == (whole.started_at, whole.source, whole.record)
    assert np.array_equal(np.concatenate(list(long.blocks(1.7)), axis=1), whole.samples)
    # forwards, back, across any border of a block of the format
    for start, stop in ((70_000, 70_011), (3, 9), (65_000, 67_000), (N - 5, N)):
        assert np.array_equal(long.read(start, stop), whole.samples[:, start:stop])


@pytest.mark.parametrize("format", READ_IN_PARTS)
def test_samples_are_read_in_parts_from_formats_that_allow_it(format, logged, in_another_order, tmp_path):
    path = write_as_logger(logged, tmp_path, format)
    (long,) = read(path.name, tmp_path, in_another_order, max_duration=10.0, max_whole_file_size=0).long_recordings
    assert not any(isinstance(x, np.ndarray) for x in long.read.record.samples)


@pytest.mark.parametrize(("shape", "chunks"), [((3, N), (3, 4096)), ((N, 3), (4096, 3)), ((3, N), None)])
def test_a_matrix_of_either_orientation_is_read_in_parts(shape, chunks, logged, tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        data = logged.samples if shape[0] == 3 else logged.samples.T
        file.create_dataset("data", data=data, chunks=chunks)
        file.attrs["rate"] = RATE
    wanted = RawDescription(
        tuple(RawChannel(n, i, "acceleration", unit="m/s²") for i, n in enumerate("abc")), kind="passage", rate=RATE
    )
    (long,) = read("x.h5", tmp_path, wanted, max_duration=10.0, max_whole_file_size=0).long_recordings
    assert np.array_equal(long.read(5000, 9001), logged.samples[:, 5000:9001])


def test_short_records_and_small_files_are_read_completely(logged, in_another_order, tmp_path):
    path = write([logged], tmp_path / "x.h5", "hdf5")
    duration = N / RATE
    for longest, held in ((None, 0), (duration + 1.0, 0), (1.0, 10**9)):
        result = read(path.name, tmp_path, in_another_order, max_duration=longest, max_whole_file_size=held)
        assert len(result.recordings) == 1 and result.long_recordings == ()


@pytest.mark.parametrize("format", ["hdf5", "tdms", "parquet"])
def test_only_a_dead_or_not_finite_channel_of_a_long_record_is_lost_with_the_same_message(
    format, logged, in_another_order, tmp_path
):
    samples = logged.samples.copy()
    samples[0] = 3.25
    samples[2, [5, 99_000, N - 1]] = np.nan
    damaged = Recording(samples, RATE, logged.channels, "passage")
    three = RawDescription(
        tuple(RawChannel(c.name, c.name, "acceleration") for c in logged.channels), kind="passage", rate=RATE
    )
    path = write_as_logger(damaged, tmp_path, format)
    whole = read(path.name, tmp_path, three)
    long = read(path.name, tmp_path, three, max_duration=10.0, max_whole_file_size=0)
    assert [str(e) for e in long.errors] == [str(e) for e in whole.errors] and len(whole.errors) == 2
    assert [c.name for c in long.long_recordings[0].channels] == ["right"]
    assert np.array_equal(long.long_recordings[0].read(0, N), whole.recordings[0].samples)


def test_a_file_that_changes_between_two_parts_is_an_error_with_its_place(logged, in_another_order, tmp_path):
    path = write([logged], tmp_path / "x.wav", "wav")
    (long,) = read(path.name, tmp_path, in_another_order, max_duration=10.0, max_whole_file_size=0).long_recordings
    long.read(0, 100)
    with path.open("ab") as file:
        file.write(b"more")
    with pytest.raises(ReadError, match=r"record 1 of 1: it changed while it was read, at sample 100\."):
        long.read(100, 200)


def test_a_hammer_test_is_never_read_in_parts(logged, in_another_order, tmp_path):
    path = write([logged], tmp_path / "x.h5", "hdf5")
    hammer = RawDescription(in_another_order.channels, kind="hammer", rate=RATE)
    result = read(path.name, tmp_path, hammer, max_duration=1.0, max_whole_file_size=0)
    assert isinstance(result.recordings[0], Recording) and not isinstance(result.recordings[0], LongRecording)


def test_separators_of_thousands_are_found_in_a_long_file(tmp_path):
    """Whole numbers in mm/s² with commas between thousands, as a spreadsheet writes them with tabs."""
    numbers = np.round(np.random.default_rng(3).normal(size=2000) * 900.0).astype(int)
    (tmp_path / "x.txt").write_text("nr\tleft [mm/s²]\n" + "".join(f"{i}\t{n:,d}\n" for i, n in enumerate(numbers)))
    channels = RawChannel("left", "left", "acceleration"), RawChannel("nr", "nr", "ignored")
    description = RawDescription(channels, kind="passage", rate=RATE)
    for max_whole_file_size in (0, 2**20):
        with pytest.raises(ReadError, match=r"column 'left': '-?1,\d{3}' has a mark for thousands"):
            read("x.txt", tmp_path, description, max_duration=0.01, max_whole_file_size=max_whole_file_size)


ENDS_OF_TEXT = {
    "a footer": "End of data\nsamples;2000\n",
    "a footer without line break": "End of data\nstopped by hand",
    "the mark of DOS": "\x1a",
    "a footer and the mark of DOS": "End of data\n\x1a",
    "a row that may be cut": "0.1\t2.",
    "a whole row without line break": "0.1250\t0.2500",
    "a word among the rows": "End of data\n0.1\t0.2\n",
    "another rate in a footer": "Sampling rate\t16000 Hz\n",
    "another block": "\n0.1\t0.2\n",
}


@pytest.mark.parametrize("line_break", ["\n", "\r\n", "\r"], ids=["lf", "crlf", "cr"])
@pytest.mark.parametrize("end", ENDS_OF_TEXT.values(), ids=ENDS_OF_TEXT)
def test_the_end_of_a_long_text_is_read_like_that_of_a_short_text(end, line_break, tmp_path):
    numbers = np.random.default_rng(9).normal(size=(2000, 2))
    rows = "".join(f"{a:.4f}\t{b:.4f}\n" for a, b in numbers)
    text = f"rate\t8000 Hz\nleft [m/s²]\tright [m/s²]\n{rows}{end}"
    (tmp_path / "x.txt").write_bytes(text.replace("\n", line_break).encode())
    channels = tuple(RawChannel(name, name, "acceleration") for name in ("left", "right"))
    description = RawDescription(channels, kind="passage")
    outcomes = []
    for max_whole_file_size in (2**20, 0):
        try:
            result = read("x.txt", tmp_path, description, 0.01, max_whole_file_size)
        except ReadError as error:
            outcomes.append(str(error))
            continue
        samples = [r.samples for r in result.recordings]
        samples += [np.asarray(r.read(0, r.n_sample)) for r in result.long_recordings]
        outcomes.append(([s.tolist() for s in samples], [str(e) for e in result.errors]))
    assert outcomes[0] == outcomes[1]
    is_read = not isinstance(outcomes[0], str) and len(outcomes[0][0]) == 1
    assert is_read == (end not in (ENDS_OF_TEXT[n] for n in list(ENDS_OF_TEXT)[-3:]))
