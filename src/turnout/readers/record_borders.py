"""Columns that no sensor uses and whose form shows that several records are in one: numbers in blocks, and restarts.

The form decides, not the name: nobody can list what loggers call the number of an impact.
"""

from collections.abc import Collection, Iterator, Set

import numpy as np

from turnout.errors import ReadError
from turnout.readers.lazy import Column
from turnout.readers.rate_statements import MIN_EPOCH, TIME_SCALES
from turnout.readers.source import RawRecord, Source
from turnout.readers.time_axes import HEAD_SIZE, is_unit_of_no_time

MIN_BLOCK = 32  # samples: no record is shorter, and a state that changes faster numbers none
MIN_COUNTING_SHARE = 0.9  # of the first steps of a counter are equal: the others are restarts
MIN_FLAG_SHARE = 0.5  # ratio of two blocks, 0 and 1: an impact early in its record divides it less evenly
WRAP_PERIODS = frozenset((*(10**k for k in range(2, 10)), 2**16, 2**24, 2**32))  # samples, at which counters may end
BYTE_PERIOD = 2**8  # samples: a counter of one byte, too short for a record at usual rates


def border_errors(
    record: RawRecord, measured: Set[int], checked: Collection[str], rate: float, where: str, source: Source
) -> Iterator[ReadError]:
    """Remarks on columns that may number several records which were read as one.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    measured : set of int
        Columns that the layout assigns to a sensor or gives a unit that is none of time.
    checked : collection of str
        Names, without case, of which the layout says that they state nothing about the samples.
    rate : float
        Its sampling rate. [Hz]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        A remark for each column whose form leaves it open.

    Raises
    ------
    ReadError
        If a column numbers records by its form.
    """
    columns = [(f"column {n!r}", n, u, x) for n, u, x in zip(record.names, record.units, record.samples)]
    columns = [column for i, column in enumerate(columns) if i not in measured]
    columns += [(f"{name!r}", name, "", values) for name, values in record.counters.items()]
    for place, name, unit, column in columns:
        is_count = unit.strip().casefold() in ("count", "counts")
        if name.strip().casefold() in checked or (is_unit_of_no_time(unit) and not is_count):
            continue
        form = form_of_borders(column, rate)
        if form is None:
            continue
        text, is_certain = form
        problem = f"{place} {text}: it may number records, which would be read as one"
        remedy = (
            f"Export each record to a file of its own, or number them in a column 'record'; if it numbers none, write "
            f"'checked_entries: {name}' into the layout"
        )
        error = source.error(where, problem, remedy, reason="wrong_length" if is_certain else "entry_unknown")
        if is_certain:
            raise error
        yield error


def form_of_borders(column: Column, rate: float) -> tuple[str, bool] | None:
    """What in the form of a column may be borders of records.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        A column as it is in the file.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    tuple of (str, bool) or None
        What it does, and whether only borders of records do so. None for a signal, a constant, a flag that is 0 and
        another number, and a counter that does not begin again.

    Examples
    --------
    >>> form_of_borders(np.repeat([1, 2, 3], [600, 580, 590]), 2e4)
    ('changes 2 times, from 1 to 3 in blocks of 580 to 600 rows', True)
    >>> form_of_borders(np.tile(np.arange(600), 3), 2e4)
    ('begins again 2 times, each 600 rows', True)
    >>> form_of_borders(np.repeat([0, 1, 0], [100, 10, 490]), 2e4), form_of_borders(np.arange(256) % 2, 2e4)
    (None, None)
    """
    if column.dtype.kind not in "fiu" or len(column) < 2 * MIN_BLOCK:
        return None
    steps = np.diff(np.asarray(column[:HEAD_SIZE], dtype=float))
    n_change = np.count_nonzero(steps)
    step = float(np.median(steps))
    if n_change <= len(steps) / MIN_BLOCK + 1:
        return _form_of_blocks(np.asarray(column[:], dtype=float), rate)
    if step > 0.0 and _count_equal_steps(steps, step) >= MIN_COUNTING_SHARE * len(steps):
        return _form_of_restarts(np.asarray(column[:], dtype=float), step)
    return None


def _count_equal_steps(steps: np.ndarray, step: float) -> int:
    """Number of steps that are equal but for the rounding of printed numbers."""
    return int(np.count_nonzero(np.abs(steps - step) <= 0.5 * step))


def _form_of_blocks(values: np.ndarray, rate: float) -> tuple[str, bool] | None:
    """As ``form_of_borders``, of a column that is constant at its beginning."""
    if not np.isfinite(values).all() or (values != np.rint(values)).any():
        return None
    edges = np.flatnonzero(np.diff(values)) + 1
    lengths = np.diff([0, *edges, len(values)])
    if not edges.size or lengths[:-1].min() < MIN_BLOCK:
        return None
    numbers = values[[0, *edges]]
    steps = np.diff(numbers)
    times = "once" if edges.size == 1 else f"{edges.size} times"
    extent = f"{lengths.min()} to {lengths.max()}" if lengths.min() < lengths.max() else f"{lengths[0]}"
    text = f"changes {times}, from {numbers[0]:.12g} to {numbers[-1]:.12g} in blocks of {extent} rows"
    if len(distinct := np.unique(numbers)) == 2 and 0.0 in distinct:  # a flag
        is_halved = edges.size == 1 and abs(steps[0]) == 1 and lengths.min() >= MIN_FLAG_SHARE * lengths.max()
        return (text, False) if is_halved else None
    if (numbers[0] >= MIN_EPOCH or edges.size > 1) and _are_whole_times(steps, lengths, rate):
        return None if numbers[0] >= MIN_EPOCH else (text, False)
    if (steps > 0).all() or (steps < 0).all():  # from 0 or 1 on by ones: no temperature or load in whole numbers
        return text, min(numbers[0], numbers[-1]) in (0.0, 1.0) and bool((np.abs(steps) == 1.0).all())
    begins_again = bool(((steps == 1.0) | (numbers[1:] == numbers[0])).all())
    are_alike = len(set(lengths[:-1].tolist())) == 1
    return (text, False) if begins_again or are_alike else None


def _are_whole_times(steps: np.ndarray, lengths: np.ndarray, rate: float) -> bool:
    """Whether numbers are whole units of time, as the seconds of a clock: as many samples as such a unit lasts."""
    for scale in TIME_SCALES:
        due = steps * scale * rate
        if (np.abs(lengths[1:-1] - due[1:]) <= 1.0).all() and (lengths[[0, -1]] <= due[[0, -1]] + 1.0).all():
            return True
    return False


def _form_of_restarts(values: np.ndarray, step: float) -> tuple[str, bool] | None:
    """As ``form_of_borders``, of a column that rises in equal steps at its beginning."""
    steps = np.diff(values)
    falls = np.flatnonzero(steps < 0.0) + 1
    if not falls.size or _count_equal_steps(steps, step) + falls.size < len(steps):
        return None
    lengths = np.diff([0, *falls, len(values)])
    starts = values[falls]
    if lengths[:-1].min() < MIN_BLOCK or np.ptp(starts) > 0.5 * step:
        return None
    periods = set(lengths[1:-1].tolist()) or {int(np.rint((values[falls[0] - 1] - starts[0]) / step)) + 1}
    if periods == {BYTE_PERIOD}:
        return None
    times = "once" if falls.size == 1 else f"{falls.size} times"
    extent = f"{min(periods)} to {max(periods)}" if len(periods) > 1 else f"{min(periods)}"
    return f"begins again {times}, each {extent} rows", not periods <= WRAP_PERIODS
