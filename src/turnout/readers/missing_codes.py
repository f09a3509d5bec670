"""Numbers that loggers write for a sample that is missing or out of range, without stating them in the metadata."""

import math
from collections.abc import Iterator

import numpy as np

from turnout.readers.lazy import Column
from turnout.readers.source import BLOCK_SIZE

# Highest codes of converters with 16, 24 and 32 bits: clipping among whole numbers, and no physical value among others.
HIGHEST_CODES = (2.0**15 - 1, 2.0**23 - 1, 2.0**31 - 1)
# Nulls of well logs; codes of converters; fill value of masked arrays.
OTHER_CODES = (999.25, 2.0**15, 2.0**23, 2.0**31, 1e20, *HIGHEST_CODES)
CODE_TOLERANCE = 1e-7  # relative: of a number in single precision
MIN_NINES = 3  # before the decimal point: 99 and 99.9 are common measured values
MIN_NINES_OF_NEGATIVE = 2  # before the decimal point, as in -99.99, under the conditions of ``count_alone``
MIN_NINES_OF_SINGLE = 4  # in all: -99.9 is a measured value in 1 of 1000 records, where it does not repeat


def missing_code(value: float) -> float | None:
    """The code for a missing sample that a number is by its form: nines alone, or a limit of a converter.

    Parameters
    ----------
    value : float
        A number of the file, to seven digits.

    Returns
    -------
    float or None
        The code; None for any other number. A measured value may have this form by chance.

    Examples
    --------
    >>> [missing_code(value) for value in (-9999.0000001, 99999.9, -32768.0, 65535.0, 9998.0, 99.0, -99.99)]
    [-9999.0, 99999.9, -32768.0, None, None, None, -99.99]
    >>> missing_code(2.0**31 - 1) == 2**31 - 1, missing_code(2.0**31) == 2**31
    (True, True)
    """
    size = abs(float(value))
    text = f"{size:.7g}"
    digits, _, decimals = text.partition(".")
    if len(digits) >= (MIN_NINES_OF_NEGATIVE if value < 0 else MIN_NINES) and set(digits + decimals) == {"9"}:
        return math.copysign(float(text), value)
    nearest = min(OTHER_CODES, key=lambda code: abs(size - code))
    return math.copysign(nearest, value) if math.isclose(size, nearest, rel_tol=CODE_TOLERANCE) else None


def count_alone(column: Column, code: float) -> int:
    """Number of samples that equal a code to which the signal jumps, as that of no sensor does.

    The steps into and out of the code have to be larger than every other step of the channel. A measured value of this
    form has neighbours that are near to it. Samples that are not finite are passed over.

    Beside a code with two nines before the decimal point, the signal must not take its lowest other value: it does so
    on its way to a limit at which it is clipped. With fewer than four nines in all the code must repeat. The highest
    code of a converter counts only beside numbers that are not whole.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        Samples of a channel as they are in the file.
    code : float
        The code.

    Returns
    -------
    int
        0 if the signal does not jump to the code.

    Examples
    --------
    >>> count_alone(np.array([0.0, 2.0, -9999.0, 1.0]), -9999.0), count_alone(np.array([0.0, 700.0, 999.0]), 999.0)
    (1, 0)
    >>> count_alone(np.array([0.0, 2.0, -99.99, 1.0]), -99.99), count_alone(np.array([0.0, -40.0, -99.99]), -99.99)
    (1, 0)
    """
    if not _is_representable(code, column.dtype):
        return 0
    count, smallest_jump, largest_step, lowest, lowest_beside = 0, np.inf, 0.0, np.inf, np.inf
    are_whole = True
    for block in _overlapping_blocks(column):
        own_code = np.asarray(code).astype(block.dtype)
        count += int(np.count_nonzero(block[:BLOCK_SIZE] == own_code))
        block = block[np.isfinite(block)]
        is_code = block == own_code
        values = block.astype(float)
        are_whole = are_whole and bool((values == np.rint(values)).all())
        lowest = min(lowest, values[~is_code].min(initial=np.inf))
        steps = np.abs(np.diff(values))
        into_code = is_code[:-1] ^ is_code[1:]
        largest_step = max(largest_step, steps[~into_code].max(initial=0.0))
        smallest_jump = min(smallest_jump, steps[into_code].min(initial=np.inf))
        beside = np.maximum(values[:-1], values[1:])[into_code]  # the code itself is lower
        lowest_beside = min(lowest_beside, beside.min(initial=np.inf))
    if not largest_step < smallest_jump < np.inf or (are_whole and abs(code) in HIGHEST_CODES):
        return 0
    if abs(code) < 10**MIN_NINES_OF_NEGATIVE:
        n_nines = f"{code:.7g}".count("9")
        return count if lowest_beside > lowest and (count > 1 or n_nines >= MIN_NINES_OF_SINGLE) else 0
    return count


def _is_representable(code: float, dtype: np.dtype) -> bool:
    """Whether a type of numbers has a code: 2^31 in 32 bits with a sign would be -2^31."""
    if dtype.kind not in "iu":
        return True
    limits = np.iinfo(dtype)
    return code == math.floor(code) and limits.min <= int(code) <= limits.max


def _overlapping_blocks(column: Column) -> Iterator[np.ndarray]:
    """Consecutive blocks of samples, each with the first sample of the next one."""
    for start in range(0, len(column), BLOCK_SIZE):
        yield np.asarray(column[start : min(start + BLOCK_SIZE + 1, len(column))])
