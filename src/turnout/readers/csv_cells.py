"""Cells of a text file: marks of missing values and of thousands, and cells that are no numbers."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from mmap import mmap

import numpy as np
import pyarrow as pa

from turnout.readers.source import COPY_AGAIN, Source

# What loggers and spreadsheets write for a missing value; these become nan.
MISSING_VALUES = (
    "", "NaN", "nan", "NA", "N/A", "n/a", "null", "NULL", "-", "--", "---", "1.#QNAN", "-1.#IND", "1.#INF",
    "#NV", "#N/A", "#NA", "#VALUE!", "#WERT!", "#DIV/0!", "#NUM!", "#ZAHL!", "#REF!",
    "#BEZUG!",
)  # fmt: skip
THOUSANDS_MARK = r"[ .,'’\u00a0\u202f]"  # between groups of three digits
THOUSANDS = re.compile(rf"[+-]?\d{{1,3}}(?:{THOUSANDS_MARK}\d{{3}})+(?:[.,]\d+)?")
DECIMAL = re.compile(r"[+-]?\d*[.,]\d+(?:[eE][+-]?\d+)?")
INVALID_VALUE = re.compile(
    r"CSV column #(\d+): (?:Row #(\d+): )?CSV conversion error to \w+: invalid value '(.*)'", re.DOTALL
)

OTHER_WIDTH = re.compile(r"CSV parse error: (?:Row #(\d+): )?Expected (\d+) columns, got (\d+): ?(.*)", re.DOTALL)
NO_ROW_REMEDY = (
    f"{COPY_AGAIN}; if the logger's own file has it too, delete the lines that are no samples or leave that record out"
)

PLAIN_NUMBER_REMEDY = "Export numbers as '-12.5' or '-1.25e1', without other signs and without units"


def is_unreadable_number(cell: str) -> bool:
    """Whether a cell is a number with thousands marks or the mark of a missing number.

    Parameters
    ----------
    cell : str
        Text of the cell, without blanks around it.

    Returns
    -------
    bool
        False for an empty cell and for any other text.

    Examples
    --------
    >>> is_unreadable_number("-1.234,5"), is_unreadable_number("#NV"), is_unreadable_number("13.05.2024")
    (True, True, False)
    """
    return bool(THOUSANDS.fullmatch(cell)) or (cell.startswith("#") and cell in MISSING_VALUES)


@contextmanager
def cell_errors(source: Source, line: int, names: Sequence[str]) -> Iterator[None]:
    """Context that converts pyarrow's error about a cell to a ReadError with its line and column.

    Parameters
    ----------
    source : Source
        The text file.
    line : int
        Number of the last line above the rows, from 1.
    names : sequence of str
        Names of the columns.

    Raises
    ------
    ReadError
        If a cell in the rows is no number.
    """
    try:
        yield
    except pa.ArrowInvalid as error:
        if match := OTHER_WIDTH.search(str(error)):
            where = f"line {line + int(match[1])}" if match[1] else f"the numbers after line {line}"
            count = "1 cell" if match[3] == "1" else f"{match[3]} cells"
            problem = f"a row has {count} instead of {match[2]}: {match[4].strip()[:60]!r}"
            raise source.error(where, problem, NO_ROW_REMEDY) from error
        if not (match := INVALID_VALUE.search(str(error))):
            raise
        column, row, cell = int(match[1]), match[2], match[3]
        where = f"line {line + int(row)}" if row else f"the numbers after line {line}"
        where += f", column {names[column] or str(column + 1)!r}"
        if THOUSANDS.fullmatch(cell) or DECIMAL.fullmatch(cell):
            problem = f"{cell!r} has marks for thousands, or another decimal mark than other numbers"
            remedy = "Export all numbers with one decimal mark and without marks for thousands"
        else:
            problem = f"{cell[:60]!r} is no number"
            remedy = PLAIN_NUMBER_REMEDY if re.search(r"\d", cell) else NO_ROW_REMEDY
        raise source.error(where, problem, remedy) from error


MIN_WHOLE_SHARE = 0.05  # of numbers printed with decimals, one in a thousand is whole by chance; three decimals


def check_thousands(
    column: np.ndarray, i: int, name: str, data: bytes | mmap, offset: int, separator: str, source: Source
) -> None:
    """Check that the marks in a column are decimal marks, and not marks for thousands.

    With marks for thousands every number below 1000 is whole, and every other one has three digits behind its mark.

    Parameters
    ----------
    column : (n,) array of float
        Numbers of the column, with the mark read as decimal mark.
    i : int
        Number of the column, from 0.
    name : str
        Name of the column.
    data : bytes or mmap
        Bytes of the file.
    offset : int
        Byte of the first number.
    separator : str
        Separator of the cells.
    source : Source
        The text file.

    Raises
    ------
    ReadError
        If the column has marks for thousands.
    """
    if column.dtype.kind != "f":
        return
    broken = (column != np.rint(column)) & np.isfinite(column)
    n_broken = int(np.count_nonzero(broken))
    if not n_broken or column.size - n_broken < MIN_WHOLE_SHARE * column.size:
        return
    sizes = np.abs(column[broken])
    if sizes.min() < 1.0 or sizes.max() >= 1000.0:
        return
    rows = data[offset:].splitlines()
    cells = [
        rows[k].split(separator.encode())[i].decode("utf-8", "replace").strip(' "')
        for k in np.flatnonzero(broken)
        if k < len(rows)
    ]
    if all(THOUSANDS.fullmatch(cell) for cell in cells):
        first = int(np.argmax(broken))
        line = data[:offset].count(b"\n") + first + 1
        problem = f"{cells[0]!r} has a mark for thousands, as {n_broken} of {column.size} numbers of this column"
        remedy = "Export all numbers with one decimal mark and without marks for thousands"
        raise source.error(f"line {line}, column {name or str(i + 1)!r}", problem, remedy)
