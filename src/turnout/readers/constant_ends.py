"""Ends of a record that repeat one value: on all channels, where a logger filled its last block, or on one of them.

A signal may be exactly 0 in digital silence. The samples beside the rows decide: noise of several steps of the
converter does not stop by itself, and a vibration that dies away below one step stops gradually.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from turnout.readers.lazy import Column
from turnout.readers.repeated_blocks import is_noisy
from turnout.readers.source import BLOCK_SIZE

MIN_ROWS = 32  # fewer are not looked for
N_NOISE = 256  # rows beside them that must hold noise
N_BESIDE, N_NEAREST = 64, 16  # rows beside them whose ranges are compared
MIN_STEPS = 3.0  # of the converter, range of the nearest rows: a vibration that dies away below it has 2
MIN_REMAINDER = 0.33  # of the range of the rows beside, which the nearest ones have: else it dies away
MAX_LEVEL = 3.0  # of the noise behind the first rows, in units of the quietest part; of noise below 2.5
N_PARTS = 200  # of a record whose levels are compared


def measured_span(columns: Sequence[Column]) -> tuple[int, int]:
    """First sample, and the one behind the last, between rows at the ends that no sensor measured.

    Such rows repeat one value on all channels, ``MIN_ROWS`` times or more, beside noise of ``MIN_STEPS`` steps of the
    converter or more that does not die away towards them. At the beginning the noise behind them must be that of the
    quiet parts of the record, because a signal may be silent until an impact. A value that is the largest or the
    smallest of each channel, and not 0, is that of an overload: it stays.

    Parameters
    ----------
    columns : sequence of (n_sample,) array or LazyColumn
        Samples of the channels that measure vibration, as they are in the file.

    Returns
    -------
    tuple of (int, int)
        (0, n_sample) without such rows.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=(2, 1000))
    >>> measured_span([np.r_[x, np.zeros(300)] for x in noise]), measured_span([*noise])
    ((0, 1000), (0, 1000))
    """
    n_sample = len(columns[0]) if columns else 0
    if n_sample < MIN_ROWS + N_NOISE or any(c.dtype.kind not in "fiu" for c in columns):
        return 0, n_sample
    first, stop = _count_equal(columns, n_sample, False), n_sample - _count_equal(columns, n_sample, True)
    if stop - first < N_NOISE:
        return 0, n_sample
    is_padded = n_sample - stop >= MIN_ROWS and _is_cut_off(_rows(columns, stop - N_NOISE, stop)[:, ::-1])
    if not is_padded or _is_overload(columns, n_sample - 1):
        stop = n_sample
    beside = _rows(columns, first, first + N_NOISE)
    is_padded = first >= MIN_ROWS and _is_cut_off(beside) and _is_quiet(columns, first, stop, beside)
    if not is_padded or _is_overload(columns, 0):
        first = 0
    return first, stop


def silent_ends(column: Column, first: int, stop: int) -> tuple[int, int]:
    """Numbers of samples at both ends of a channel that repeat one value beside noise, while other channels go on.

    Parameters
    ----------
    column : (n_sample,) array or LazyColumn
        Samples of a channel that measures vibration, as they are in the file.
    first, stop : int
        As ``measured_span`` returns them for all channels of the record.

    Returns
    -------
    tuple of (int, int)
        0 for an end with fewer than ``MIN_ROWS`` of them.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=1000)
    >>> silent_ends(np.r_[noise, np.zeros(300)], 0, 1300), silent_ends(noise, 0, 1000)
    ((0, 300), (0, 0))
    """
    own_first, own_stop = measured_span([column])
    n_first, n_last = own_first - first, stop - own_stop
    return n_first if n_first >= MIN_ROWS else 0, n_last if n_last >= MIN_ROWS else 0


def _rows(columns: Sequence[Column], start: int, stop: int) -> np.ndarray:
    """(n_channel, stop - start) samples."""
    return np.array([column[start:stop] for column in columns], dtype=float)


def _count_equal(columns: Sequence[Column], n_sample: int, are_last: bool) -> int:
    """Number of rows at an end that equal the outermost one on all channels."""
    edge = _rows(columns, n_sample - 1, n_sample) if are_last else _rows(columns, 0, 1)
    count = 0
    size = MIN_ROWS
    while count < n_sample:
        size = min(size * 4, BLOCK_SIZE, n_sample - count)
        a = n_sample - count - size if are_last else count
        is_equal = (_rows(columns, a, a + size) == edge).all(axis=0)
        is_equal = is_equal[::-1] if are_last else is_equal
        if not is_equal.all():
            return count + int(np.argmin(is_equal))
        count += size
    return count


def _is_cut_off(beside: np.ndarray) -> bool:
    """Whether the rows beside equal ones, in order from these on, hold noise that does not die away towards them."""
    if not np.isfinite(beside).all() or not is_noisy(beside):
        return False
    return any(
        np.ptp(x[:N_NEAREST]) >= max(MIN_STEPS * np.diff(np.unique(x)).min(), MIN_REMAINDER * np.ptp(x[:N_BESIDE]))
        for x in beside
        if x.min() < x.max()
    )


def _is_quiet(columns: Sequence[Column], first: int, stop: int, beside: np.ndarray) -> bool:
    """Whether the noise behind the first rows has the level of the quietest part of the record, on all channels."""
    places = np.linspace(first + N_BESIDE, stop - N_BESIDE, N_PARTS).astype(int)
    levels = [_levels(_rows(columns, a, a + N_BESIDE)) for a in dict.fromkeys(places.tolist())]
    quietest = np.min(levels, axis=0)
    here = _levels(beside[:, :N_BESIDE])
    return bool((quietest > 0.0).any() and (here <= MAX_LEVEL * quietest)[quietest > 0.0].all())


def _levels(rows: np.ndarray) -> np.ndarray:
    """Standard deviation of the steps of each channel."""
    return np.std(np.diff(rows, axis=1), axis=1)


def _is_overload(columns: Sequence[Column], k: int) -> bool:
    """Whether the value of a sample is an extreme of each channel, and 0 on none of them."""
    return all(
        column[k : k + 1][0] != 0 and any(column[k : k + 1][0] == extreme for extreme in _extremes(column))
        for column in columns
    )


def _extremes(column: Column) -> Iterator[float]:
    blocks = [column[a : a + BLOCK_SIZE] for a in range(0, len(column), BLOCK_SIZE)]
    yield min(float(np.min(block)) for block in blocks)
    yield max(float(np.max(block)) for block in blocks)
