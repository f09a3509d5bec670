"""Time axes of a record: its time column, and every column that no sensor of the layout uses and that rises evenly."""

from collections.abc import Collection, Iterator, Sequence, Set
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import numpy as np

from turnout.readers.column_forms import (
    HEAD_SIZE,
    MIN_AXIS_SIZE,
    counts_in_disorder,
    is_count_or_time,
    is_on_line,
    rises_evenly,
)
from turnout.readers.entries import Entry
from turnout.readers.entry_owners import named_channels, without_channels
from turnout.readers.lazy import Column
from turnout.readers.precision import EXACT_PRECISION, around
from turnout.readers.rate_statements import USUAL_RATES, Statement, statements_of, time_statement
from turnout.readers.rate_units import hertz_of, rate_unit, seconds_of, words_of
from turnout.readers.rate_vocabulary import CERTAIN, POSSIBLY, is_rate_name, is_time_name, name_meaning
from turnout.readers.source import MEANINGLESS_UNITS, RawRecord, Source
from turnout.readers.stated_units import known_unit
from turnout.readers.time_numbers import unit_of_axis
from turnout.readers.timing import check_time, rate_of_time, seconds_since_first

MAX_RATE_DIFFERENCE = 1e-3  # relative: axes of other rates have other units or contradict each other


def all_statements(
    record: RawRecord,
    k: int,
    n: int,
    measured: Set[int],
    where: str,
    source: Source,
    promised: float | None = None,
    checked: Collection[str] = (),
) -> list[Statement]:
    """All statements of a file about the sampling rate of a record: metadata, time axes and columns.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    k : int
        Number of the record, from 0.
    n : int
        Number of records.
    measured : set of int
        Columns that the layout assigns to a sensor: they are no time axes.
    where : str
        The record, for the message.
    source : Source
        The raw file.
    promised : float or None
        Rate that the layout states, or None. [Hz]
    checked : collection of str
        Names, without case, of which the layout says that they state nothing about the samples.

    Returns
    -------
    list of Statement
        In the order of the file.

    Raises
    ------
    ReadError
        If a time axis runs backwards, is not finite, jumps over missing samples, or is not even.
    """
    stated = statements_of(_without_names_of_channels(record, measured), k, n)
    is_proven = any(s.is_defined and _is_rate(s, promised) for s in stated)
    return stated + time_statements(record, measured, where, source, promised, checked, is_proven)


def _without_names_of_channels(record: RawRecord, measured: Set[int]) -> Iterator[Entry]:
    """The entries of a record; the rate of a channel, "dt_rail" or "dt (rail)", under the name of the rate alone.

    That of a channel that no sensor of the layout uses is left out.
    """
    for entry in record.entries:
        owners = named_channels(entry.name, record.names)
        name = without_channels(entry.name, [record.names[i] for i in owners]) if owners else ""
        if is_rate_name(name) and measured.isdisjoint(owners) and measured:
            continue
        if is_rate_name(name):
            place = entry.place if entry.name in entry.place else f"{entry.name!r} in {entry.place}"
            yield replace(entry, place=place, name=name)
        else:
            yield entry


def _is_rate(statement: Statement, promised: float | None) -> bool:
    """Whether a statement says the rate for certain, and that of the layout if there is one."""
    if statement.certainty != CERTAIN or not statement.intervals:
        return False
    if promised is None:
        is_usual = USUAL_RATES[0] <= statement.usual.rate <= USUAL_RATES[1]
        return len(statement.intervals) == 1 or (statement.is_clock and is_usual)
    return statement.agrees_with(around(promised, EXACT_PRECISION))


def time_statements(
    record: RawRecord,
    measured: Set[int],
    where: str,
    source: Source,
    promised: float | None = None,
    checked: Collection[str] = (),
    is_proven: bool = False,
) -> list[Statement]:
    """Statements of all time axes of a record, and of columns that repeat the rate in every row.

    A time axis with the layout's rate that runs forward proves the order of the samples, and so does the step that the
    format defines. Beside it a column that rises or falls evenly is no axis unless its name or its unit says so.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    measured : set of int
        Columns that the layout assigns to a sensor: they are no time axes.
    where : str
        The record, for the message.
    source : Source
        The raw file.
    promised : float or None
        Rate that the layout states, or None. [Hz]
    checked : collection of str
        Names, without case, of which the layout says that they state nothing about the samples.
    is_proven : bool
        Whether the format itself defines a step with that rate.

    Returns
    -------
    list of Statement
        Their rates.

    Raises
    ------
    ReadError
        If a time axis runs backwards, is not finite, jumps over missing samples, or is not even, or if two of them
        begin apart.
    """
    statements = []
    starts: list[tuple[str, float, float, int]] = []
    axes = [] if record.time is None else [_time_column(record)]
    axes += [(place, time, True, CERTAIN) for place, time in record.clocks]
    axes += _columns(record, measured, checked)
    for place, time, is_in_seconds, certainty in sorted(axes, key=lambda axis: axis[3] != CERTAIN):
        is_needed = certainty == CERTAIN or not is_proven
        if len(time) <= 2 or not (is_needed or is_count_or_time(time)):
            continue
        if is_needed:
            check_time(
                np.asarray(time, dtype=float), where if place == "its time column" else f"{where}, {place}", source
            )
        rate, tolerance, _ = rate_of_time(time)
        starts.append((place, float(time[0]), rate, len(time)))
        if is_needed:
            statements.append(time_statement(place, rate, tolerance, is_in_seconds, certainty))
            is_proven = is_proven or _is_rate(statements[-1], promised)
    _check_same_start(starts, where, source)
    _check_counters(record, measured, checked, is_proven, where, source)
    return statements + statements_of(_constant_columns(record, measured))


def _check_same_start(starts: Sequence[tuple[str, float, float, int]], where: str, source: Source) -> None:
    """ReadError if two time axes of one rate begin apart: loggers write one for each group of channels.

    Axes that do not overlap count from other origins, as a clock does, and are not compared.

    Parameters
    ----------
    starts : sequence of (str, float, float, int)
        Place, first time, samples per unit of time and number of samples of each axis.
    where : str
        The record, for the message.
    source : Source
        The raw file.
    """
    for place, start, rate, n_sample in starts[1:]:
        first_place, first_start, first_rate, _ = starts[0]
        lag = (start - first_start) * rate
        if abs(rate / first_rate - 1.0) < MAX_RATE_DIFFERENCE and 0.5 < abs(lag) < n_sample:
            problem = f"{place} begins {abs(lag):.6g} samples {'after' if lag > 0 else 'before'} {first_place}"
            remedy = (
                "Export the channels cut to the stretch that they share; if all were sampled at once, leave one out, "
                "or name it under 'checked_entries' if neither its name nor its unit is one of time"
            )
            raise source.error(where, problem, remedy, reason="clock_drift")


def is_axis_name(name: str, unit: str) -> bool:
    """Whether a column is a time axis by its name, so that the layout need not name it.

    Parameters
    ----------
    name : str
        Name of the column.
    unit : str
        Its unit, "" if not stated.

    Returns
    -------
    bool
        False if its unit is known and is no unit of time.
    """
    return (is_time_name(name) or name.startswith("__index_level_")) and not is_unit_of_no_time(unit)


# Units of other quantities than time, beside those of sensors and of frequencies, that a column beside them may have.
OTHER_UNITS = frozenset(
    """
    km dm cm ft feet foot in inch inches yd yard mi mile miles mph kph kmh km/t kt kts knots ft/s in/s mm/s cm/s mm/min
    m/min ° deg rad mrad gon grad rev U turns °/s deg/s rad/s °/m
    A kA mA µA VA kVA W kW MW mW Wh kWh J kJ Ω ohm kΩ Ohm mV/V µV/V V/V mV/mA mAh Ah
    Nm N·m N*m kNm lbf kgf lb lbs kg g/m³ N/mm² kN/m kN/m² Pa hPa kPa MPa bar mbar psi mmHg
    dB dBA dB(A) ‰ % lx m² m³ l/min mm²
    """.split()
)


@lru_cache(maxsize=4096)
def is_unit_of_no_time(unit: str) -> bool:
    """Whether a unit is known and is one of another quantity than time.

    Parameters
    ----------
    unit : str
        Unit of a column as it is written, "" if not stated.

    Returns
    -------
    bool
        False for a unit of time, and for one that is not known: it may be one of time in any language.

    Examples
    --------
    >>> [is_unit_of_no_time(unit) for unit in ("°C", "Hz", "ms", "ezredmp", "")]
    [True, True, False, False, False]
    """
    plain = unit.strip()
    if plain.casefold() in MEANINGLESS_UNITS:
        return False
    of_rate = rate_unit(plain)
    if of_rate is not None:
        return not of_rate.is_step
    return known_unit(plain) is not None or hertz_of(plain) is not None or plain.strip("[]() ") in OTHER_UNITS


def _time_column(record: RawRecord) -> tuple[str, np.ndarray, bool, int]:
    """(place, values, whether in seconds, certainty) of the time column of a record."""
    time = np.asarray(record.time)
    unit = None if record.is_time_in_seconds else _unit_of_count(time, record.time_label)
    place = "its time column"
    return (place, time * float(unit), True, CERTAIN) if unit else (place, time, record.is_time_in_seconds, CERTAIN)


def _unit_of_count(column: Column, declared: str) -> Fraction | None:
    """Unit of an axis whose first number is a time since a known origin, such as ns since 1970. [s]"""
    if column.dtype.kind not in "fiu" or len(column) <= 2:
        return None
    first, second = (value.item() for value in np.asarray(column[:2]))
    return unit_of_axis(first, declared, float(second - first))


def is_dated_axis(column: Column, declared: str) -> bool:
    """Whether a column is a time axis under any name: it rises evenly, and one usual count puts it into our years.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        The column.
    declared : str
        Its name and unit.

    Returns
    -------
    bool
    """
    return (
        column.dtype.kind in "fiu"
        and len(column) >= MIN_AXIS_SIZE
        and rises_evenly(column[:HEAD_SIZE])
        and _unit_of_count(column, declared) is not None
    )


def _columns(
    record: RawRecord, measured: Set[int], checked: Collection[str] = ()
) -> Iterator[tuple[str, np.ndarray, bool, int]]:
    """(place, values, whether in seconds, certainty) of the columns that are time axes."""
    for i, (name, unit, column) in enumerate(zip(record.names, record.units, record.samples)):
        if i in measured or column.dtype.kind not in "fiumM" or len(column) <= 2:
            continue
        if column.dtype.kind in "mM":
            stamps = np.asarray(column[:])
            if (stamps != stamps[0]).any():
                yield f"column {name!r}", seconds_since_first(stamps), True, CERTAIN
            continue
        if is_unit_of_no_time(unit):
            continue
        known = rate_unit(unit) or next((rate_unit(w) for w in words_of(name)[1:][-1:] if seconds_of(w)), None)
        is_time_unit = known is not None and known.is_step
        by_name = is_time_name(name)
        is_axis = by_name or (rises_evenly(column[:HEAD_SIZE]) and (is_time_unit or not _is_checked(name, checked)))
        if not is_axis:
            continue
        unit_of_count = None if is_time_unit else _unit_of_count(column, name)
        scale = known.scale if is_time_unit and known else unit_of_count or 1
        is_in_seconds = is_time_unit or unit_of_count is not None
        certainty = CERTAIN if by_name or is_in_seconds else POSSIBLY
        is_unknown = not is_time_unit and unit.strip().casefold() not in MEANINGLESS_UNITS
        place = f"column {name!r} in the unknown unit {unit!r}" if is_unknown else f"column {name!r}"
        place = place if certainty == CERTAIN else f"{place}, which rises evenly"
        yield place, np.asarray(column[:], dtype=float) * float(scale), is_in_seconds, certainty


def has_time_in_seconds(record: RawRecord, measured: Set[int]) -> bool:
    """Whether a record has a time axis in a known unit; ``time_statements`` checks that it runs on evenly.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    measured : set of int
        Columns that the layout assigns to a sensor: they are no time axes.

    Returns
    -------
    bool
    """
    axes = [] if record.time is None else [_time_column(record)]
    is_known = any(is_in_seconds for *_, is_in_seconds, _ in axes) or bool(record.clocks)
    return is_known or any(is_in_seconds for *_, is_in_seconds, _ in _columns(record, measured))


REVERSE_REMEDY = (
    "Sort the rows by this column and export them again; if it is no time and no count, give it the unit of its "
    "quantity in the layout, or name it under 'checked_entries'"
)


def _is_checked(name: str, checked: Collection[str]) -> bool:
    return name.strip().casefold() in checked


def _check_counters(
    record: RawRecord, measured: Set[int], checked: Collection[str], is_proven: bool, where: str, source: Source
) -> None:
    """ReadError if a column that counts the samples leaves one out, or shows that they are in another or reverse order.

    A column that falls shows nothing if a time axis runs forward. A counter that begins again is no gap: it counts
    within a record, or has reached its largest number.
    """
    for i, (name, column) in enumerate(zip(record.names, record.samples)):
        if i in measured or column.dtype.kind not in "fiu" or len(column) < MIN_AXIS_SIZE or _is_checked(name, checked):
            continue
        may_be_reversed = not is_proven and not is_unit_of_no_time(record.units[i])
        if may_be_reversed and is_on_line(-np.asarray(column[:HEAD_SIZE], dtype=float)):
            problem = f"column {name!r} falls evenly from its first sample on: the samples may be in reverse order"
            raise source.error(where, problem, REVERSE_REMEDY, "clock_backwards")
        if counts_in_disorder(column):
            problem = f"the samples are not in the order in which column {name!r} counts them"
            raise source.error(where, problem, "Sort the rows by this column and export them again", "clock_backwards")
        steps = np.diff(np.asarray(column[:HEAD_SIZE], dtype=float))
        if np.count_nonzero(steps == 1.0) < MIN_COUNTING_SHARE * len(steps):
            continue
        count = np.asarray(column[:], dtype=float)
        if (is_jump := np.diff(count) > 1.0).any():
            k = int(np.argmax(is_jump))
            problem = f"column {name!r} counts from {count[k]:.12g} to {count[k + 1]:.12g}: samples are missing"
            remedy = "Copy the file again from the logger; if the gap is there too, the logger lost samples"
            raise source.error(where, problem, remedy, reason="truncated")


MIN_COUNTING_SHARE = 0.9  # of the first steps of a counter are 1; it may begin again some times


def _constant_columns(record: RawRecord, measured: Set[int]) -> Iterator[Entry]:
    """Columns that are named like a rate or a step and hold one number in every row."""
    for i, (name, unit, column) in enumerate(zip(record.names, record.units, record.samples)):
        full_name = f"{name} [{unit}]" if unit.strip() else name
        if i in measured or column.dtype.kind not in "fiu" or name_meaning(full_name).certainty != CERTAIN:
            continue
        values = np.unique(np.asarray(column[:], dtype=float))
        values = values[np.isfinite(values)]
        if values.size == 1:
            yield Entry(f"column {name!r}", full_name, float(values[0]))
