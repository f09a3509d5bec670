"""Check what a raw file claims before memory is allocated for it, and that it keeps its samples in itself.

A header of some bytes may claim arrays of gigabytes. What a file claims, as it is stored, may be ``MAX_EXPANSION``
times its size plus ``FREE_CLAIM``. An HDF5 file may also name other files as the place of its samples. These are not
read, because they may be outside the raw root and change while the hash of the file stays the same.
"""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

from turnout.readers.source import MAX_COMPRESSION_RATIO, Source

MAX_EXPANSION = 6  # claimed bytes per byte of the file: packed samples reach 2 to 4
FREE_CLAIM = 128 * 2**20  # bytes that a file of any size may claim: a long record of zeros packs well
MAX_COLUMNS = 4096  # columns of a text or Parquet file: each costs kilobytes, whatever it holds
REMEDY = "Copy the file again from the logger; if it is whole, export it unpacked or in shorter records"
ELSEWHERE_REMEDY = "Export the samples into the file itself"
MAT_HEADER, MAT_COMPRESSED, MAT_MATRIX = 128, 15, 14  # bytes; types of elements in MATLAB 5
MAX_MAT_DEPTH = 64  # of cells and structures in each other
BLOCK = 2**16  # bytes that are unpacked at a time


def check_claims(format_module: str, source: Source) -> None:
    """Stop before a reader allocates more memory than a file of this size can hold, or opens another file.

    Parameters
    ----------
    format_module : str
        Module of the reader.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If the file claims too much, or its samples are in another file.
    """
    hdf5 = format_module in ("hdf5", "rcmdx") or (format_module == "mat" and source.head.startswith(b"MATLAB 7.3"))
    check = _hdf5 if hdf5 else CHECKS.get(format_module)
    if check:
        check(source)


def _check(n_byte: float, source: Source, where: str) -> None:
    """ReadError if ``n_byte`` is more than a file of this size may claim."""
    # a lazy column is read in blocks, so that only the bound of the compression counts
    limit = (MAX_COMPRESSION_RATIO if source.lazy else MAX_EXPANSION) * source.size + FREE_CLAIM
    if n_byte > limit:
        problem = f"it claims {n_byte:.3g} bytes of samples, in a file of {source.size} bytes"
        raise source.error(where, problem, REMEDY, reason="claims_too_much")


def _npz(source: Source) -> None:
    """The sizes in the directory of the archive; the header of an array is checked with it, see ``check_array``."""
    total = 0
    with source.parsed_by("zipfile"), zipfile.ZipFile(source.path) as archive:
        for member in archive.infolist():
            _check(total := total + member.file_size, source, f"variable {member.filename!r}")


def check_array(archive: zipfile.ZipFile, name: str, source: Source) -> None:
    """Stop before an array of a NumPy archive is read whose header claims more values than the array has bytes.

    Parameters
    ----------
    archive : zipfile.ZipFile
        The NumPy archive.
    name : str
        Name of the array, without its extension.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If it does. Other arrays of the archive are not concerned.
    """
    member = next((m for m in archive.infolist() if m.filename.removesuffix(".npy") == name), None)
    if member is None:  # no array in NumPy's format, which its reader reports
        return
    with archive.open(member) as stream:
        shape, itemsize = _npy_claim(stream)
    if math.prod(shape) * itemsize > member.file_size:
        problem = f"its header claims {shape} values, in {member.file_size} bytes"
        raise source.error(f"variable {name!r}", problem, REMEDY, reason="claims_too_much")


def _npy_claim(stream: Any) -> tuple[tuple[int, ...], int]:
    """Shape and bytes per value of an array in NumPy's format; no values if it is none, which its reader reports."""
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(stream)
    except (ValueError, OSError, EOFError, zlib.error, zipfile.BadZipFile):
        return (0,), 0
    return shape, 0 if dtype.hasobject else dtype.itemsize


def _hdf5(source: Source) -> None:
    """All datasets; links to other files, external storage and virtual datasets are found without following them."""
    import h5py

    total, seen = 0, set()

    def members(group: Any) -> Iterator[tuple[str, Any]]:
        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                problem = f"it is a link to the file {link.filename!r}"
                raise source.error(f"{group.name}/{name}", problem, ELSEWHERE_REMEDY, reason="outside_root")
            if isinstance(link, h5py.HardLink):
                yield name, link

    def walk(group: Any) -> None:
        nonlocal total
        for name, _ in members(group):
            if group.get(name, getclass=True) not in (h5py.Group, h5py.Dataset):
                continue
            try:
                member = group[name]
            except (KeyError, OSError, RuntimeError, ValueError):  # damaged: its reader reports it
                continue
            address = h5py.h5o.get_info(member.id).addr
            if address in seen:
                continue
            seen.add(address)
            if isinstance(member, h5py.Group):
                walk(member)
                continue
            if problem := _elsewhere(member):
                raise source.error(f"dataset {member.name!r}", problem, ELSEWHERE_REMEDY, reason="outside_root")
            total += member.size * member.dtype.itemsize if member.shape is not None else 0
            _check(total, source, f"dataset {member.name!r}")

    with source.parsed_by("HDF5"), h5py.File(source.path, "r") as file:
        seen.add(h5py.h5o.get_info(file["/"].id).addr)
        walk(file)


def _elsewhere(dataset: Any) -> str:
    """Where the values of a dataset are, if not in its own file."""
    if dataset.external:
        return f"its values are in the file {dataset.external[0][0]!r}"
    if dataset.is_virtual:
        files = sorted({piece.file_name for piece in dataset.virtual_sources()} - {"."})
        return f"its values are in the file {files[0]!r}" if files else ""
    return ""


def _mat(source: Source) -> None:
    """The elements of a MATLAB 5 file: none may claim more bytes than the element or file that it is in."""
    order = "<" if source.head[126:128] == b"IM" else ">"
    total, position = 0, MAT_HEADER
    with source.path.open("rb") as file:
        while position + 8 <= source.size:
            where = f"the variable at byte {position}"
            file.seek(position)
            kind, length = _mat_tag(file.read(8), order)
            if kind == MAT_COMPRESSED:
                stream = _Unpacked(file, min(length, source.size - position - 8))
                kind_inside, length_unpacked = _mat_tag(stream.read(8), order)
                _check(total := total + length_unpacked, source, where)
                if kind_inside == MAT_MATRIX:
                    _check_mat_parts(stream, length_unpacked, order, source, where)
            elif kind == MAT_MATRIX:
                # a file that was cut ends within its last element, which its reader reports
                _check_mat_parts(_Plain(file), length, order, source, where)
            position += 8 + length


def _check_mat_parts(stream: _Plain | _Unpacked, length: int, order: str, source: Source, where: str) -> None:
    """ReadError if a part of a matrix claims more bytes than the rest of the matrix; parts may be matrices again."""
    ends, position = [length], 0
    while ends and len(ends) <= MAX_MAT_DEPTH:
        if position + 8 > ends[-1]:
            ends.pop()
            continue
        kind, n_byte = _mat_tag(stream.read(8), order)
        position += 8
        if kind == 0 and n_byte == 0:  # the end of damaged or cut data, or an empty part
            continue
        if kind >> 16:  # up to four bytes in the tag itself
            continue
        if n_byte > ends[-1] - position:
            problem = f"a part of it claims {n_byte} bytes, where {ends[-1] - position} are left"
            raise source.error(where, problem, REMEDY, reason="claims_too_much")
        if kind == MAT_MATRIX:
            ends.append(position + n_byte)
            continue
        n_padded = min(n_byte + -n_byte % 8, ends[-1] - position)
        if not stream.skip(n_padded):
            return
        position += n_padded


def _mat_tag(tag: bytes, order: str) -> tuple[int, int]:
    """Type and length of an element; zeros where the bytes end."""
    kind, length = np.frombuffer(tag.ljust(8, b"\0"), f"{order}u4")
    return int(kind), int(length)


class _Plain:
    """The bytes of an open file from its present position on."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file

    def read(self, n: int) -> bytes:
        return self.file.read(n)

    def skip(self, n: int) -> bool:
        """Whether there may be bytes behind."""
        self.file.seek(n, 1)
        return True


class _Unpacked:
    """The unpacked bytes of ``n_packed`` bytes of an open file; they end where these are damaged."""

    def __init__(self, file: BinaryIO, n_packed: int) -> None:
        self.file, self.n_packed, self.unpacker = file, n_packed, zlib.decompressobj()

    def read(self, n: int) -> bytes:
        pieces = []
        while n > 0 and (piece := self._next(n)):
            pieces.append(piece)
            n -= len(piece)
        return b"".join(pieces)

    def skip(self, n: int) -> bool:
        """Whether all these bytes were there."""
        while n > 0 and (piece := self._next(min(n, BLOCK))):
            n -= len(piece)
        return n <= 0

    def _next(self, n: int) -> bytes:
        """At least one byte, at most ``n``; none at the end."""
        try:
            while not (piece := self.unpacker.decompress(self._packed_bytes(), n)):
                if not self.n_packed and not self.unpacker.unconsumed_tail:
                    return b""
        except zlib.error:
            self.n_packed = 0
            return b""
        return piece

    def _packed_bytes(self) -> bytes:
        if self.unpacker.unconsumed_tail:
            return self.unpacker.unconsumed_tail
        packed = self.file.read(min(BLOCK, self.n_packed))
        self.n_packed = self.n_packed - len(packed) if packed else 0
        return packed


def _parquet(source: Source) -> None:
    """Rows and columns of the metadata: repeated values take no space in the file."""
    import pyarrow.parquet as pq

    with source.parsed_by("pyarrow"):
        metadata = pq.read_metadata(source.path)
    _check_columns(metadata.num_columns, source)
    sizes = sum(metadata.row_group(k).total_byte_size for k in range(metadata.num_row_groups))
    _check(max(sizes, 8 * metadata.num_rows * metadata.num_columns), source, "the metadata")


def _wav(source: Source) -> None:
    """Frames of a FLAC file: WAV is not packed, and its chunks are compared with the size of the file."""
    if source.head[:4] == b"fLaC":
        fields = int.from_bytes(source.head[18:26], "big")  # rate 20, channels 3, bits 5, frames 36 bits
        n_channel, n_frame = (fields >> 41 & 7) + 1, fields & (1 << 36) - 1
        _check(4 * n_channel * n_frame, source, "the header")


def _lvm(source: Source) -> None:
    """The number of channels of each segment: a channel takes at least a separator in the file."""
    for match in re.finditer(rb"\nChannels\s+(\d+)", source.data):
        if (count := int(match[1][:18])) > source.size:
            where = f"byte {match.start() + 1}"
            raise source.error(where, f"it claims {count} channels", REMEDY, reason="claims_too_much")


def _csv(source: Source) -> None:
    """Columns of the first lines."""
    lines = source.head.splitlines()[:-1] or [source.head]
    with source.path.open("rb") as file:
        lines.append(file.readline(2**22))
    _check_columns(max(max(line.count(c) for c in (b",", b";", b"\t")) + 1 for line in lines), source)


def _check_columns(n_column: int, source: Source) -> None:
    if n_column > MAX_COLUMNS:
        remedy = "Write one column per channel, one row per sample"
        problem = f"it has {n_column} columns, at most {MAX_COLUMNS} are read"
        raise source.error("the file", problem, remedy, reason="claims_too_much")


CHECKS = {"npz": _npz, "mat": _mat, "parquet": _parquet, "wav": _wav, "lvm": _lvm, "csv": _csv}
