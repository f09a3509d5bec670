"""Writer of MATLAB version 7.3: HDF5 with MATLAB's header, classes and reversed axes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from turnout.readers.writing.encode import RecordToWrite, variables
from turnout.readers.writing.hdf5_content import hdf5_content

HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan 01 00:00:00 2024 HDF5 schema 1.00 ."


def write_raw(records: Sequence[RecordToWrite], path: Path) -> None:
    """Write ``record_000`` ... as (sample, channel) matrices, and named variables; text in cell arrays.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    """
    with hdf5_content(path, userblock_size=512) as file:
        for name, value in variables(records).items():
            cells = isinstance(value, list) and isinstance(value[0], str)
            (_cell if cells else _double)(file, name, value)
        for k, record in enumerate(records):
            _double(file, f"record_{k:03d}", np.vstack(record.samples))
    with path.open("r+b") as file:
        file.write(HEADER.ljust(116) + bytes(8) + b"\x00\x02IM")


def _double(file: h5py.File, name: str, value: Any) -> None:
    value = np.atleast_2d(np.asarray(value))
    dataset = file.create_dataset(name, data=value, chunks=value.shape, fletcher32=True)
    dataset.attrs["MATLAB_class"] = np.bytes_("single" if value.dtype == np.float32 else "double")


def _cell(file: h5py.File, name: str, texts: Sequence[str]) -> None:
    references = file.require_group("#refs#")
    cell = file.create_dataset(name, (len(texts), 1), dtype=h5py.ref_dtype)
    cell.attrs["MATLAB_class"] = np.bytes_("cell")
    for i, text in enumerate(texts):
        letters = np.array([ord(c) for c in text], dtype="uint16")[:, None]
        letters_dataset = references.create_dataset(f"{name}_{i}", data=letters)
        letters_dataset.attrs["MATLAB_class"] = np.bytes_("char")
        letters_dataset.attrs["MATLAB_int_decode"] = np.int32(2)
        cell[i, 0] = letters_dataset.ref
