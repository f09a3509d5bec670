"""Truncated and damaged files give an error or exactly the same numbers, never other numbers without a message."""

import errno
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from turnout.errors import ReadError, is_infrastructure
from turnout.readers import read
from turnout.readers.writing import WRITERS, write
from turnout.reasons import REASONS

CHECKSUMMED = ("hdf5", "mat", "mat73", "npz", "parquet")  # formats whose writers store checksums
EASY = settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
ANYWHERE = st.floats(min_value=0.0, max_value=1.0, exclude_max=True)


@pytest.fixture
def written(hammer_test, in_si, name_of, tmp_path):
    """(path, recordings of the whole file) of a format."""

    def make(format):
        path = write(hammer_test[:1] if format == "wav" else hammer_test, tmp_path / name_of(format), format)
        return path, read(path.name, tmp_path, in_si).recordings

    return make


def outcome(path, description):
    try:
        result = read(path.name, path.parent, description)
    except ReadError as error:
        return (), (error,)
    return result.recordings, result.errors


def assert_unchanged(recordings, whole):
    """Each recording equals one of the whole file, bit by bit."""
    for one in recordings:
        assert any(np.array_equal(one.samples, other.samples) for other in whole)


@pytest.mark.parametrize("format", WRITERS)
def test_a_file_truncated_anywhere_gives_an_error_and_only_complete_records(format, written, in_si):
    """Without counts in the description: the content of every format suffices to find the truncation."""
    path, whole = written(format)
    data = path.read_bytes()

    @EASY
    @given(ANYWHERE)
    @example(0.5)  # between two records of the same length
    def cut(part):
        path.write_bytes(data[: int(part * len(data))])
        recordings, errors = outcome(path, in_si)
        assert all(e.reason in REASONS and e.path == path.name for e in errors)
        assert errors or len(recordings) == len(whole)  # complete except for its last line break
        assert_unchanged(recordings, whole)

    cut()


@pytest.mark.parametrize("format", CHECKSUMMED)
def test_a_flipped_bit_is_found_in_formats_with_checksums(format, written, in_si):
    path, whole = written(format)
    data = path.read_bytes()

    @EASY
    @given(ANYWHERE, st.integers(0, 7))
    def flip(part, bit):
        damaged = bytearray(data)
        damaged[int(part * len(data))] ^= 1 << bit
        path.write_bytes(damaged)
        recordings, errors = outcome(path, in_si)
        assert errors or len(recordings) == len(whole)
        assert_unchanged(recordings, whole)

    flip()


@pytest.mark.parametrize("format", WRITERS)
def test_any_damage_gives_a_known_reason_and_no_other_exception(format, written, in_si):
    path, whole = written(format)
    data = path.read_bytes()

    @EASY
    @given(ANYWHERE, st.binary(min_size=1, max_size=64))
    def overwrite(part, other):
        at = int(part * len(data))
        path.write_bytes(data[:at] + other + data[at + len(other) :])
        for error in outcome(path, replace(in_si, n_records=len(whole), n_samples=301))[1]:
            assert error.reason in REASONS

    overwrite()


@pytest.mark.parametrize(
    ("format", "first", "intact"),
    [
        ("uff58b", b"\x00" * 60, 3),
        ("uff58", b"x" * 60, 3),
        ("lvm", b"x" * 60, 3),
        ("npz", b"x" * 60, 3),
        ("hdf5", b"x" * 60, 3),
    ],
)
def test_a_damaged_record_is_the_only_record_that_is_lost(format, first, intact, written, in_si):
    """Sixty bytes in the third of four records are changed; in UFF these are the header of its second set."""
    path, whole = written(format)
    data = bytearray(path.read_bytes())
    at = {
        "uff58b": lambda: data.rfind(b"    -1\n", 0, data.rfind(b"    -1\n", 0, int(0.74 * len(data)))),
        "uff58": lambda: int(0.7 * len(data)),
        "lvm": lambda: int(0.6 * len(data)),
        "npz": lambda: data.find(b"record_002") + 500,
        "hdf5": lambda: data.find(whole[2].samples[0].tobytes()) + 100,
    }[format]()
    data[at : at + 60] = bytes(60)
    path.write_bytes(data)
    recordings, errors = outcome(path, replace(in_si, n_records=4, n_samples=301))
    assert errors
    assert [r.record for r in recordings] == [0, 1, 3]
    for one in recordings:
        np.testing.assert_array_equal(one.samples, whole[one.record].samples)


def test_the_error_of_tdms_states_the_incomplete_segment(written, in_si):
    path, _ = written("tdms")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) - 100])
    recordings, errors = outcome(path, in_si)
    assert len(recordings) == 3
    assert "record 4 of 4 (group 'record_003'), channel" in str(errors[0])
    assert errors[0].reason == "truncated"


def test_the_error_of_wav_states_the_size_of_the_incomplete_chunk(written, in_si):
    """libsndfile reads this file without a message."""
    path, _ = written("wav")
    data = path.read_bytes()
    at = data.find(b"data")
    path.write_bytes(data[: at + 8 + 1000])
    (error,) = outcome(path, in_si)[1]
    assert f"the header: its chunk 'data' ends after 1000 of {2 * 8 * 301} bytes. Copy the file again" in str(error)
    for n in (1, 7, 9):  # 16 bytes are a frame of 8 channels with 16 bits
        size = 2 * 8 * 301 - n
        end = bytes(size % 2)
        riff = (len(data[8:at]) + 8 + size + len(end)).to_bytes(4, "little")
        chunk = size.to_bytes(4, "little") + data[at + 8 : at + 8 + size] + end
        path.write_bytes(data[:4] + riff + data[8 : at + 4] + chunk)
        (error,) = outcome(path, in_si)[1]
        assert f"its samples end within a frame, {16 - n} bytes after its beginning" in str(error)
    path.write_bytes(data[: at + 4] + b"\xff\xff\xff\xff" + data[at + 8 :])
    (error,) = outcome(path, in_si)[1]
    assert "the chunk of samples was never finished by the logger" in str(error)


def test_a_text_without_its_last_line_break_is_reported_as_truncated(written, in_si):
    for format in ("csv", "lvm"):
        path, _ = written(format)
        path.write_bytes(path.read_bytes().rstrip(b"\n")[:-3])
        error = outcome(path, in_si)[1][-1]
        assert "line has no line break" in str(error) and error.reason == "truncated"


def test_the_error_of_uff_states_where_its_set_ends(written, in_si):
    path, _ = written("uff58b")
    path.write_bytes(path.read_bytes()[:-1000])
    recordings, (error,) = outcome(path, in_si)
    assert len(recordings) == 3
    assert "A7_1.uff, record 4 of 4, channel 'rail', byte " in str(error)
    assert "ends after 176 of 301 samples. Copy the file again from the logger." in str(error)


@pytest.mark.parametrize(
    "fault",
    [
        OSError(errno.EIO, "Input/output error"),
        OSError(errno.ENOSPC, "No space left on device"),
        MemoryError("Unable to allocate 458. MiB"),
        KeyError(
            "Unable to open object (file read failed: time = ..., errno = 5, error message = 'Input/output error'"
        ),
    ],
    ids=repr,
)
def test_a_fault_of_the_machine_is_not_reported_as_damage_of_the_file(fault, written, in_si, monkeypatch):
    """The unit is left for the next run, and no user has to copy an intact file again."""
    path, whole = written("npz")

    def failing(*_, **__):
        raise fault

    monkeypatch.setattr("turnout.readers.npz.np.load", failing)
    with pytest.raises((OSError, MemoryError)) as caught:
        read(path.name, path.parent, in_si)
    assert is_infrastructure(caught.value)
    monkeypatch.undo()
    assert_unchanged(read(path.name, path.parent, in_si).recordings, whole)


def test_a_bad_sector_at_the_start_of_a_file_is_not_reported_as_damage(written, in_si, monkeypatch):
    path, _ = written("npz")

    def failing(*_):
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patched, pytest.raises(OSError) as caught:
        patched.setattr("turnout.readers.source.os.fstat", failing)
        read(path.name, path.parent, in_si)
    assert is_infrastructure(caught.value)


def test_an_array_beyond_the_size_of_its_file_is_damage_and_no_lack_of_memory(in_si, tmp_path):
    """The length in its header means 80 TB."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 5000000000000), }".ljust(117) + b"\n"
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("record_000.npy", b"\x93NUMPY\x01\x00v\x00" + header + bytes(800))
    (error,) = read("a.npz", tmp_path, in_si).errors
    assert (
        error.reason == "claims_too_much"
        and error.problem == "its header claims (2, 5000000000000) values, in 928 bytes"
    )


@pytest.mark.parametrize("text", ["errno = 22, error message = 'Invalid argument'", "errno = 2 of the wheel", "errno"])
def test_an_error_of_a_library_because_of_damaged_bytes_is_reported_as_damage(text, written, in_si, monkeypatch):
    path, _ = written("hdf5")

    def failing(*_, **__):
        raise OSError(f"Unable to read (file seek failed: {text})")

    monkeypatch.setattr("turnout.readers.hdf5._values", failing)
    assert {e.reason for e in outcome(path, in_si)[1]} == {"unreadable"}
