"""Packed numbers: values for missing samples, scale and offset by the conventions of netCDF."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import owners_of
from turnout.readers.lazy import LazyMatrix, Numbers, lazy_array
from turnout.readers.missing_codes import count_alone, missing_code
from turnout.readers.scale_vocabulary import is_fill_name
from turnout.readers.source import BLOCK_SIZE, MIN_SAMPLES
from turnout.readers.stated_numbers import finite_numbers


def fill_values(entries: Iterable[Entry], names: Sequence[str]) -> tuple[tuple[float, ...], ...]:
    """Numbers that stand for a missing sample of each channel, as the metadata state.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.
    names : sequence of str
        Names of the channels.

    Returns
    -------
    tuple of tuple of float
        For each channel the values of the entries that are named like a fill value and concern it.

    Examples
    --------
    >>> fill_values([Entry("head", "_FillValue", -999), Entry("rail/NoData", "NoData", -1)], ["force", "rail"])
    ((-999.0,), (-999.0, -1.0))
    """
    entries = list(entries)
    fills: list[list[float]] = [[] for _ in names]
    for entry in entries:
        if not is_fill_name(entry.name) or (numbers := finite_numbers(entry.value)) is None:
            continue
        owners = owners_of(entry, entries, names)
        for i, fill in enumerate(fills):
            if not owners and numbers.size == len(names):
                fill.append(float(numbers[i]))
            elif not owners or i in owners:
                fill.extend(map(float, numbers))
    return tuple(map(tuple, fills))


def apply_packing(
    numbers: Sequence | np.ndarray,
    factor: float,
    offset: float,
    fills: Sequence[float],
    valid: tuple[float, float] = (-np.inf, np.inf),
) -> np.ndarray:
    r"""Unpack numbers by the climate and forecast (CF) conventions of netCDF, sections 2.5.1 and 8.1.

    .. math:: x = s p + o, \qquad x = \mathrm{nan} \quad
       \mathrm{where}\ p\ \mathrm{is\ a\ fill\ value\ or\ outside\ the\ valid\ range}

    Parameters
    ----------
    numbers : (n,) array
        Packed numbers p.
    factor, offset : float
        ``scale_factor`` s and ``add_offset`` o. [unit of the file]
    fills : sequence of float
        Values that stand for a missing sample.
    valid : tuple of (float, float)
        Least and largest valid p.

    Returns
    -------
    (n,) array of float
        x. [unit of the file]

    Examples
    --------
    >>> apply_packing(np.array([10, -99], dtype="int16"), 0.5, 1.0, [-99])
    array([ 6., nan])
    """
    packed = np.asarray(numbers)
    unpacked = packed * float(factor) + float(offset)
    for fill in fills:
        unpacked[packed == fill] = np.nan
    unpacked[(packed < valid[0]) | (packed > valid[1])] = np.nan
    return unpacked


def unstated_fills(packed: Numbers) -> tuple[float, ...]:
    """Usual codes for a missing sample among packed numbers, which nothing states: unpacked, they have no such form.

    Numbers in a file are read in blocks.

    Parameters
    ----------
    packed : (n,) or (n, m) array, or dataset in a file
        Packed numbers as they are in the file. The longer axis of a matrix is that of the samples.

    Returns
    -------
    tuple of float
        The codes to which the numbers of a channel jump.

    Examples
    --------
    >>> unstated_fills(np.array([0, 2, -32768, 1], dtype="int16"))
    (-32768.0,)
    >>> unstated_fills(np.array([0.0, 2.0, np.nan, -32768.0, 1.0]))
    (-32768.0,)
    >>> unstated_fills(np.array([[0, 2, -32768, 1], [3, 2, 1, 0]], dtype="int16").T)
    (-32768.0,)
    """
    if len(packed.shape) not in (1, 2) or math.prod(packed.shape) < MIN_SAMPLES:
        return ()
    array = lazy_array(packed)
    if isinstance(array, LazyMatrix) and array.shape[0] > array.shape[1]:
        array = array.T
    columns = list(array) if isinstance(array, LazyMatrix) else [array]
    largest = [-np.inf] * len(columns)
    smallest = [np.inf] * len(columns)
    for start in range(0, len(columns[0]), BLOCK_SIZE):  # all channels of a block cost one access to the file
        for i, column in enumerate(columns):
            block = column[start : start + BLOCK_SIZE]
            finite = block[np.isfinite(block)]
            if finite.size:
                smallest[i], largest[i] = min(smallest[i], float(finite.min())), max(largest[i], float(finite.max()))
    fills: set[float] = set()
    for column, extremes in zip(columns, zip(smallest, largest)):
        codes = {missing_code(x) for x in extremes if np.isfinite(x)} - {None}
        fills.update(code for code in codes if code is not None and count_alone(column, code))
    return tuple(sorted(fills))
