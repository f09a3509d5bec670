"""Numbers of a text file whose only mark may be one for thousands or the decimal mark, as "32,768" in every row."""

import re
from collections.abc import Iterator, Mapping, Sequence
from mmap import mmap

import numpy as np

from turnout.errors import ReadError
from turnout.readers.csv_cells import cells_of, decode_line, is_number
from turnout.readers.lazy import Column
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_units import known_unit

GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
N_ROWS = 1000  # rows whose cells are examined as text, before all numbers of the columns
# Dimensions of which no sensor gives a thousand units: there the mark is a decimal mark.
DIMENSIONS_OF_SMALL_NUMBERS = ("temperature", "strain")
UNITS_OF_SMALL_NUMBERS = ("V", "g", "kN", "MN", "m/s", "m", "km/h")
MARK_REMEDY = "Export all numbers with one decimal mark and without marks for thousands"


def ambiguous_marks(columns: Sequence[Column], data: bytes | mmap, offset: int, separator: str) -> dict[int, str]:
    """Columns whose numbers may have a mark for thousands, while no other number of the file decides it.

    Each number with a mark has three digits behind it and one to three before it, of which the first is not 0.

    Parameters
    ----------
    columns : sequence of (n,) Column
        Columns as they were read, with the mark as decimal mark.
    data : bytes or mmap
        Bytes of the file.
    offset : int
        Byte of the first number.
    separator : str
        Separator of the cells.

    Returns
    -------
    dict of int to str
        Number of the column, from 0, and its first cell with a mark. Empty if a number of another form shows that the
        mark is a decimal mark.
    """
    first: dict[int, str] = {}
    position = offset
    for _ in range(N_ROWS):
        end = data.find(b"\n", position)
        if end < 0:
            break
        for i, cell in enumerate(cells_of(decode_line(data[position:end]), separator)):
            if (
                i >= len(columns)
                or columns[i].dtype.kind != "f"
                or not re.search("[.,eE]", cell)
                or not is_number(cell)
            ):
                continue
            if not GROUPED.fullmatch(cell):
                return {}
            first.setdefault(i, cell)
        position = end + 1
    if not first:
        return {}
    return first if all(map(_may_be_grouped, (c for c in columns if c.dtype.kind == "f"))) else {}


def _may_be_grouped(column: Column) -> bool:
    """Whether all numbers that are not whole have a size from 1 to 1000 and at most three decimals."""
    values = np.abs(np.asarray(column[:]))
    values = values[np.isfinite(values) & (values != np.rint(values))]
    thousandths = 1000.0 * values
    are_grouped = (values >= 1.0) & (values < 1000.0) & (np.abs(thousandths - np.rint(thousandths)) < 1e-6)
    return bool(are_grouped.all())


def mark_errors(record: RawRecord, units: Mapping[int, str], where: str, source: Source) -> Iterator[ReadError]:
    """Remarks on channels whose numbers may have a mark for thousands.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    units : mapping of int to str
        Units in use of the channels that are read, by their numbers.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        For each channel with a unit that leaves it open.

    Raises
    ------
    ReadError
        If a channel of counts has such numbers: counts have no decimals.
    """
    for i, cell in record.marked_numbers.items():
        if i not in units:
            continue
        known = known_unit(units[i])
        place = f"{where}, channel {record.names[i]!r}"
        if known is not None and known.dimension == "count":
            problem = f"{cell!r} has a mark for thousands, as its other numbers: counts have no decimals"
            raise source.error(place, problem, MARK_REMEDY, reason="scale_unknown")
        if known is not None and (known.dimension in DIMENSIONS_OF_SMALL_NUMBERS or units[i] in UNITS_OF_SMALL_NUMBERS):
            continue
        problem = (
            f"the mark in {cell!r} may be one for thousands: each number has three digits behind it. It is read as "
            "the decimal mark"
        )
        yield source.error(
            place, problem, f"Compare a value with what the logger shows. {MARK_REMEDY}", "entry_unknown"
        )
