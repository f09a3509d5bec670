"""Forms of columns that no sensor measures: on a rising line, as times, and whole numbers that count the samples."""

import numpy as np

from turnout.readers.lazy import Column
from turnout.readers.source import BLOCK_SIZE

HEAD_SIZE = 1000  # samples from which a column is judged before all of it is read
MIN_AXIS_SIZE = 8  # samples: fewer do not tell a time axis from a chance sequence
MAX_JUMP_SHARE = 0.02  # gaps per step among the first samples: with more a column rises too unevenly for a time axis
MAX_HEAD_DEVIATION = 1.0  # steps: rounding to printed digits moves a time by less
MAX_STEP_DEVIATION = 0.5  # of a step of a clock: its last digit may be that of the floating-point number
MAX_HOLD_DIFFERENCE = 2  # samples: a clock holds its values equally long, but for the rounding at both ends of each
MIN_RAMP_SIZE = 64  # samples: a channel that rises in as many equal steps measures nothing


def is_count_or_time(column: Column) -> bool:
    """Whether a column rises evenly at its beginning and at its end, as times and counts do and no measured signal.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        Samples of a channel as they are in the file.

    Returns
    -------
    bool
        False for fewer than 64 samples.

    Examples
    --------
    >>> is_count_or_time(np.arange(100)), is_count_or_time(np.sin(0.01 * np.arange(1000)))
    (True, False)
    """
    n_sample = len(column)
    if n_sample < MIN_RAMP_SIZE or column.dtype.kind not in "fiu":
        return False
    step = float(column[1:2][0]) - float(column[:1][0])
    return step > 0.0 and all(is_on_line(end) for end in _ends(column))


def _ends(column: Column) -> list[np.ndarray]:
    """The first and the last samples of a column."""
    return [np.asarray(column[k : k + HEAD_SIZE], dtype=float) for k in (0, max(0, len(column) - HEAD_SIZE))]


def rises_in_steps(column: Column) -> bool:
    """Whether a column holds each value equally long and rises in equal steps, as a clock of few digits does.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        Samples of a channel as they are in the file.

    Returns
    -------
    bool
        False for fewer than 64 samples, for fewer than 8 steps at one end, and where a sample falls.

    Examples
    --------
    >>> rises_in_steps(np.arange(1000) // 20), rises_in_steps(np.arange(1000) ** 2 // 20000)
    (True, False)
    """
    if len(column) < MIN_RAMP_SIZE or column.dtype.kind not in "fiu":
        return False
    for steps in map(np.diff, _ends(column)):
        rises = steps[steps != 0.0]
        is_even = len(rises) >= MIN_AXIS_SIZE and np.ptp(rises) <= MAX_STEP_DEVIATION * np.median(rises)
        if len(rises) == len(steps) or not is_even or np.ptp(np.diff(np.flatnonzero(steps))) > MAX_HOLD_DIFFERENCE:
            return False
    return True


def counts_in_disorder(column: Column) -> bool:
    """Whether a column holds consecutive whole numbers, each once, in no order.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        A column as it is in the file.

    Returns
    -------
    bool
        False for numbers that rise, or that fall by ones.
    """
    head = np.asarray(column[:HEAD_SIZE], dtype=float)
    if (np.diff(head) > 0).all() or not (head == np.rint(head)).all() or len(np.unique(head)) < len(head):
        return False
    count = np.sort(np.asarray(column[:], dtype=float))
    return bool((np.diff(count) == 1.0).all()) and not (np.diff(head) == -1.0).all()


def rises_evenly(head: np.ndarray) -> bool:
    """Whether the first samples of a column are those of a time axis: on a rising line, in other steps than 1.

    Parameters
    ----------
    head : (n,) array
        The first numbers of a column.

    Returns
    -------
    bool
        False for whole numbers in steps of 1, which count the samples, and for fewer than 8 numbers.
    """
    return is_on_line(head) and not (np.diff(np.asarray(head, dtype=float)) == 1.0).all()


def is_on_line(samples: np.ndarray) -> bool:
    """Whether samples lie on a rising line; one jump may be in it, and a few in many samples.

    Parameters
    ----------
    samples : (n,) array
        The first numbers of a column.

    Returns
    -------
    bool
        False for fewer than 8 numbers.
    """
    samples = np.asarray(samples, dtype=float)
    if len(samples) < MIN_AXIS_SIZE or not np.isfinite(samples).all():
        return False
    steps = np.diff(samples)
    if (steps <= 0).any():
        return False
    step = float(np.median(steps))
    line = samples[0] + (samples[-1] - samples[0]) * np.arange(len(samples)) / (len(samples) - 1)
    n_jump = np.count_nonzero(np.abs(steps - step) > 0.5 * step)
    return bool(
        np.abs(samples - line).max() < MAX_HEAD_DEVIATION * step or n_jump <= max(1, MAX_JUMP_SHARE * len(steps))
    )


def counts_samples(column: Column) -> bool:
    """Whether a column numbers its samples by ones from 0 or 1, none left out: no sensor measures this.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        The column.

    Returns
    -------
    bool

    Examples
    --------
    >>> counts_samples(np.arange(1.0, 33.0)), counts_samples(np.delete(np.arange(33.0), 9)), counts_samples(np.ones(32))
    (True, False, False)
    """
    if column.dtype.kind not in "fiu" or len(column) < MIN_AXIS_SIZE or column[:1][0] not in (0, 1):
        return False
    first = column[:1][0]
    blocks = ((a, column[a : a + BLOCK_SIZE]) for a in range(0, len(column), BLOCK_SIZE))
    return all(np.array_equal(block, first + np.arange(a, a + len(block))) for a, block in blocks)
