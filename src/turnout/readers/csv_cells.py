"""Cells of a text file that hold no number: marks for thousands, values that a spreadsheet misses, words."""

import re
from contextlib import contextmanager

import pyarrow as pa

from turnout.readers.raw import COPY_AGAIN

# Empty, or what loggers and spreadsheets write for a value that is not there: these become nan.
MISSING = (
    "", "NaN", "nan", "NA", "-", "#NV", "#N/A", "#NA", "#VALUE!", "#WERT!", "#DIV/0!", "#NUM!", "#ZAHL!", "#REF!",
    "#BEZUG!",
)  # fmt: skip
MARK = r"[ .,'’\u00a0\u202f]"  # between groups of three digits
THOUSANDS = re.compile(rf"[+-]?\d{{1,3}}(?:{MARK}\d{{3}})+(?:[.,]\d+)?")
REFUSED = re.compile(
    r"CSV column #(\d+): (?:Row #(\d+): )?CSV conversion error to \w+: invalid value '(.*)'", re.DOTALL
)


def stands_for_a_number(cell):
    """Whether a cell is a number that cannot be read, or one that is missing; an empty cell is neither.

    >>> stands_for_a_number("-1.234,5"), stands_for_a_number("#NV"), stands_for_a_number("13.05.2024")
    (True, True, False)
    """
    return bool(THOUSANDS.fullmatch(cell)) or (cell.startswith("#") and cell in MISSING)


@contextmanager
def cells_named(source, line, names):
    """Turn what pyarrow says of a cell in the rows below ``line`` into a ReadError with its line and column."""
    try:
        yield
    except pa.ArrowInvalid as error:
        if not (match := REFUSED.search(str(error))):
            raise
        column, row, cell = int(match[1]), match[2], match[3]
        where = f"line {line + int(row)}" if row else f"the numbers after line {line}"
        where += f", column {names[column] or str(column + 1)!r}"
        if THOUSANDS.fullmatch(cell):
            found = f"{cell!r} has marks for thousands, or another decimal mark than other numbers"
            remedy = "Export all numbers with one decimal mark and without marks for thousands"
        else:
            found = f"{cell[:60]!r} is no number"
            remedy = f"{COPY_AGAIN}; if it stands in the logger's own file too, leave that record out"
        raise source.error(where, found, remedy) from error
