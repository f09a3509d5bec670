"""Check the sizes that a raw file declares before memory is allocated for it, and that its samples are in it.

A header of some bytes may claim arrays of gigabytes. What a file claims, as it is stored, may be ``MAX_EXPANSION``
times its size plus ``FREE_CLAIM``. An HDF5 file may also name other files as the place of its samples. These are not
read, because they may be outside the raw root and change while the hash of the file stays the same.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from turnout.readers.entries import UnreadObject
from turnout.readers.source import MAX_COMPRESSION_RATIO, Source

MAX_EXPANSION = 6  # claimed bytes per byte of the file: packed samples reach 2 to 4
FREE_CLAIM = 128 * 2**20  # bytes that a file of any size may claim: a long record of zeros packs well
MAX_COLUMNS = 4096  # columns of a text or Parquet file: each costs kilobytes, whatever it holds
REMEDY = "Copy the file again from the logger; if it is whole, export it unpacked or in shorter records"
ELSEWHERE_REMEDY = "Export the samples into the file itself"


def check_declared_sizes(format_module: str, source: Source) -> None:
    """Stop before a reader allocates more memory than a file of this size can hold, or opens another file.

    The other readers check with the file that they have opened: HDF5, Parquet, and MATLAB 5 as it is unpacked.

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
    if format_module == "mat" and source.head.startswith(b"MATLAB 7.3"):
        import h5py

        with source.parsed_by("HDF5"), h5py.File(source.path, "r") as file:
            check_hdf5(file, source)
    elif check := CHECKS.get(format_module):
        check(source)


def check_size(n_byte: float, source: Source, where: str) -> None:
    """Stop if a number of bytes is more than a file of this size may claim.

    Parameters
    ----------
    n_byte : float
        Bytes that the file claims, unpacked.
    source : Source
        The raw file.
    where : str
        Position in the file, for the message.

    Raises
    ------
    ReadError
        If it is more.
    """
    # a lazy column is read in blocks, so that only the bound of the compression counts
    limit = (MAX_COMPRESSION_RATIO if source.lazy else MAX_EXPANSION) * source.size + FREE_CLAIM
    if n_byte > limit:
        problem = f"it claims {n_byte:.3g} bytes of samples, in a file of {source.size} bytes"
        raise source.error(where, problem, REMEDY, reason="claims_too_much")


def _npz(source: Source) -> None:
    """The sizes in the directory of the archive; the header of an array is checked with it, see ``read_array``."""
    total = 0
    with source.parsed_by("zipfile"), zipfile.ZipFile(source.path) as archive:
        for member in archive.infolist():
            check_size(total := total + member.file_size, source, f"variable {member.filename!r}")


# Loading them would run code of the file.
PYTHON_OBJECTS = UnreadObject(
    "array of Python objects", "Save it as numbers or as text, for example x=json.dumps(x)", is_matlab=False
)


def read_array(archive: zipfile.ZipFile, name: str, source: Source) -> np.ndarray | bytes | UnreadObject:
    """An array of a NumPy archive, whose header must not claim more values than the array has bytes.

    Parameters
    ----------
    archive : zipfile.ZipFile
        The NumPy archive.
    name : str
        Name of the array, without its extension.
    source : Source
        The raw file.

    Returns
    -------
    (...) array, bytes or UnreadObject
        The numbers, read-only; the bytes of a member that is no array; ``PYTHON_OBJECTS`` for pickled ones.

    Raises
    ------
    ReadError
        If it claims more. Other arrays of the archive are not concerned.
    ValueError
        If the header cannot be read.
    """
    file_name = name if name in archive.NameToInfo else f"{name}.npy"
    member = archive.getinfo(file_name)
    if member.compress_size > source.size:
        problem = f"it claims {member.compress_size} packed bytes, in a file of {source.size} bytes"
        raise source.error(f"variable {name!r}", problem, REMEDY, reason="claims_too_much")
    data = archive.read(file_name)
    if not data.startswith(np.lib.format.MAGIC_PREFIX):
        return data
    stream = io.BytesIO(data)
    shape, is_fortran_order, dtype = _npy_header(stream)
    if dtype.hasobject:
        return PYTHON_OBJECTS
    count, start = math.prod(shape), stream.tell()
    if count * dtype.itemsize > len(data) - start:
        problem = f"its header claims {shape} values, in {len(data)} bytes"
        raise source.error(f"variable {name!r}", problem, REMEDY, reason="claims_too_much")
    values = np.frombuffer(data, dtype, count, start)
    return values.reshape(shape[::-1]).T if is_fortran_order else values.reshape(shape)


def _npy_header(stream: io.BytesIO) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, whether the first index runs fastest, and type of the values of an array in NumPy's format."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(stream)


class Hdf5SizeCheck:
    """What the datasets of an HDF5 file claim together, and whether their values are in the file itself.

    Parameters
    ----------
    source : Source
        The raw file.
    """

    def __init__(self, source: Source):
        self.source, self.total = source, 0

    def check_link(self, group: Any, name: bytes, path: str) -> bool:
        """Check the link to a member of a group without following it.

        Parameters
        ----------
        group : h5py.h5g.GroupID
            The group.
        name : bytes
            Name of the member.
        path : str
            Its path, for the message.

        Returns
        -------
        bool
            Whether it is a hard link, to an object of this file.

        Raises
        ------
        ReadError
            If it leads to another file.
        """
        import h5py

        link_type = group.links.get_info(name).type
        if link_type == h5py.h5l.TYPE_EXTERNAL:
            file_name = group.links.get_val(name)[0].decode("utf-8", "replace")
            problem = f"it is a link to the file {file_name!r}"
            raise self.source.error(path, problem, ELSEWHERE_REMEDY, reason="outside_root")
        return link_type == h5py.h5l.TYPE_HARD

    def check_dataset(self, dataset: Any, path: str) -> None:
        """Check a dataset before it is read.

        Parameters
        ----------
        dataset : h5py.h5d.DatasetID
            The dataset.
        path : str
            Its path, for the message.

        Raises
        ------
        ReadError
            If the file claims too much, or the values are in another file.
        """
        import h5py

        if problem := _elsewhere(dataset):
            raise self.source.error(f"dataset {path!r}", problem, ELSEWHERE_REMEDY, reason="outside_root")
        number_type = dataset.get_type()
        if number_type.get_class() == h5py.h5t.FLOAT and not _is_ieee(number_type):
            problem = "the description of its floating-point numbers is that of no IEEE 754 format"
            raise self.source.error(f"dataset {path!r}", problem)
        space = dataset.get_space()
        if space.get_simple_extent_type() != h5py.h5s.NULL:
            self.total += space.get_simple_extent_npoints() * number_type.get_size()
        check_size(self.total, self.source, f"dataset {path!r}")


def _is_ieee(number_type: Any) -> bool:
    """Whether a floating-point type is one of IEEE 754 in either byte order; damage of its header makes another one."""
    import h5py

    bits = 8 * number_type.get_size()
    names = (f"IEEE_F{bits}{order}" for order in ("LE", "BE"))
    return any(number_type.equal(getattr(h5py.h5t, name)) for name in names if hasattr(h5py.h5t, name))


def open_hdf5(source: Source) -> AbstractContextManager[Any]:
    """The HDF5 file as a context; with a lazy source the datasets keep it open.

    Parameters
    ----------
    source : Source
        The HDF5 file.

    Returns
    -------
    context manager of h5py.File
        The open file.
    """
    import h5py

    file = h5py.File(source.path, "r")
    return nullcontext(file) if source.lazy else file


def check_hdf5(file: Any, source: Source) -> None:
    """Check all datasets; links to other files, external storage and virtual datasets are found without following them.

    Parameters
    ----------
    file : h5py.File
        The open file.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If the file claims too much, or its samples are in another file.
    """
    import h5py

    size_check, addresses = Hdf5SizeCheck(source), set()

    def walk(group: Any, above: str) -> None:
        for name in group:
            path = f"{above}/{name.decode('utf-8', 'replace')}"
            if not size_check.check_link(group, name, path):
                continue
            try:
                info = h5py.h5o.get_info(group, name)
                if info.addr in addresses or info.type not in (h5py.h5o.TYPE_GROUP, h5py.h5o.TYPE_DATASET):
                    continue
                member = h5py.h5o.open(group, name)
            except (KeyError, OSError, RuntimeError, ValueError):  # damaged: its reader reports it
                continue
            addresses.add(info.addr)
            if info.type == h5py.h5o.TYPE_GROUP:
                walk(member, path)
            else:
                size_check.check_dataset(member, path)

    root = h5py.h5g.open(file.id, b"/")
    addresses.add(h5py.h5o.get_info(root).addr)
    walk(root, "")


def _elsewhere(dataset: Any) -> str:
    """Where the values of a dataset are, if not in its own file."""
    import h5py

    creation = dataset.get_create_plist()
    if creation.get_external_count():
        file_name = creation.get_external(0)[0].decode("utf-8", "replace")
        return f"its values are in the file {file_name!r}"
    if creation.get_layout() == h5py.h5d.VIRTUAL:
        names = {creation.get_virtual_filename(i) for i in range(creation.get_virtual_count())}
        files = sorted(names - {"."})
        return f"its values are in the file {files[0]!r}" if files else ""
    return ""


def check_parquet(metadata: Any, source: Source) -> None:
    """Check rows and columns of the metadata: repeated values take no space in the file.

    Parameters
    ----------
    metadata : pyarrow.parquet.FileMetaData
        Metadata of the open file.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If the file claims too much.
    """
    _check_columns(metadata.num_columns, source)
    sizes = sum(metadata.row_group(k).total_byte_size for k in range(metadata.num_row_groups))
    check_size(max(sizes, 8 * metadata.num_rows * metadata.num_columns), source, "the metadata")


def _wav(source: Source) -> None:
    """Frames of a FLAC file: WAV is not packed, and its chunks are compared with the size of the file."""
    if source.head[:4] == b"fLaC":
        fields = int.from_bytes(source.head[18:26], "big")  # rate 20, channels 3, bits 5, frames 36 bits
        n_channel, n_frame = (fields >> 41 & 7) + 1, fields & (1 << 36) - 1
        check_size(4 * n_channel * n_frame, source, "the header")


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
        lines += file.readline(2**22).splitlines()  # also where a carriage return alone ends a line
    _check_columns(max(max(line.count(c) for c in (b",", b";", b"\t", b"|")) + 1 for line in lines), source)


def _check_columns(n_column: int, source: Source) -> None:
    if n_column > MAX_COLUMNS:
        remedy = "Write one column per channel, one row per sample"
        problem = f"it has {n_column} columns, at most {MAX_COLUMNS} are read"
        raise source.error("the file", problem, remedy, reason="claims_too_much")


CHECKS = {"npz": _npz, "wav": _wav, "lvm": _lvm, "csv": _csv}
