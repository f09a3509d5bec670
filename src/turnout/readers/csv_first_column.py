"""First column of a text file that has no name, such as the numbers of the rows of R and pandas."""

import re
from collections.abc import Sequence
from mmap import mmap

import numpy as np

from turnout.readers.attached_units import TIME_WORDS, is_known, names_and_units_in
from turnout.readers.clock_texts import is_clock_or_date
from turnout.readers.column_forms import is_on_line
from turnout.readers.csv_cells import cells_of, decode_line, is_number
from turnout.readers.rate_units import rate_unit
from turnout.unit_spellings import without_brackets

N_ROWS = 64  # of which the first cells are compared
QUOTED_NUMBER = re.compile(rb'\s*"\d+"')


def with_unnamed_first_column(
    texts: list[list[str]], n_cell: int, data: bytes | mmap, offset: int, separator: str
) -> list[list[str]]:
    """Lines of names and units with an empty cell for a first column that has none.

    A line of names has a cell less than the rows, or the line of units below it has. The first column is the one
    without a name if it rises evenly and no other is meant: each name has a unit and none is the time, or the name of
    the time stands above the second column, which rises evenly as well, or the first cells are numbers in quotation
    marks.

    Parameters
    ----------
    texts : list of list of str
        Cells of the lines above the numbers.
    n_cell : int
        Number of cells of a row.
    data : bytes or mmap
        Bytes of the file.
    offset : int
        Byte of the first row.
    separator : str
        Separator of the cells.

    Returns
    -------
    list of list of str
        The same lines if nothing says which column has no name.
    """
    short = [i for i in range(len(texts) - 1, -1, -1) if len(texts[i]) == n_cell - 1 and _are_words(texts[i])]
    last = len(texts) - 1
    are_units = [all(is_known(without_brackets(cell)) for cell in line if cell) for line in texts]
    short = [i for i in short if i == last or (i == last - 1 and are_units[last])]
    if not short or n_cell < 3:
        return texts
    columns = _first_columns(data, offset, separator, n_cell)
    if columns is None or not is_on_line(columns[0]):
        return texts
    named = [i for i in short if not are_units[i]]
    if not named:  # units alone: the names are above them, with that of the first column
        return [["", *line] if i in short else line for i, line in enumerate(texts)]
    pairs = names_and_units_in(texts[named[0]])
    at_time = [k for k, (name, unit) in enumerate(pairs) if name.lower() in TIME_WORDS or _is_of_time(unit)]
    have_units = all(unit for _, unit in pairs) or (named[0] == last - 1 and are_units[last])
    is_second_the_time = at_time == [0] and is_on_line(columns[1]) and _counts(columns[0])
    is_quoted = QUOTED_NUMBER.match(data, offset) is not None and not at_time
    if is_second_the_time or (have_units and not at_time) or is_quoted:
        return [["", *line] if i in short else line for i, line in enumerate(texts)]
    return texts


def _are_words(cells: Sequence[str]) -> bool:
    return bool(cells) and all(cells) and not any(map(is_number, cells))


def _is_of_time(unit: str) -> bool:
    time_unit = rate_unit(unit)
    return time_unit is not None and time_unit.is_step


def _counts(numbers: np.ndarray) -> bool:
    """Whether numbers count the rows from 0 or 1."""
    return bool(numbers[0] in (0.0, 1.0) and (np.diff(numbers) == 1.0).all())


def _first_columns(data: bytes | mmap, offset: int, separator: str, n_cell: int) -> np.ndarray | None:
    """(2, n) numbers of the first two columns of the first rows; None if they are no numbers.

    Dates and times of day in the first column become an even rise.
    """
    rows: list[list[str]] = []
    while len(rows) < N_ROWS and offset < len(data):
        end = (data.find(b"\n", offset) + 1) or len(data)
        cells = cells_of(decode_line(data[offset:end]).strip(), separator)
        if any(cells):
            rows.append(cells[:2])
        if len(cells) != n_cell or not is_number(cells[1]) or not (is_number(cells[0]) or is_clock_or_date(cells[0])):
            return None
        offset = end
    if rows and all(is_clock_or_date(row[0]) for row in rows):
        rows = [[str(k / 2), row[1]] for k, row in enumerate(rows)]  # times are compared elsewhere
    elif not all(is_number(row[0]) for row in rows):
        return None
    return np.array([[float(cell.replace(",", ".")) for cell in row] for row in rows]).T
