"""Columns that no sensor uses and whose form shows that several records are in one: numbers in blocks, and restarts.

The form decides, not the name: nobody can list what loggers call the number of an impact.
"""

from collections.abc import Collection, Iterator, Sequence, Set
from dataclasses import dataclass

import numpy as np

from turnout.constants import MAD_TO_SD
from turnout.errors import ReadError
from turnout.readers.blocks import LARGEST_NUMBER
from turnout.readers.column_forms import HEAD_SIZE
from turnout.readers.lazy import Column
from turnout.readers.rate_statements import MIN_EPOCH, TIME_SCALES
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord, Source
from turnout.readers.time_axes import has_time_in_seconds, is_unit_of_no_time

MIN_BLOCK = 32  # samples: no record is shorter, and a state that changes faster numbers none
MIN_COUNTING_SHARE = 0.9  # of the first steps of a counter are equal: the others are restarts
MIN_FLAG_SHARE = 0.5  # ratio of two blocks, 0 and 1: an impact early in its record divides it less evenly
WRAP_PERIODS = frozenset((*(10**k for k in range(2, 10)), 2**16, 2**24, 2**32))  # samples, at which counters may end
BYTE_PERIOD = 2**8  # samples: a counter of one byte, too short for a record at usual rates
TURN_PERIOD = 360  # degrees, at which an angle begins again
IMPACT_SHARE = 0.2  # of its peak, which the force reaches in a block with an impact
WEAK_IMPACT_SHARE = 0.02  # of its peak: a person hits no record more softly than that beside others
IMPACT_TO_NOISE = 20.0  # standard deviations of the noise, which in 10^7 samples of noise alone are below 6
MIN_IMPACT_BLOCK_SHARE = 0.5  # of blocks of equal length have an impact if they are records, and no packets
MAX_STATES = 4  # different numbers of a flag
# Units of counts and of flags, in lower case: they number something, and nothing says that it is the records.
COUNT_UNITS = frozenset("count counts bool boolean ttl bit bits flag logic - 1 # digital".split())
# Words, without accents, for what a column states about the measurement, its surroundings or the time of day.
STATE_WORDS = frozenset(
    """
    state states status flag flags mode zustand etat estado stato tilstand trigger trig ttl alarm
    range gain bereich quality qualitat event occupied overload ovl
    temp temperature temperatur temperatura tair trail humidity rh feuchte luftfeuchte luftfeuchtigkeit
    weather wetter meteo vejr rain regen wind pressure druck
    gps gnss fix sat sats satellite satellites satelliten lat lon latitude longitude
    battery batt bat batterie akku batteri
    hour hours hh minute minutes mm stunde minuten direction dir richtung
    """.split()
)
# Words for what counts on within a passage.
PASSAGE_WORDS = frozenset(
    """
    axle axles wheel wheels wheelset bogie vehicle car wagon achse achsen achszahler rad rader essieu essieux aksel
    tacho odometer encoder pulse pulses impulse impulses puls pulser packet packets frame frames
    """.split()
)


@dataclass(frozen=True)
class Measurement:
    """What tells borders of records from states: the ``kind`` of the test, its sampling ``rate`` [Hz], the ``signals``.

    ``signals`` are the forces, or without one all samples that sensors use: then ``are_forces`` is False.
    """

    rate: float
    kind: str = "hammer"
    signals: Sequence[Column] = ()
    are_forces: bool = True


@dataclass(frozen=True)
class Form:
    """What in the form of a column may be borders of records.

    ``text`` says what it does, ``is_certain`` that only numbers of records do so. ``edges`` are the first samples of
    all blocks but the first. ``are_alike`` marks blocks of one length, ``is_wrap`` restarts where counters end, and
    ``is_flag`` a few numbers that do not count.
    """

    text: str
    is_certain: bool
    edges: np.ndarray
    are_alike: bool = False
    is_wrap: bool = False
    is_flag: bool = False


def border_errors(
    record: RawRecord,
    measured: Set[int],
    checked: Collection[str],
    measurement: Measurement,
    where: str,
    source: Source,
) -> Iterator[ReadError]:
    """Remarks on columns that may number several records which were read as one.

    Each record of a hammer test has an impact: a column numbers none if there is an impact in one of its blocks only.
    It may number some if each block has one, however weak.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    measured : set of int
        Columns that the layout assigns to a sensor or gives a unit that is none of time.
    checked : collection of str
        Names, without case, of which the layout says that they state nothing about the samples.
    measurement : Measurement
        Its kind, sampling rate and signals.
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
        If a column numbers records by its form, and nothing else in the file speaks against it.
    """
    columns = [(f"column {n!r}", n, u, x, False) for n, u, x in zip(record.names, record.units, record.samples)]
    columns = [column for i, column in enumerate(columns) if i not in measured]
    columns += [(f"{name!r}", name, "", values, True) for name, values in record.counters.items()]
    for place, name, unit, column, is_text in columns:
        is_count = unit.strip().strip("[]()").casefold() in COUNT_UNITS
        if name.strip().casefold() in checked or (is_unit_of_no_time(unit) and not is_count):
            continue
        form = form_of_borders(column, measurement.rate)
        if form is None:
            continue
        is_state = is_count or is_state_name(name)
        is_state = is_state or (measurement.kind != "hammer" and not PASSAGE_WORDS.isdisjoint(words_of(name)))
        is_certain = _numbers_records(form, measurement, is_state, is_text)
        if is_certain is None:
            continue
        is_certain = is_certain and not has_time_in_seconds(record, measured)  # which runs on over every border
        problem = f"{place} {form.text}: it may number records, which would be read as one"
        remedy = (
            f"Export each record to a file of its own, or number them in a column 'record'; if it numbers none, write "
            f"'checked_entries: {name}' into the layout"
        )
        error = source.error(where, problem, remedy, reason="wrong_length" if is_certain else "entry_unknown")
        if is_certain:
            raise error
        yield error


def is_state_name(name: str) -> bool:
    """Whether the name of a column is a known word for a state, a temperature, a position, a battery or the weather.

    Parameters
    ----------
    name : str
        Name of the column.

    Returns
    -------
    bool

    Examples
    --------
    >>> is_state_name("GPS fix"), is_state_name("Rail temp"), is_state_name("qwxz"), is_state_name("Hit")
    (True, True, False, False)
    """
    return not STATE_WORDS.isdisjoint(words_of(name))


def _numbers_records(form: Form, measurement: Measurement, is_state: bool, is_text: bool) -> bool | None:
    """Whether a column numbers records by its form and the signals; False if that is open, None if it does not."""
    if measurement.kind != "hammer":
        is_silent = is_text or is_state or form.is_flag or form.is_wrap
        return None if is_silent else False
    n_block = len(form.edges) + 1
    n_impact = max((_count_blocks_with_impact(x, form.edges) for x in measurement.signals), default=n_block)
    if n_impact < 2:
        is_hit = any(_count_blocks_with_impact(x, form.edges, is_weak=True) == n_block for x in measurement.signals)
        return False if measurement.are_forces and is_hit else None
    are_packets = form.are_alike and n_impact < MIN_IMPACT_BLOCK_SHARE * n_block
    is_end = form.is_wrap and n_impact < n_block
    return form.is_certain and not (is_state or are_packets or is_end)


def _count_blocks_with_impact(signal: Column, edges: np.ndarray, is_weak: bool = False) -> int:
    """Number of blocks in which a signal rises to ``IMPACT_SHARE`` of its peak; all of them without a signal.

    With ``is_weak`` it is a force that rises above its noise, in the direction of its peak: afterwards an amplifier
    swings to the other side.
    """
    values = np.asarray(signal[:], dtype=float)
    is_number = np.abs(values) < LARGEST_NUMBER
    if not is_number.any():
        return len(edges) + 1
    level = np.where(is_number, values - np.median(values[is_number]), 0.0)
    least = IMPACT_SHARE * np.abs(level).max()
    if is_weak:
        level = level * np.sign(level[np.argmax(np.abs(level))])
        noise = MAD_TO_SD * float(np.median(np.abs(level)))
        least = max(WEAK_IMPACT_SHARE * level.max(), IMPACT_TO_NOISE * noise)
    else:
        level = np.abs(level)
    is_high = level >= least
    if not level.max() > 0.0 or edges[-1] >= len(values):
        return len(edges) + 1
    begins = np.flatnonzero(is_high & ~np.concatenate([[False], is_high[:-1]]))  # an impact on a border counts once
    return len(np.unique(np.searchsorted(edges, begins, side="right")))


def form_of_borders(column: Column, rate: float) -> Form | None:
    """What in the form of a column may be borders of records.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        A column as it is in the file.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    Form or None
        None for a signal, a constant, a flag that is 0 and another number, and a counter that does not begin again.

    Examples
    --------
    >>> form_of_borders(np.repeat([1, 2, 3], [600, 580, 590]), 2e4).text
    'changes 2 times, from 1 to 3 in blocks of 580 to 600 rows'
    >>> form_of_borders(np.tile(np.arange(600), 3), 2e4).text
    'begins again 2 times, each 600 rows'
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
        return _form_of_restarts(np.asarray(column[:], dtype=float), step, rate)
    return None


def _count_equal_steps(steps: np.ndarray, step: float) -> int:
    """Number of steps that are equal but for the rounding of printed numbers."""
    return int(np.count_nonzero(np.abs(steps - step) <= 0.5 * step))


def _form_of_blocks(values: np.ndarray, rate: float) -> Form | None:
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
    distinct = np.unique(numbers)
    open_form = Form(text, False, edges, is_flag=len(distinct) <= MAX_STATES)
    if len(distinct) == 2 and 0.0 in distinct:  # a flag
        is_halved = edges.size == 1 and abs(steps[0]) == 1 and lengths.min() >= MIN_FLAG_SHARE * lengths.max()
        return open_form if is_halved else None
    if (numbers[0] >= MIN_EPOCH or edges.size > 1) and _are_whole_times(steps, lengths, rate):
        return None if numbers[0] >= MIN_EPOCH else open_form
    are_alike = len(set(lengths[:-1].tolist())) == 1
    if (steps > 0).all() or (steps < 0).all():  # from 0 or 1 on by ones: no temperature or load in whole numbers
        is_certain = min(numbers[0], numbers[-1]) in (0.0, 1.0) and bool((np.abs(steps) == 1.0).all())
        are_packets = are_alike and len(set(lengths[1:-1].tolist())) == 1
        return Form(text, is_certain, edges, are_packets, is_flag=not is_certain and len(distinct) <= MAX_STATES)
    begins_again = bool(((steps == 1.0) | (numbers[1:] == numbers[0])).all())
    return open_form if begins_again or are_alike else None


def _are_whole_times(steps: np.ndarray, lengths: np.ndarray, rate: float) -> bool:
    """Whether numbers are whole units of time, as the seconds of a clock: as many samples as such a unit lasts."""
    for scale in TIME_SCALES:
        due = steps * scale * rate
        if (np.abs(lengths[1:-1] - due[1:]) <= 1.0).all() and (lengths[[0, -1]] <= due[[0, -1]] + 1.0).all():
            return True
    return False


def _form_of_restarts(values: np.ndarray, step: float, rate: float) -> Form | None:
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
    is_wrap = len(periods) == 1 and _is_end_of_counter(next(iter(periods)), step, rate)
    text = f"begins again {times}, each {extent} rows"
    return Form(text, not periods <= WRAP_PERIODS, falls, len(periods) == 1, is_wrap)


def _is_end_of_counter(period: int, step: float, rate: float) -> bool:
    """Whether counters, angles or samples within a second begin again after a number of samples."""
    is_power = period >= BYTE_PERIOD and period & (period - 1) == 0
    is_turn = abs(period * step - TURN_PERIOD) <= 0.5 * step
    return is_power or is_turn or period in WRAP_PERIODS or abs(period - rate) <= 1.0
