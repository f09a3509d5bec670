"""Start of a recording in its first sample: a date and a time of day, or a count from a known origin."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from turnout.readers.calendar_dates import DATED, orders_of_date, time_of_match
from turnout.readers.clock_texts import CLOCK, DATE_ALONE, ClockColumn
from turnout.readers.lazy import Column
from turnout.readers.rate_units import rate_unit, words_of
from turnout.readers.rate_vocabulary import is_time_name
from turnout.readers.source import RawRecord
from turnout.readers.stamp_texts import plain_stamp
from turnout.readers.stated_starts import OTHER, has_date_word, is_other_start, is_start_name
from turnout.readers.texts import decode_text
from turnout.readers.time_axes import is_dated_axis
from turnout.readers.time_numbers import SINCE, is_unset, time_of_number

TIME_OF_DAY = re.compile(rf" *{CLOCK} *")
UNIT_AT_END = re.compile(r"[\[(]([^\[\]()]*)[\])]$")


def start_in_cells(cells: Sequence[str], names: Sequence[str]) -> tuple[datetime | None, str]:
    """Start time in the first row of a text table, and its text if it cannot be read.

    Parameters
    ----------
    cells : sequence of str
        Cells of the first row.
    names : sequence of str
        Names of the columns; those of other events, such as an export, state no start.

    Returns
    -------
    tuple of (datetime or None, str)
        The start, with a zone if the cell states one; without a start, the text of date and time of day, "" if there
        are none.

    Examples
    --------
    >>> start_in_cells(["13.05.2026 10:00:00,5", "1,5"], ["Zeit", "Kraft"])
    (datetime.datetime(2026, 5, 13, 10, 0, 0, 500000), '')
    >>> start_in_cells(["05/06/2026", "10:00:00", "1.5"], ["Date", "Time", "Force"])
    (None, '05/06/2026 10:00:00: day or month first?')
    """
    cells = [
        plain_stamp(cell).strip()
        for cell, name in zip(cells, names)
        if not any(OTHER.search(w) for w in words_of(name))
    ]
    dated = [cell for cell in cells if DATED.fullmatch(cell)]
    if not dated:
        dates = [cell for cell in cells if DATE_ALONE.fullmatch(cell)]
        clocks = [cell for cell in cells if TIME_OF_DAY.fullmatch(cell)]
        dated = [f"{dates[0]} {clocks[0]}"] if len(dates) == len(clocks) == 1 else []
    if not dated:
        return None, ""
    match = DATED.fullmatch(dated[0])
    orders = orders_of_date(match[1]) if match else []
    start = time_of_match(orders[0], match) if match and len(orders) == 1 else None
    question = ": day or month first?" if len(orders) > 1 else ""
    return start, "" if start else dated[0] + question


def start_or_clock_in_cells(cells: Sequence[str], names: Sequence[str]) -> tuple[datetime | None, str]:
    """As ``start_in_cells``, with the time of day alone where no date is beside it.

    Parameters
    ----------
    cells : sequence of str
        Cells of the first row.
    names : sequence of str
        Names of the columns.

    Returns
    -------
    tuple of (datetime or None, str)
        A clock that begins at 0 counts from the beginning of the recording and is none.

    Examples
    --------
    >>> start_or_clock_in_cells(["10:00:00,5", "1,5"], ["Zeit", "Kraft"]), start_or_clock_in_cells(["00:00:00"], ["t"])
    ((None, '10:00:00,5'), (None, ''))
    """
    start, text = start_in_cells(cells, names)
    if start or text:
        return start, text
    clocks = [cell for cell in (plain_stamp(cell).strip() for cell in cells) if TIME_OF_DAY.fullmatch(cell)]
    return None, clocks[0] if len(clocks) == 1 and not clocks[0].startswith("00:00:00") else ""


def start_in_columns(columns: Mapping[str, Column]) -> tuple[datetime | None, str]:
    """Start time in the first row of columns that are texts, or were before they became durations.

    Parameters
    ----------
    columns : mapping of str to Column
        Columns by name; those of numbers take no part.

    Returns
    -------
    tuple of (datetime or None, str)
        As ``start_or_clock_in_cells``.
    """
    clocks = {name: column for name, column in columns.items() if isinstance(column, ClockColumn) and len(column)}
    cells = {name: column.first_text for name, column in clocks.items()}
    cells |= {name: _text(c) for name, c in columns.items() if c.dtype.kind in "OUST" and c.ndim == 1 and len(c)}
    start, text = start_or_clock_in_cells([*cells.values()], [*cells])
    elapsed = [column[0] / np.timedelta64(1, "us") for column in clocks.values()]
    return (start + timedelta(microseconds=float(elapsed[0])) if start and len(elapsed) == 1 else start), text


def _text(column: Column) -> str:
    """Text of the first value of a column."""
    first = column[:1][0]
    return decode_text(first) if isinstance(first, bytes) else str(first)


def starts_of_axes(record: RawRecord) -> list[tuple[datetime | None, str]]:
    """Start that each time axis of a record states in its first sample: a time stamp, or a count from a known origin.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    list of tuple of (datetime or None, str)
        The start, or the text of one that cannot be read. Axes that count from the start of the recording take no
        part, and times of day without a date neither.
    """
    starts = [(start, text) for start, text in record.axis_starts if not TIME_OF_DAY.fullmatch(text)]
    if record.time is not None and len(record.time) > 1:
        starts.append(_start_of_time_column(record.time, record.time_label, record.is_time_in_seconds))
    for name, unit, column in zip(record.names, record.units, record.samples):
        declared = f"{name} [{unit}]" if unit.strip() else name
        is_dated = (
            is_time_name(name) or (is_start_name(name) and has_date_word(name)) or is_dated_axis(column, declared)
        )
        if is_dated and column.dtype.kind in "fiu" and len(column) > 1:
            starts.append(_start_of_axis(column, declared))
    return [(start, text) for start, text in starts if start or text]


def _start_of_time_column(time: np.ndarray, label: str, is_in_seconds: bool) -> tuple[datetime | None, str]:
    """Start of a time column; one that was converted to seconds counts in the unit in its label: days are days."""
    in_brackets = UNIT_AT_END.search(label) if is_in_seconds else None
    since = SINCE.search(in_brackets[1]) if in_brackets else None
    unit = rate_unit(since[1] if since else in_brackets[1]) if in_brackets else None
    if unit and unit.is_step:
        return _start_of_axis(time / float(unit.scale), label)
    return _start_of_axis(time, f"{label} [s]" if is_in_seconds else label)


def _start_of_axis(column: Column, declared: str) -> tuple[datetime | None, str]:
    first, second = (value.item() for value in np.asarray(column[:2]))
    return time_of_number(first, declared, step=float(second - first))


def with_axis_start(record: RawRecord) -> RawRecord:
    """The record with the start of its time axes if its metadata state none; one of another day is reported.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        The same record if no axis states a start.
    """
    if record.unread_start or not (starts := starts_of_axes(record)):
        return record
    times = [start for start, _ in starts if start]
    if record.started_at is None and not times:
        return replace(record, unread_start=starts[0][1])
    set_times = [time for time in times if not is_unset(time)]
    stated = None if set_times and is_unset(record.started_at) else record.started_at
    used = stated or (set_times or times)[0]
    times = times if is_unset(used) else set_times
    second = next((start for start in times if is_other_start(start, used)), None)
    return replace(record, started_at=used, unread_start=str(second) if second else "")
