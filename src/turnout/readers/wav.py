"""Reader of WAV, RF64 and FLAC: one continuous record.

libsndfile reads a truncated file without an error. Therefore the file size is compared with the chunk sizes in the
header. Integers (16, 24 bit) are read as fractions of full scale, -1 to 1: set ``unit: 10 V`` in the layout if full
scale is 10 V; a unit without a number is an error. Of 24 valid bits in 32, full scale is that of the valid bits, be
they the high or the low ones. Floating-point numbers above 1 are no fractions: a layout with such a unit rejects them.
Metadata in a JSON comment are used (``channels``, ``units``, ``started_at``, conditions).
"""

import json
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import soundfile

from turnout.readers.array_metadata import Metadata, list_of_texts
from turnout.readers.array_names import channel_names
from turnout.readers.entries import FREE_TEXT, Entry, entries_of, entries_of_text, rate_entry
from turnout.readers.lazy import LazyMatrix
from turnout.readers.metadata_names import START_NAMES, UNIT_NAMES
from turnout.readers.source import BLOCK_SIZE, COPY_AGAIN, HEAD_SIZE, RawFile, RawRecord, Source
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import entry_statements

UNKNOWN_LENGTH = 0xFFFFFFFF
PCM, EXTENSIBLE = 1, 0xFFFE
UNCOMPRESSED = (PCM, 3, EXTENSIBLE)  # 3: float


def read_raw(source: Source) -> RawFile:
    """The record of an audio file.

    Parameters
    ----------
    source : Source
        The audio file.

    Returns
    -------
    RawFile
        Its only record.

    Raises
    ------
    ReadError
        If the file is truncated or libsndfile cannot read it.
    """
    with source.path.open("rb", buffering=0) as raw:  # libsndfile shares its position
        if truncation := find_truncation(raw, source.size):
            raise source.error("the header", truncation, COPY_AGAIN, reason="truncated")
        further = _further_chunks(raw, source.size) if source.head[:4] in (b"RIFF", b"RF64") else {}
        with source.parsed_by("libsndfile"):
            n_empty, is_stated = _empty_bits(source.head, raw)
        raw.seek(0)
        with source.parsed_by("libsndfile"), soundfile.SoundFile(raw.fileno(), closefd=False) as file:
            if not file.subtype.startswith(LOSSLESS):
                problem = f"its samples are compressed with loss ({file.subtype_info})"
                raise source.error("the header", problem, "Let the logger write PCM or floating-point numbers")
            rate, comment, is_float = file.samplerate, file.comment, file.subtype in FLOAT_SUBTYPES
            texts = {name: text for name, text in file.copy_metadata().items() if text}
            frames = Frames(source.path, file.frames, file.channels, 2.0**n_empty if is_stated else 1.0)
            samples = (
                LazyMatrix(frames, transposed=True)
                if source.lazy
                else file.read(dtype="float64", always_2d=True).T * frames.scale
            )
    if samples.shape[1] != frames.shape[0]:
        problem = f"ends after {samples.shape[1]} of {frames.shape[0]} samples"
        raise source.error("record 1 of 1", problem, COPY_AGAIN, reason="truncated")
    byte_rate = _byte_rate_entries(source.head)
    facts = Metadata(_notes(comment), source)
    n = len(samples)
    names, units = channel_names(facts), list_of_texts(facts.get(UNIT_NAMES))
    entries = (*_entries(texts, comment), *_further_entries(further))
    record = RawRecord(
        names=tuple(names) if len(names) == n else tuple(str(i) for i in range(n)),
        samples=list(samples),
        entries=(rate_entry("sample rate of the header", rate), *byte_rate, *entries),
        units=tuple(units) if len(units) == n else ("",) * n,
        **start_fields(
            facts.record_value(START_NAMES, 0, 1),
            _broadcast_start(further.get(b"bext", b"")),
            declared=facts.label_of(START_NAMES),
        ),
        conditions=facts.conditions(0, 1),
        aliases=tuple((str(i),) for i in range(n)),
        undecided=entry_statements(entries, names if len(names) == n else [str(i) for i in range(n)]),
        audio="floating" if is_float else "whole",
    )
    remarks = []
    if n_empty and not is_stated:
        problem = f"none of its numbers needs the highest {n_empty} of 32 bits: they may be codes of a converter"
        remedy = f"If they are, multiply full scale in the layout by {2**n_empty}, such as 'unit: {10 * 2**n_empty} V'"
        remarks.append(source.error("the samples", problem, remedy, reason="entry_unknown"))
    if comment.lstrip().startswith("{") and not _is_json(comment):
        problem = (
            f"its comment {comment.strip()[:40]!r} begins like JSON and cannot be decoded: names and times are lost"
        )
        remarks.append(source.error("the comment", problem, COPY_AGAIN, reason="condition_lost"))
    return RawFile((record,), None, tuple(remarks))


FLOAT_SUBTYPES = ("FLOAT", "DOUBLE")
LOSSLESS = ("PCM", *FLOAT_SUBTYPES)


@dataclass(frozen=True)
class Frames:
    """``n_frame`` frames of ``n_channel`` channels of an audio file; it is sliced like an array (frame, channel).

    ``scale`` converts fractions of the range of the stored numbers to fractions of full scale.
    """

    path: Path
    n_frame: int
    n_channel: int
    scale: float = 1.0
    dtype = np.dtype(float)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of frames and of channels."""
        return self.n_frame, self.n_channel

    def __getitem__(self, selection: slice) -> np.ndarray:
        start, stop, _ = selection.indices(self.n_frame)
        with soundfile.SoundFile(self.path) as file:
            file.seek(start)
            return file.read(stop - start, dtype="float64", always_2d=True) * self.scale


def find_truncation(file: BinaryIO, size: int) -> str:
    """Follow the chunks of a RIFF file to its end.

    Parameters
    ----------
    file : BinaryIO
        The open file.
    size : int
        Its size. [bytes]

    Returns
    -------
    str
        Where it is truncated; "" for a complete file and for other formats.
    """
    head = file.read(36)
    if head[:4] not in (b"RIFF", b"RF64"):
        return ""
    if len(head) < 12:
        return f"the file ends after {size} bytes, before its samples"
    long_sizes = _long_sizes(head)
    file.seek(0)
    bytes_per_frame = _frame_sizes(file.read(HEAD_SIZE))[1] or 1
    position, has_samples = 12, False
    while position + 8 <= size:
        file.seek(position)
        tag, length = struct.unpack("<4sI", file.read(8))
        length = long_sizes.get(tag, length) if length == UNKNOWN_LENGTH else length
        if tag == b"data" and length in (0, UNKNOWN_LENGTH):
            return "the chunk of samples was never finished by the logger"
        if position + 8 + length > size:
            return f"its chunk {tag.decode('latin-1')!r} ends after {size - position - 8} of {length} bytes"
        if tag == b"data" and (n_more := length % bytes_per_frame):
            return f"its samples end within a frame, {n_more} bytes after its beginning"
        has_samples = has_samples or tag == b"data"
        if tag == b"RIFF" or not tag.decode("latin-1").isprintable() or not tag.isascii():
            return f"at byte {position} {tag!r} is no chunk of one file: bytes were inserted or another file appended"
        position += 8 + length + length % 2
    if 0 < size - position:
        return f"it has {size - position} bytes behind its last chunk: inserted bytes shift the samples behind them"
    if not has_samples:
        return f"the file ends after {size} bytes, before its samples"
    expected_size = 8 + long_sizes.get(b"RIFF", struct.unpack_from("<I", head, 4)[0])
    return f"it ends after {size} of {expected_size} bytes" if expected_size > size + 1 else ""


N_CONVERTER_BITS = 24  # of most converters, whose numbers are stored in 32 bits


def _empty_bits(head: bytes, file: BinaryIO) -> tuple[int, bool]:
    """Number of high bits that whole numbers leave empty, and whether the header states as many.

    The header may state fewer valid bits than a sample has, 24 of 32. They have to be the high ones. A logger that
    puts them into the low ones writes numbers with set bits there, none of which needs a high bit. So do the codes of a
    converter in 32 bits, of which the header says nothing.
    """
    position = head.find(b"fmt ", 12)
    if head[:4] not in (b"RIFF", b"RF64") or position < 0 or len(head) < position + 34:
        return 0, False
    tag, _, _, _, _, n_bit, _, n_valid = struct.unpack_from("<HHIIHHHH", head, position + 8)
    code = struct.unpack_from("<H", head, position + 32)[0] if tag == EXTENSIBLE else tag
    is_stated = tag == EXTENSIBLE and 0 < n_valid < n_bit
    n_valid = n_valid if is_stated else N_CONVERTER_BITS
    if code != PCM or n_bit not in (16, 24, 32) or n_valid >= n_bit:
        return 0, False
    uses_low_bits = False
    file.seek(0)
    with soundfile.SoundFile(file.fileno(), closefd=False) as sound:
        for block in sound.blocks(BLOCK_SIZE, dtype="int32", always_2d=True):
            numbers = block >> (32 - n_bit)  # libsndfile fills 32 bits from the top
            if np.any(numbers >= 1 << (n_valid - 1)) or np.any(numbers < -(1 << (n_valid - 1))):
                return 0, False
            uses_low_bits |= bool(np.any(numbers & ((1 << (n_bit - n_valid)) - 1)))
    return (n_bit - n_valid, is_stated) if uses_low_bits else (0, False)


FURTHER_CHUNKS = (b"iXML", b"bext")  # of field recorders: XML, and the broadcast extension (EBU Tech 3285)
MAX_CHUNK_SIZE = 2**20  # bytes of such a chunk that are read


def _further_chunks(file: BinaryIO, size: int) -> dict[bytes, bytes]:
    """Contents of the chunks that field recorders add, by their tag."""
    chunks: dict[bytes, bytes] = {}
    file.seek(0)
    long_sizes, position = _long_sizes(file.read(36)), 12
    while position + 8 <= size:
        file.seek(position)
        tag, length = struct.unpack("<4sI", file.read(8))
        length = long_sizes.get(tag, length) if length == UNKNOWN_LENGTH else length
        if tag in FURTHER_CHUNKS:
            chunks[tag] = file.read(min(length, MAX_CHUNK_SIZE))
        position += 8 + length + length % 2
    return chunks


# Fields of the chunk "bext": first byte and size.
DESCRIPTION, DATE, TIME = (0, 256), (320, 10), (330, 8)
CODING_HISTORY = 602  # first byte


def _field_text(chunk: bytes, field: tuple[int, int]) -> str:
    start, size = field
    return chunk[start : start + size].partition(b"\0")[0].decode("utf-8", "replace").strip()


def _broadcast_start(chunk: bytes) -> str | None:
    """Start time in the chunk "bext"."""
    date, clock = _field_text(chunk, DATE), _field_text(chunk, TIME)
    return f"{re.sub('[_:/ .]', '-', date)} {re.sub('[_/. -]', ':', clock)}" if date and clock else None


def _further_entries(chunks: dict[bytes, bytes]) -> Iterator[Entry]:
    """Entries of the further chunks; "F=48000" in the coding history is a rate in Hz."""
    xml = chunks.get(b"iXML", b"").decode("utf-8", "replace")
    for name, value in re.findall(r"<(\w+)>\s*([^<>]{1,200}?)\s*</\1>", xml):
        yield Entry(f"chunk iXML: {name}", name, value)
    chunk = chunks.get(b"bext", b"")
    description = _field_text(chunk, DESCRIPTION)
    yield from entries_of_text(description, "chunk bext: description")
    yield Entry("chunk bext: description", FREE_TEXT, description)
    for rate in re.findall(r"\bF=(\d{3,9})\b", chunk[CODING_HISTORY:].decode("ascii", "replace")):
        yield rate_entry("chunk bext: coding history", int(rate))


def _long_sizes(head: bytes) -> dict[bytes, int]:
    """Sizes above 4 GiB, from the chunk ds64 of an RF64 file."""
    if head[:4] != b"RF64" or head[12:16] != b"ds64" or len(head) < 36:
        return {}
    riff, samples = struct.unpack_from("<QQ", head, 20)
    return {b"RIFF": riff, b"data": samples}


def _frame_sizes(head: bytes) -> tuple[int, int]:
    """Bytes per second and per frame, which the chunk "fmt " states; (0, 0) for compressed samples and without it."""
    position = head.find(b"fmt ", 12)
    if head[:4] not in (b"RIFF", b"RF64") or position < 0 or len(head) < position + 24:
        return 0, 0
    tag, _, _, bytes_per_second, bytes_per_frame = struct.unpack_from("<HHIIH", head, position + 8)
    return (bytes_per_second, bytes_per_frame) if tag in UNCOMPRESSED else (0, 0)


def _byte_rate_entries(head: bytes) -> list[Entry]:
    """The rate by bytes per second and per frame, which the chunk "fmt " states beside the rate itself."""
    bytes_per_second, bytes_per_frame = _frame_sizes(head)
    if not bytes_per_second or not bytes_per_frame:
        return []
    return [rate_entry("bytes per second of the header", bytes_per_second / bytes_per_frame)]


def _entries(texts: dict[str, str], comment: str) -> Iterator[Entry]:
    """Entries of the comment and of the other texts of the file."""
    if notes := _notes(comment):
        yield from entries_of(notes, "comment")
    for name, text in texts.items():
        if name == "date":  # the chunk ICRD: when the recording was made
            yield Entry("chunk ICRD", "recording date", text)
            continue
        if name != "comment" or not notes:
            yield from entries_of_text(text, name)
            yield Entry(name, FREE_TEXT, text)


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except ValueError:
        return False
    return True


def _notes(comment: str) -> dict[str, Any]:
    try:
        notes = json.loads(comment) if comment else {}
    except ValueError:
        return {}
    return notes if isinstance(notes, dict) else {}
