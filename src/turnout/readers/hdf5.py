"""Reader of HDF5: groups, datasets and attributes as the named variables of ``turnout.readers.named_arrays``.

``turnout.readers.writing`` writes the attributes ``rate``, ``n_records`` and conditions at the root, and a group
``record_000`` ... with ``started_at`` per record. It holds one dataset per channel with its ``unit`` and a Fletcher-32
checksum, so that damage is limited to one record. ``scale_factor``, ``add_offset``, ``_FillValue`` and ``valid_range``
of netCDF files are applied; a dataset with another gain or offset is rejected unless the layout decides.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import h5py
import numpy as np

from turnout.errors import ReadError
from turnout.readers.array_metadata import Alphabetical
from turnout.readers.channel_groups import STATED_SCALES
from turnout.readers.declared_sizes import Hdf5SizeCheck, open_hdf5
from turnout.readers.lazy import is_large, lazy_array
from turnout.readers.metadata_names import ATTRIBUTES_MARK, CHANNEL_NAMES, TIME_NAMES
from turnout.readers.named_arrays import raw_file
from turnout.readers.packing import apply_packing, unstated_fills
from turnout.readers.sample_variables import Attributes, matrices
from turnout.readers.scale_vocabulary import is_fill_name, is_scale_name
from turnout.readers.source import COPY_AGAIN, RawFile, Source
from turnout.readers.stated_scales import scale_text, scales_in_text
from turnout.readers.texts import decode_text

UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units")


def read_raw(source: Source) -> RawFile:
    """Records of an HDF5 file.

    Parameters
    ----------
    source : Source
        The HDF5 file.

    Returns
    -------
    RawFile
        Its records; a dataset that cannot be read makes its record an error.

    Raises
    ------
    ReadError
        If the file cannot be opened, or its groups are no records.
    """
    with source.parsed_by("HDF5"), open_hdf5(source) as file:
        variables = _variables(file, "", source, Hdf5SizeCheck(source))
    return raw_file(variables, source)


def _variables(group: h5py.Group, path: str, source: Source, size_check: Hdf5SizeCheck) -> dict[str, Any]:
    """Members and attributes of a group in one dictionary; a ReadError for a dataset that cannot be read."""
    creation = group[group.name].id.get_create_plist()  # the id of a File does not have it
    is_order_tracked = creation.get_link_creation_order() & h5py.h5p.CRT_ORDER_TRACKED
    mapping_type = (
        dict if is_order_tracked else Alphabetical
    )  # members are in the order of creation only if it was tracked
    variables = mapping_type(_attributes(group))
    units: dict[str, str] = {}
    stated: dict[str, dict] = {}
    members = h5py.h5g.open(group.id, b"/") if isinstance(group, h5py.File) else group.id
    for name in group:
        size_check.check_link(members, name.encode("utf-8", "surrogateescape"), f"{path}/{name}")
        try:
            member = group[name]
        except KeyError:  # a link to nothing
            member = None
        if isinstance(member, h5py.Group):
            variables[name] = _variables(member, f"{path}/{name}", source, size_check)
            continue
        if isinstance(member, h5py.Dataset):
            size_check.check_dataset(member.id, f"{path}/{name}")
        try:
            with source.parsed_by("HDF5", f"dataset {name!r} in {path or '/'!r}"):
                attributes = _attributes(member)
                _check_written(member, attributes, source)
                large = (
                    source.lazy and is_large(member) and member.dtype.names is None and name.lower() not in TIME_NAMES
                )
                numbers = _with_packing(member, attributes, source)
                if large and isinstance(numbers, PackedDataset):
                    numbers = replace(numbers, fills=(*numbers.fills, *unstated_fills(numbers.dataset)))
                if member.shape is not None:
                    variables[name] = lazy_array(numbers) if large else _values(numbers)
        except ReadError as error:
            variables[name] = error
            continue
        applied = _fill_names(attributes) if isinstance(numbers, PackedDataset) else ()
        others = {k: v for k, v in attributes.items() if k not in applied}
        variables[f"{name}{ATTRIBUTES_MARK}"] = Attributes(name, others)
        for key, value in attributes.items():
            if key in UNIT_ATTRIBUTES and isinstance(value, str):
                units[name] = value
            elif key.lower() in ("channels", "channel_names", "units", *(CHANNEL_NAMES if member.ndim > 1 else ())):
                variables.setdefault(key, value)
            elif key not in PACKING_ATTRIBUTES and (
                is_scale_name(key) or (isinstance(value, str) and scales_in_text(value))
            ):
                stated.setdefault(name, {})[key] = value
    arrays = matrices(variables)
    for name in arrays:
        variables |= stated.pop(name, {})  # of all channels of the matrix
    if texts := tuple((name, text) for name, facts in stated.items() if (text := scale_text(facts))):
        variables[STATED_SCALES] = texts
    if units and not any(key.lower() == "units" for key in variables):
        (name, unit), *other_units = units.items()
        is_of_all_channels = not other_units and name in arrays and min(arrays[name].shape) > 1
        variables["units"] = unit if is_of_all_channels else units
    return variables


NO_VARIABLE = "This is a netCDF dimension but not"  # attribute NAME of an axis for which netCDF writes no values


def _check_written(dataset: h5py.Dataset, attributes: Mapping[str, Any], source: Source) -> None:
    """ReadError if a part of the samples was never written: HDF5 returns the fill value there, 0 as a rule."""
    if not dataset.size or not dataset.ndim or str(attributes.get("NAME", "")).startswith(NO_VARIABLE):
        return
    if dataset.chunks:
        n = math.prod(-(-length // size) for length, size in zip(dataset.shape, dataset.chunks))
        problem = f"{n - dataset.id.get_num_chunks()} of its {n} chunks of samples were never written"
        is_written = dataset.id.get_num_chunks() >= n
    else:
        is_written, problem = dataset.id.get_storage_size() > 0 or dataset.is_virtual, "its samples were never written"
    if not is_written:
        raise source.error(f"dataset {dataset.name!r}", problem, COPY_AGAIN, reason="truncated")


PACKING_ATTRIBUTES = ("scale_factor", "add_offset")  # of the climate and forecast (CF) conventions of netCDF
FILL_ATTRIBUTES = ("_FillValue", "missing_value")
RANGE_ATTRIBUTES = ("valid_min", "valid_max", "valid_range")  # a number outside is a missing sample


@dataclass(frozen=True)
class PackedDataset:
    """A dataset with packed numbers; it is sliced like a dataset and returns unpacked numbers."""

    dataset: h5py.Dataset
    factor: float
    offset: float
    fills: tuple[float, ...]
    valid: tuple[float, float] = (-np.inf, np.inf)
    dtype = np.dtype(float)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the dataset."""
        return self.dataset.shape

    def __getitem__(self, selection: Any) -> np.ndarray:
        return apply_packing(self.dataset[selection], self.factor, self.offset, self.fills, self.valid)


def _fill_names(attributes: Mapping[str, Any]) -> list[str]:
    """Attributes of a dataset that state its fill value: of netCDF, and numbers under other such names."""
    return [
        k
        for k, v in attributes.items()
        if k in FILL_ATTRIBUTES or (is_fill_name(k) and np.asarray(v).dtype.kind in "fiu")
    ]


def _with_packing(
    dataset: h5py.Dataset, all_attributes: Mapping[str, Any], source: Source
) -> h5py.Dataset | PackedDataset:
    """The dataset itself, or with its attributes of packing applied; ReadError if they are no numbers."""
    if dataset.dtype.kind == "i" and str(all_attributes.get("_Unsigned", "")).lower() == "true":
        problem = "its whole numbers are unsigned by its attribute _Unsigned, and stored as signed ones"
        raise source.error(f"dataset {dataset.name!r}", problem, "Export the numbers unpacked", reason="scale_unknown")
    fill_names = _fill_names(all_attributes)
    names = (*PACKING_ATTRIBUTES, *RANGE_ATTRIBUTES, *fill_names)
    attributes = {k: all_attributes[k] for k in names if k in all_attributes}
    if not attributes or dataset.dtype.kind not in "fiu":
        return dataset
    try:
        factor, offset = (float(attributes.get(k, d)) for k, d in zip(PACKING_ATTRIBUTES, (1.0, 0.0)))
        fills = tuple(float(x) for k in fill_names for x in np.ravel(attributes[k]))
        low, high = (float(x) for x in attributes.get("valid_range", (-np.inf, np.inf)))
        valid = max(low, float(attributes.get("valid_min", low))), min(high, float(attributes.get("valid_max", high)))
    except (TypeError, ValueError) as error:
        problem = f"its attributes {attributes} are no numbers"
        remedy = "Write one number each, or export the numbers unpacked"
        raise source.error(f"dataset {dataset.name!r}", problem, remedy, reason="scale_unknown") from error
    if not (np.isfinite(factor) and np.isfinite(offset) and factor):
        problem = f"its scale_factor {factor:g} and add_offset {offset:g} give no numbers"
        raise source.error(f"dataset {dataset.name!r}", problem, "Export the numbers unpacked", reason="scale_unknown")
    is_unpacked = any(np.asarray(attributes.get(k, 0)).dtype.kind == "f" for k in RANGE_ATTRIBUTES)
    if is_unpacked and dataset.dtype.kind in "iu":  # by the netCDF user's guide the type tells which numbers are meant
        low, high = sorted((x - offset) / factor for x in valid)
        valid = low, high
    return PackedDataset(dataset, factor, offset, fills, valid)


def _values(dataset: h5py.Dataset | PackedDataset) -> Any:
    if isinstance(dataset, PackedDataset):
        packed = dataset.dataset[()]
        fills = (*dataset.fills, *unstated_fills(packed))
        return apply_packing(packed, dataset.factor, dataset.offset, fills, dataset.valid)
    if h5py.check_string_dtype(dataset.dtype) is not None:
        return _texts(dataset[()])
    return dataset[()]


def _texts(value: Any) -> Any:
    """A text or an array of texts, which h5py returns as bytes."""
    if isinstance(value, bytes):
        return decode_text(value)
    return np.array([_texts(v) for v in value.ravel()], dtype=object).reshape(value.shape)


def _attributes(member: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    """Attributes of a group or a dataset by name; one without a value (``h5py.Empty``) states nothing."""
    return {name: _attribute(value) for name, value in member.attrs.items() if not isinstance(value, h5py.Empty)}


def _attribute(value: Any) -> Any:
    if isinstance(value, bytes):
        return decode_text(value).strip()
    if isinstance(value, str):  # h5py keeps bytes that are no UTF-8 as surrogates
        return decode_text(value.encode("utf-8", "surrogateescape"))
    if isinstance(value, np.ndarray) and value.size == 1:
        return _attribute(value.reshape(-1)[0])
    return value
