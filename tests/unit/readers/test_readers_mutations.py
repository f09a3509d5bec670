"""Mutated files of every format cause no crash, no other samples, and no loss of metadata without a message."""

import base64
import io
import struct
import zlib

import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.io
from benchmarks.mutations import CHANNELS, cases, intact_recordings

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.lost_entries import KNOWN, similar_name
from turnout.readers.time_texts import parse_time
from turnout.readers.writing import write
from turnout.records import RawChannel, RawDescription

LAYOUT = RawDescription((RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")))


def test_no_mutated_file_is_read_with_other_samples_or_metadata_without_a_message():
    found = list(cases(192, first_seed=50_000))
    bad = [case for case in found if case.outcome in ("crash", "hang", "samples")]
    assert not bad and sum(case.outcome == "metadata" for case in found) <= 1  # 0.2 % of 192 files are 0.4


@pytest.mark.parametrize("format", ["tdms", "mat", "npz", "wav", "lvm", "csv"])
def test_a_misspelt_name_of_a_condition_is_reported(format, hammer_test, tmp_path):
    recordings = hammer_test[:1] if format == "wav" else hammer_test
    path = write(recordings, tmp_path / f"a.{format}", format)
    if format in ("mat", "npz"):  # with checksums: written with the false name
        damaged = {"record_000": hammer_test[0].samples.T, "rail_temqerature": 12.5, "channels": ["force", "rail"]}
        damaged |= {"units": ["N", "m/s²"], "fs": 51200.0}
        (scipy.io.savemat if format == "mat" else lambda p, v: np.savez(p, **v))(path, damaged)
    else:
        path.write_bytes(path.read_bytes().replace(b"rail_temperature", b"rail_temqerature"))
    result = read(path.name, tmp_path, LAYOUT)
    assert len(result.recordings) == (1 if format in ("wav", "mat", "npz") else 4)
    (error,) = [e for e in result.errors if e.reason == "condition_lost"]
    assert "'rail_temqerature'" in str(error) and "nearly the name of the rail_temperature" in str(error)


def test_a_start_time_that_one_record_lacks_is_reported(hammer_test, tmp_path):
    path = write(hammer_test, tmp_path / "a.csv", "csv")
    path.write_text(path.read_text().replace("# started_at_2:", "# begun_2:"))
    (error,) = read(path.name, tmp_path, LAYOUT).errors
    assert error.reason == "start_unknown" and "record 3: it lacks the start time that the other records have" in str(
        error
    )


def test_a_damaged_compressed_matlab_element_is_rejected_before_scipy_parses_it(tmp_path):
    """Formerly, bytes inserted into a compressed element ended the process within scipy."""
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"channels": np.array(["force", "rail"], dtype=object)}, do_compression=True)
    data = bytearray(buffer.getvalue())
    data[190:190] = data[186:190]
    (tmp_path / "a.mat").write_bytes(data)
    with pytest.raises(ReadError, match="damaged"):
        read("a.mat", tmp_path, LAYOUT)


def test_a_matlab_array_with_a_false_size_is_rejected(tmp_path):
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"record_000": np.ones((64, 2))}, do_compression=True)
    data = buffer.getvalue()
    element = bytearray(zlib.decompress(data[136:]))
    at = element.index(struct.pack("<ii", 64, 2))
    element[at : at + 4] = struct.pack("<i", 640)
    packed = zlib.compress(bytes(element))
    (tmp_path / "a.mat").write_bytes(data[:128] + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(ReadError, match="1024 bytes of type 9 for 1280 numbers"):
        read("a.mat", tmp_path, LAYOUT)


DAMAGED = ["rail_temqerature", "started_ad", "operatr", "operatro", "oper4ator", "ail_temperature"]
OTHER_NAMES = ["oil_temperature", "operators", "operators_name", "restart_time", "start_times", "start_time2",
               "train_ids", "rail_temperature", "operator"]  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED + OTHER_NAMES)
def test_a_name_with_one_changed_character_is_found_and_another_word_is_accepted(name):
    assert bool(similar_name(name)) == (name in DAMAGED)


@pytest.mark.parametrize("known", sorted(KNOWN))
def test_every_changed_character_of_a_known_name_is_found_unless_it_is_a_word(known):
    if len(known) < 6:
        pytest.skip("shorter names resemble many")
    for i in range(len(known)):
        names = [known[:i] + "#" + known[i + 1 :], known[:i] + known[i + 1 :], known[:i] + "#" + known[i:]]
        assert all(similar_name(n) or n in KNOWN for n in names), names


@pytest.mark.parametrize(("comment", "is_lost"), [("{}", False), (' {"a": []} ', False), ('{"a": 1', True)])
def test_only_a_comment_that_cannot_be_decoded_is_reported(comment, is_lost, tmp_path):
    import soundfile

    with soundfile.SoundFile(tmp_path / "a.wav", "w", 1000, 1, "DOUBLE") as file:
        file.comment = comment
        file.write(np.sin(np.arange(500.0)))
    channel = RawChannel("rail", 0, "acceleration", unit="g")
    result = read("a.wav", tmp_path, RawDescription((channel,), rate=1000.0))
    assert len(result.recordings) == 1 and [e.reason for e in result.errors] == ["condition_lost"] * is_lost


def test_copies_of_parquet_metadata_that_differ_are_reported(tmp_path):
    """Arrow stores a second copy of the schema in base64; its damage changes the metadata."""
    path = write(intact_recordings("parquet"), tmp_path / "a.parquet", "parquet")
    data = path.read_bytes()
    copy = pq.ParquetFile(path).metadata.metadata[b"ARROW:schema"]
    at = data.index(copy) + base64.b64decode(copy).index(b"train_type") * 4 // 3 + 4
    path.write_bytes(data[:at] + (b"Z" if data[at : at + 1] != b"Z" else b"Y") + data[at + 1 :])
    result = read("a.parquet", tmp_path, RawDescription(CHANNELS))
    assert any("two copies" in error.problem for error in result.errors)


@pytest.mark.parametrize("format", ["csv", "lvm"])
def test_bytes_of_a_header_that_are_no_text_are_reported(format, tmp_path):
    path = write(intact_recordings(format), tmp_path / f"a.{format}", format)
    path.write_bytes(path.read_bytes().replace(b"train_type", b"tr\x14\xd5\x19_type"))
    result = read(path.name, tmp_path, RawDescription(CHANNELS))
    assert len(result.recordings) == 4
    assert "condition_lost" in {error.reason for error in result.errors}


def test_a_start_time_with_other_characters_or_an_unknown_zone_is_not_read():
    assert parse_time("2024-05-13T10:01:17.250000+00:00") is not None
    assert parse_time("2024-05-13T10:01:17.250000l_temp+00:00") is None
    assert parse_time("2024-05-13T10:01:17.250000+00:01") is None
    assert parse_time("2024-05-13T10:01:17+05:45") is not None


@pytest.mark.parametrize("format", ["rcmdx", "mat73"])
def test_numbers_in_another_format_than_ieee_754_are_rejected(format, tmp_path):
    """A changed bit of the description changes every sample; the checksum of the samples omits it."""
    path = write(intact_recordings(format), tmp_path / f"a.{format}", format)
    description = bytes([0x11, 0x20, 0x3F, 0, 8, 0, 0, 0])  # of 64 bit numbers, little endian
    data = path.read_bytes()
    assert description in data
    path.write_bytes(data.replace(description, bytes([0x11, 0x00, *description[2:]])))
    try:
        result = read(path.name, tmp_path, RawDescription(CHANNELS, format=format))
    except ReadError as error:
        assert "IEEE 754" in str(error)
        return
    assert result.recordings == () and "IEEE 754" in str(result.errors[0])
