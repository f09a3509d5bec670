"""Arrow arrays from plain Python values without ``pa.array``, which imports pandas: 0.3 CPU s and 50 MB."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime

import numpy as np
import pyarrow as pa

NONE = type(None)
EXACT = 2**53  # integers up to this size are exact in float64


def arrow_array(values: Sequence, type_: pa.DataType) -> pa.Array:
    """The array that ``pa.array`` gives; values of other types than text, numbers, times and None are left to it.

    Parameters
    ----------
    values : Sequence
        Values, None for NULL.
    type_ : pa.DataType
        Type of the array.

    Returns
    -------
    Array
        The array.

    Raises
    ------
    ArrowException, TypeError, ValueError, OverflowError
        If a value does not fit the type.

    Examples
    --------
    >>> arrow_array([1.5, None], pa.float64()).to_pylist(), arrow_array(["a", None], pa.string()).to_pylist()
    ([1.5, None], ['a', None])
    """
    kinds = set(map(type, values))
    is_valid = np.array([v is not None for v in values], dtype=bool) if NONE in kinds else None
    if pa.types.is_string(type_) and kinds <= {str, NONE}:
        return _from_text(values, is_valid)
    if pa.types.is_floating(type_) and (kinds <= {float, NONE} or _are_exact(values, kinds)):
        with np.errstate(over="ignore"):
            return from_numpy(np.array(values, type_.to_pandas_dtype()), is_valid)  # None gives NaN here
    if pa.types.is_integer(type_) and kinds <= {int, NONE}:
        numbers = np.array([v or 0 for v in values] if NONE in kinds else values, np.int64)
        small = numbers.astype(type_.to_pandas_dtype())
        if not np.array_equal(small, numbers):
            raise OverflowError(f"an integer beyond {type_}")
        return from_numpy(small, is_valid)
    if pa.types.is_timestamp(type_) and type_.unit == "us" and kinds <= {datetime, NONE}:
        return from_numpy(np.array(values, "datetime64[us]"), is_valid)
    return pa.array(values, type_)


def arrow_table(columns: Mapping[str, pa.Array]) -> pa.Table:
    """Table of arrays.

    Parameters
    ----------
    columns : mapping
        Array of each column.

    Returns
    -------
    Table
        The table.
    """
    return pa.Table.from_arrays(list(columns.values()), names=list(columns))


def _from_text(values: Sequence[str | None], is_valid: np.ndarray | None) -> pa.Array:
    filled = values if is_valid is None else [v or "" for v in values]
    text = "".join(filled)  # type: ignore[arg-type]
    if not text.isascii() or len(text) >= 2**31:
        builder = pa.lib.StringBuilder()
        builder.append_values(values)
        return builder.finish()
    offsets = np.zeros(len(values) + 1, np.int32)
    np.cumsum(np.fromiter(map(len, filled), np.int32, len(values)), out=offsets[1:])  # type: ignore[arg-type]
    buffers = [_validity(is_valid), pa.py_buffer(offsets), pa.py_buffer(text.encode())]
    return pa.Array.from_buffers(pa.string(), len(values), buffers)


def _validity(is_valid: np.ndarray | None) -> pa.Buffer | None:
    """Bits of an array, 0 for NULL."""
    return None if is_valid is None else _bits(is_valid)


def _bits(flags: np.ndarray) -> pa.Buffer:
    return pa.py_buffer(np.packbits(flags, bitorder="little").tobytes())


def _are_exact(values: Sequence, kinds: set[type]) -> bool:
    return kinds <= {float, int, NONE} and all(abs(v) <= EXACT for v in values if type(v) is int)


def from_numpy(data: np.ndarray, is_valid: np.ndarray | None = None) -> pa.Array:
    """Array of numbers, of truth values, or of times in microseconds.

    Parameters
    ----------
    data : (n,) array
        Values.
    is_valid : (n,) array of bool or None
        False for NULL; None: no value is NULL.

    Returns
    -------
    Array
        The array.

    Examples
    --------
    Arrow stores eight truth values in a byte.

    >>> from_numpy(np.array([True, True, False])).to_pylist()
    [True, True, False]
    """
    type_ = pa.timestamp("us") if data.dtype.kind == "M" else pa.from_numpy_dtype(data.dtype)
    if data.dtype.kind == "b":
        buffer = _bits(data)
    else:
        buffer = pa.py_buffer(np.ascontiguousarray(data))
    return pa.Array.from_buffers(type_, len(data), [_validity(is_valid), buffer])
