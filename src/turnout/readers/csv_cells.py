"""Lines of a text file and their cells: separators, marks of missing values and of thousands, text among numbers."""

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from mmap import mmap

import numpy as np
import pyarrow as pa

from turnout.readers.clock_texts import is_clock_or_date
from turnout.readers.source import COPY_AGAIN, HEAD_SIZE, Source
from turnout.readers.texts import decode_text

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
DECIMAL_COMMA_REMEDY = (
    f"{NO_ROW_REMEDY}; where the decimal mark is a comma, export with semicolons or tabs between columns"
)

ZERO_BYTES = "zero bytes, to which nothing was written,"
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


def decode_line(data: bytes) -> str:
    """One line as text: UTF-8, else Windows-1252 of older western loggers.

    Parameters
    ----------
    data : bytes
        The line.

    Returns
    -------
    str
        Its text without line break; a byte that neither encoding has becomes a replacement character.
    """
    return decode_text(data).strip("\r\n")


BLANK = " "
SEPARATORS = ("\t", ";", "|")  # a line with one of them is not separated by commas or blanks
# a word with a unit in brackets behind it, a text between quotation marks, or brackets alone in a line of units
WORD = re.compile(r'"[^"]*"(?: *[\[(][^\])]*[\])])?|[\[(][^\])]*[\])](?=\s|$)|[^\s"]+(?: *[\[(][^\])]*[\])])?')


def cells_of(line: str, separator: str) -> list[str]:
    """Cells of a line.

    Parameters
    ----------
    line : str
        The line.
    separator : str
        Separator of the cells; between blanks every word is a cell, with the unit in brackets behind it.

    Returns
    -------
    list of str
        Without blanks and quotation marks around them.

    Examples
    --------
    >>> cells_of('"force [N]"; -1,5 ', ";"), cells_of("# force [N]  rail (m/s²)", " ")
    (['force [N]', '-1,5'], ['force [N]', 'rail (m/s²)'])
    >>> cells_of('"Kraft; Hammer [N]";-1,5', ";")
    ['Kraft; Hammer [N]', '-1,5']
    >>> cells_of('disc 12"; rail 5"', ";")
    ['disc 12', 'rail 5']
    >>> cells_of("  [s]   [N]  (m/s²)", " ")
    ['[s]', '[N]', '(m/s²)']
    """
    if separator == BLANK:
        return [word.replace('"', "") for word in WORD.findall(line.lstrip("#%").strip())]
    is_quoted = re.search(rf'(?:^|{re.escape(separator)}) *"', line) if separator != "," else '"' in line
    if is_quoted and line.count('"') % 2 == 0:  # a separator between quotation marks separates nothing
        with suppress(csv.Error):  # a byte that no text has
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    return [cell.strip().strip('"') for cell in line.split(separator)]


BREAK_IN_CELL = re.compile(rb'(?:^|(?<=[;,\t|]))"[^"\n]{0,80}\n[^"]{0,80}"(?=[;,\t|\r\n])', re.MULTILINE)


def with_whole_cells(data: bytes) -> bytes:
    """A text with a blank in place of each line break between the quotation marks of a cell of its head.

    Parameters
    ----------
    data : bytes
        The text.

    Returns
    -------
    bytes
        As many lines: an empty one stands above a line for each that was joined to it.

    Examples
    --------
    >>> with_whole_cells(b'"force\\n[N]";rail\\n1;2\\n')
    b'\\n"force [N]";rail\\n1;2\\n'
    """
    while match := BREAK_IN_CELL.search(data, 0, HEAD_SIZE):
        start = data.rfind(b"\n", 0, match.start()) + 1
        cell = re.sub(rb"[\r\n]+", b" ", match[0])
        empty_lines = b"\n" * match[0].count(b"\n")
        data = data[:start] + empty_lines + data[start : match.start()] + cell + data[match.end() :]
    return data


def first_cells(data: bytes | mmap, offset: int, separator: str) -> list[str]:
    """Cells of the first row of samples.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    offset : int
        Byte of the first number.
    separator : str
        Separator of the cells.

    Returns
    -------
    list of str
        Without blanks around them.
    """
    end = data.find(b"\n", offset)
    return cells_of(decode_line(data[offset : end if end >= 0 else len(data)]), separator)


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a decimal mark of either kind.

    Parameters
    ----------
    cell : str
        Text of the cell.

    Returns
    -------
    bool
        True also for "nan" and "inf".
    """
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def is_row(cells: Sequence[str]) -> bool:
    """Whether cells are a row of samples: numbers, or marks of missing ones, beside dates and times of day.

    Parameters
    ----------
    cells : sequence of str
        Cells of a line.

    Returns
    -------
    bool
        False without any number.

    Examples
    --------
    >>> is_row(["10:00:00.5", "-1,5", ""]), is_row(["force", "-1,5"]), is_row(["13.05.2026", "10:00:00"])
    (True, False, False)
    """
    is_of_numbers = [is_number(cell) or is_unreadable_number(cell) for cell in cells]
    filled = [cell for cell, is_of_number in zip(cells, is_of_numbers) if cell and not is_of_number]
    return any(is_of_numbers) and all(map(is_clock_or_date, filled))


def is_text(cell: str) -> bool:
    """Whether a cell holds a text: a word, a date or a time of day.

    Parameters
    ----------
    cell : str
        Text of the cell, without blanks around it.

    Returns
    -------
    bool
        False for a number, an empty cell and the mark of a missing number.

    Examples
    --------
    >>> [is_text(cell) for cell in ("LLHL", "10:00:01", "-1,5", "", "NaN", "1.234,5")]
    [True, True, False, False, False, False]
    """
    return is_clock_or_date(cell) or is_word(cell)


def is_word(cell: str) -> bool:
    """Whether a cell holds a text that is neither a date nor a time of day.

    Parameters
    ----------
    cell : str
        Text of the cell, without blanks around it.

    Returns
    -------
    bool
    """
    is_of_numbers = cell in MISSING_VALUES or is_number(cell) or is_unreadable_number(cell)
    return not is_of_numbers and not is_clock_or_date(cell)


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
            if "\0" in match[4]:
                raise source.error(where, f"{ZERO_BYTES} in a row of numbers", COPY_AGAIN) from error
            has_one_comma_mark = "," in match[4] and not re.search(r"[;\t|]", match[4])
            remedy = DECIMAL_COMMA_REMEDY if has_one_comma_mark else NO_ROW_REMEDY
            raise source.error(where, problem, remedy) from error
        if not (match := INVALID_VALUE.search(str(error))):
            raise
        column, row, cell = int(match[1]), match[2], match[3]
        where = f"line {line + int(row)}" if row else f"the numbers after line {line}"
        where += f", column {names[column] or str(column + 1)!r}"
        if THOUSANDS.fullmatch(cell) or DECIMAL.fullmatch(cell):
            problem = f"{cell!r} has marks for thousands, or another decimal mark than other numbers"
            remedy = "Export all numbers with one decimal mark and without marks for thousands"
        elif not cell or "\0" in cell:
            content = ZERO_BYTES if cell else "blanks"
            problem, remedy = f"{content} in place of a number", COPY_AGAIN
        else:
            problem = f"{cell[:60]!r} is no number"
            remedy = PLAIN_NUMBER_REMEDY if re.search(r"\d", cell) else NO_ROW_REMEDY
        raise source.error(where, problem, remedy) from error


MIN_WHOLE_SHARE = 0.05  # of numbers printed with decimals, one in a thousand is whole by chance; three decimals


@dataclass
class MarkStatistics:
    """Numbers of a column, and those with digits behind the mark: how many, and their least and largest size.

    With marks for thousands every number below 1000 is whole, and every other one has three digits behind its mark.
    """

    n: int = 0
    n_broken: int = 0
    smallest: float = np.inf
    largest: float = 0.0

    def add(self, column: np.ndarray) -> None:
        """Count further numbers.

        Parameters
        ----------
        column : (n,) array
            Numbers of the column, with the mark read as decimal mark.
        """
        self.n += column.size
        if column.dtype.kind != "f":
            return
        sizes = np.abs(column[(column != np.rint(column)) & np.isfinite(column)])
        if sizes.size:
            self.n_broken += sizes.size
            self.smallest, self.largest = min(self.smallest, sizes.min()), max(self.largest, sizes.max())

    @property
    def may_be_for_thousands(self) -> bool:
        """Whether the sizes of the numbers allow marks for thousands."""
        is_share_whole = self.n - self.n_broken >= MIN_WHOLE_SHARE * self.n
        return bool(self.n_broken and is_share_whole and self.smallest >= 1.0 and self.largest < 1000.0)


def check_thousands(
    column: np.ndarray, i: int, name: str, data: bytes | mmap, offset: int, separator: str, source: Source
) -> None:
    """Check that the marks in a column are decimal marks, and not marks for thousands.

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
    statistics = MarkStatistics()
    statistics.add(column)
    if not statistics.may_be_for_thousands:
        return
    broken = (column != np.rint(column)) & np.isfinite(column)
    rows = data[offset:].splitlines()
    cells = [
        row[i].strip()
        for k in np.flatnonzero(broken)
        if k < len(rows) and len(row := cells_of(decode_line(rows[k]), separator)) > i
    ]
    if all(THOUSANDS.fullmatch(cell) for cell in cells):
        first = int(np.argmax(broken))
        line = data[:offset].count(b"\n") + first + 1
        problem = (
            f"{cells[0]!r} has a mark for thousands, as {statistics.n_broken} of {column.size} numbers of this column"
        )
        remedy = "Export all numbers with one decimal mark and without marks for thousands"
        raise source.error(f"line {line}, column {name or str(i + 1)!r}", problem, remedy)
