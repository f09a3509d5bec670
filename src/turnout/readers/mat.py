"""Reader of MATLAB files, versions 5 and 7.3: named variables as in ``turnout.readers.named_arrays``.

pymatreader turns structures into dictionaries and returns both versions in the same form, except that arrays of 7.3
have reversed axes. The number of channels and the longer axis identify the axes.
"""

import io
import re
import warnings
from itertools import zip_longest
from typing import Any

import h5py
import numpy as np
import pymatreader
import scipy.io
import scipy.sparse
from pymatreader.pymatreader import _parse_scipy_mat_dict as parse_loaded_variables
from scipy.io.matlab import matfile_version

from turnout.counts import first_texts
from turnout.readers.array_metadata import Alphabetical
from turnout.readers.channel_descriptions import quantity_of_sensor
from turnout.readers.entries import UnreadObject
from turnout.readers.lazy import LazyColumn, LazyMatrix, is_large, lazy_array
from turnout.readers.mat_elements import HEADER_SIZE, unpacked_file
from turnout.readers.matlab_objects import (
    SUBSYSTEM,
    check_objects,
    class_names,
    matlab_object,
    with_marked_objects,
    with_marked_references,
)
from turnout.readers.metadata_names import TIME_NAMES
from turnout.readers.named_arrays import raw_file
from turnout.readers.source import RawFile, Source
from turnout.readers.unit_names import is_unit_name

SPARSE_MATRIX = UnreadObject(
    "sparse matrix", "Store it with all its zeros in MATLAB before saving, x = full(x)", is_matlab=False
)
MAX_LISTED = 6  # lengths that a message names
VERSION_5, VERSION_73 = 1, 2  # as scipy numbers them


def read_raw(source: Source) -> RawFile:
    """Records of a MATLAB file.

    Parameters
    ----------
    source : Source
        The MATLAB file.

    Returns
    -------
    RawFile
        Its records.

    Raises
    ------
    ReadError
        If the file is truncated, cannot be read, or its variables are no records.
    """
    if source.size < HEADER_SIZE:
        raise source.error("the header", f"the file ends after {source.size} bytes", reason="truncated")
    with source.parsed_by("pymatreader"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # objects that it cannot read are reported by their names
        version = matfile_version(io.BytesIO(source.head[:HEADER_SIZE]))[0]
        large = _lazy_arrays(source) if source.lazy and version == VERSION_73 else {}
        if version == VERSION_5:
            unpacked, objects = unpacked_file(source)
            loaded = scipy.io.loadmat(io.BytesIO(unpacked), struct_as_record=True, squeeze_me=True, mat_dtype=False)
            marks = {name: matlab_object(class_name) for name, class_name in objects.items()}
            variables = parse_loaded_variables(with_marked_objects(loaded)) | marks
        else:
            variables = pymatreader.read_mat(source.path, ignore_fields=[*large, SUBSYSTEM]) | large
            if version == VERSION_73:
                with h5py.File(source.path, "r") as file:
                    variables = with_marked_references(variables, class_names(file))
    mapping_type = Alphabetical if version == VERSION_73 else dict
    plain = _plain_variables({k: v for k, v in variables.items() if not k.startswith("__")}, mapping_type)
    return raw_file(mapping_type(check_objects(plain, source)), source)


def _lazy_arrays(source: Source) -> dict[str, LazyColumn | LazyMatrix]:
    """Arrays of version 7.3 outside structures, which stay in the file. Version 5 cannot be read in parts."""
    file = h5py.File(source.path, "r")  # not closed here: a dataset keeps its file open
    return {
        name: lazy_array(member)
        for name, member in file.items()
        if isinstance(member, h5py.Dataset) and is_large(member) and name.lower() not in TIME_NAMES
    }


def _plain_variables(value: Any, mapping_type: type[dict]) -> Any:
    """The value with dictionaries of ``mapping_type`` and arrays; a structure array becomes channels or records."""
    if scipy.sparse.issparse(value):
        return SPARSE_MATRIX
    if isinstance(value, dict):
        members = _structure_array(value) or _cells_of_channels(value) or value
        members = {name: _plain_variables(v, mapping_type) for name, v in members.items()}
        return mapping_type({name: v for name, v in members.items() if v is not None})
    if isinstance(value, list):
        if value and all(isinstance(v, dict) for v in value):
            return {f"record_{i:03d}": _plain_variables(v, mapping_type) for i, v in enumerate(value)}
        if value and all(isinstance(v, np.ndarray) and v.ndim == 2 for v in value):
            return {f"record_{i:03d}": v for i, v in enumerate(value)}
        if value and all(_is_list_of_numbers(v) for v in value):  # a cell of vectors
            lengths = {len(v) for v in value}
            return np.asarray(value) if len(lengths) == 1 else {str(i): np.asarray(v) for i, v in enumerate(value)}
        if value and all(isinstance(v, (int, float)) for v in value):
            return np.asarray(value)
        return value if all(isinstance(v, str) for v in value) else np.asarray(value, dtype=object)
    return value


def _cells_of_channels(variables: dict[str, Any]) -> dict[str, Any] | None:
    """Records of cells that each hold the vectors of one channel, as force{k} and rail{k}; None for other variables.

    The channels of one record are equally long, so the vectors of such a cell are no channels of one record where their
    lengths differ and those of the other channels differ alike. Cells whose names differ in numbers alone are records
    themselves. A cell with the name of a sensor holds none: beside a cell of as many vectors a record of other
    lengths is damaged where half of the records fit; else the cell cannot be read.
    """
    cells = {n: v for n, v in variables.items() if isinstance(v, list) and v and all(map(_is_list_of_numbers, v))}
    is_uneven = any(len(set(map(len, vectors))) > 1 for vectors in cells.values())
    words = {re.sub(r"\d+", "", name) for name in cells}
    fits = [len({len(v) for v in vectors if v is not None}) == 1 for vectors in zip_longest(*cells.values())]
    is_of_sensors = any(map(quantity_of_sensor, cells)) and len(set(map(len, cells.values()))) == 1
    are_alike = all(fits) or (is_of_sensors and 2 * sum(fits) >= len(fits))
    if not is_uneven or not are_alike or len(cells) < 2 or len(words) < len(cells):
        is_of_sensor = is_uneven and any(map(quantity_of_sensor, cells))  # its vectors are no channels of one record
        return variables | {name: _uneven_cell(vectors) for name, vectors in cells.items()} if is_of_sensor else None
    n_record = max(map(len, cells.values()))
    records = {
        f"record_{i:03d}": {n: np.asarray(v[i]) for n, v in cells.items() if i < len(v)} for i in range(n_record)
    }
    return {n: v for n, v in variables.items() if n not in cells} | records


def _uneven_cell(vectors: list[Any]) -> UnreadObject:
    """Stands for a cell of vectors that are no channels of one record, because their lengths differ."""
    lengths = first_texts([str(len(v)) for v in vectors], MAX_LISTED)
    advice = "Store each record as a structure with its channels, as x(k).force, or all with as many samples each"
    return UnreadObject(f"cell with vectors of {lengths} samples", advice, is_matlab=False)


def _is_list_of_numbers(value: Any) -> bool:
    """Whether a value is a vector of samples, as an array or a list."""
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and value.dtype.kind in "fiu" and value.size > 1
    return isinstance(value, list) and len(value) > 1 and all(isinstance(v, (int, float)) for v in value)


def _structure_array(fields: dict[str, Any]) -> dict[str, Any] | None:
    """Channels or records of a structure array, whose fields pymatreader returns as lists; None for another structure.

    With one field of vectors and one of distinct names its elements are channels, else they are records.
    """
    lists = {name: v for name, v in fields.items() if isinstance(v, list)}
    vectors = [name for name, v in lists.items() if len(v) > 1 and all(map(_is_list_of_numbers, v))]
    if not vectors or len({len(v) for v in lists.values()}) > 1 or len(lists) < len(fields):
        return None
    texts = [n for n, v in lists.items() if all(isinstance(t, str) and t for t in v) and len(set(v)) == len(v)]
    names = next((n for n in texts if not is_unit_name(n)), None)
    if len(vectors) == 1 and names:
        channels = dict(zip(lists[names], map(np.asarray, lists[vectors[0]])))
        entries = {n: v for n, v in lists.items() if n not in (names, vectors[0])}
        units = next((n for n in entries if is_unit_name(n)), None)
        return channels | entries | ({"units": dict(zip(lists[names], entries.pop(units)))} if units else {})
    n_record = len(lists[vectors[0]])
    return {
        f"record_{i:03d}": {n: np.asarray(v[i]) if _is_list_of_numbers(v[i]) else v[i] for n, v in lists.items()}
        for i in range(n_record)
    }
