"""Reader of CSV tables that people edit (events, campaigns, trains ...); it knows line and column of every cell."""

import csv
import os
import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from turnout.config.document import Place
from turnout.config.schema import suggestion
from turnout.errors import reason_of_access, remedy_of_access
from turnout.files import read_regular

EXTRA_CELLS = "cells beyond the header"
BROKEN_LINE = "a line that is no row"
WRONG_SEPARATOR = "a row without commas"
OTHER_SEPARATORS = (("semicolons", ";"), ("tabs", "\t"), ("commas", ","))
EMPTY_ROW = ' \t,;"\xa0'  # characters of a row without content, as spreadsheets write it
SEPARATOR_REMEDY = "Put commas between the columns, and a point before decimals"
SEPARATOR_LINE = re.compile(r'"?sep=([,;\t])"?[\s,;]*', re.IGNORECASE)  # first line of a CSV for spreadsheets


class TableError(Exception):
    """Error of a whole table: place, problem and remedy; ``error`` is the same as ConfigError.

    Parameters
    ----------
    place : Place
        Where the error is.
    problem : str
        What is wrong there.
    remedy : str
        What to write instead.
    reason : str
        Code of the reason: "no_access" for a table that is there and cannot be opened.
    """

    def __init__(self, place: Place, problem: str, remedy: str, reason: str = "unreadable") -> None:
        super().__init__(problem)
        self.place, self.problem, self.remedy, self.reason = place, problem, remedy, reason
        self.error = place.error(problem, remedy)


class Cells(dict):
    """One row of a CSV: text by column. ``text`` is its line, ``titles`` are the titles of the header."""

    text = ""
    titles: tuple[str, ...] = ()
    separator = ","

    def place(self, name: str, line: int, column: str) -> Place:
        """Where the cell of ``column`` starts; the start of the line if it has no such cell.

        Parameters
        ----------
        name : str
            What errors call the file.
        line : int
            Number of the line, from 1.
        column : str
            Title of the column.

        Returns
        -------
        Place
            Where its cell starts; the start of the line if it has no such cell.
        """
        return Place(name, line, self._columns().get(column, 1))

    def _columns(self) -> dict[str, int]:
        """Column of the line at which each cell begins, by its title."""
        return dict(zip((*self.titles, EXTRA_CELLS), _cell_columns(self.text, self.separator)))


@dataclass(frozen=True)
class CsvTable:
    """``rows`` are (line, cells); ``faults`` are errors of the header despite which the rows can be read.

    ``separator`` is the mark between its cells.
    """

    rows: tuple[tuple[int, Cells], ...]
    faults: tuple[TableError, ...]
    separator: str


def read_csv(path: Path, name: str, columns: tuple[str, ...], n_required: int, allow_others: bool = False) -> CsvTable:
    """Read a CSV.

    Commas separate its cells, or the mark that a first line such as ``sep=;`` names. A row is one line: an unclosed
    quote is an error of its own row (``row_problem``), not of the rows below it.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What errors call the file.
    columns : tuple of str
        Titles that the header may have.
    n_required : int
        How many of ``columns``, from the first, the header must have.
    allow_others : bool
        Accept an unknown title unless it resembles a title that is missing.

    Returns
    -------
    CsvTable
        Rows below the header, and errors of the header despite which they can be read.

    Raises
    ------
    TableError
        If the file cannot be read, is not UTF-8 or lacks a required title. A broken link is a file that cannot be read.
    FileNotFoundError
        If the file does not exist.
    """
    lines, separator = _numbered_lines(path, name)
    first, header = lines[0] if lines else (1, "")
    titles = _titles(header, separator)
    for title in columns[:n_required]:
        if title not in titles:
            problem = f"no column {title!r}; the header has {', '.join(titles) or 'nothing'}"
            remedy = f"Write the header {','.join(columns)}, with commas between"
            for marks, mark in OTHER_SEPARATORS:
                if mark != separator and title in map(str.strip, header.split(mark)):
                    problem, remedy = f"{marks} between the columns", _remedy_of_separator(separator)
                    if (mark, separator) == (";", ","):
                        remedy += f", or 'sep={mark}' in a line above the header"
            raise TableError(Place(name, first, 1), problem, remedy)
    faults = [
        TableError(Place(name, first, start), *fault)
        for (k, title), start in zip(enumerate(titles), _cell_columns(header, separator))
        if (fault := _title_problem(title, titles, k, columns, allow_others))
    ]
    return CsvTable(tuple((n, _cells(line, titles, separator)) for n, line in lines[1:]), tuple(faults), separator)


def row_problem(cells: Mapping) -> tuple[str, str, str] | None:
    """Error of a line that is no valid row of its table.

    Parameters
    ----------
    cells : mapping
        Text of the row by column.

    Returns
    -------
    tuple of (str, str, str) or None
        Column, problem and remedy; None for a valid row.

    Examples
    --------
    >>> row_problem(_cells('tamping,"machine 09-3X', ("kind", "note")))[1]
    'a double quote that is not closed in its line'
    """
    if BROKEN_LINE in cells:
        return BROKEN_LINE, cells[BROKEN_LINE], "Write each row in one line; double quotes go around a whole cell"
    if WRONG_SEPARATOR in cells:
        return WRONG_SEPARATOR, cells[WRONG_SEPARATOR], _remedy_of_separator(getattr(cells, "separator", ","))
    if EXTRA_CELLS in cells:
        remedy = "Put a text with commas in double quotes; a number has a decimal point"
        return EXTRA_CELLS, "more cells than columns", remedy
    return None


def _remedy_of_separator(separator: str) -> str:
    """What to do about another mark between the cells than ``separator``."""
    return SEPARATOR_REMEDY if separator == "," else "Write the mark of the first line there, or remove the line 'sep='"


def header_of(path: Path, name: str) -> tuple[tuple[str, ...], str]:
    """Titles of a CSV, and the mark between its cells.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What errors call the file.

    Returns
    -------
    tuple of (tuple of str, str)
        Titles without blanks around them, and the separator.

    Raises
    ------
    TableError
        If the file has no header, is not UTF-8 or cannot be read.
    """
    lines, separator = _numbered_lines(path, name)
    if not lines:
        raise TableError(Place(name, 1, 1), "an empty table", "Write its header, or remove the file")
    return _titles(lines[0][1], separator), separator


def _numbered_lines(path: Path, name: str) -> tuple[list[tuple[int, str]], str]:
    """(number, text) of the lines of a file that are not blank, and its separator.

    TableError if it is not UTF-8 or cannot be read.
    """
    try:
        data = read_regular(path)
    except OSError as error:
        if isinstance(error, (FileNotFoundError, NotADirectoryError)) and not os.path.lexists(path):
            raise
        remedy = remedy_of_access(error, "Put a readable file there")
        raise TableError(Place(name, 1, 1), str(error.strerror), remedy, reason_of_access(error)) from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        raise TableError(Place(name, line, column), "a byte that is not UTF-8", "Save the file as UTF-8") from None
    text = unicodedata.normalize("NFC", text)  # names of sections are compared with those of the layout
    stated = SEPARATOR_LINE.fullmatch(text.splitlines()[0]) if text.strip() else None
    return rows_of(text), stated[1] if stated else ","


def rows_of(text: str) -> list[tuple[int, str]]:
    r"""The lines of a table that hold a header or a row: without empty rows, comments (#), and a first line ``sep=``.

    Parameters
    ----------
    text : str
        The table. Its lines end with LF, CR LF or CR; other separators of lines are characters of a cell.

    Returns
    -------
    list of (int, str)
        Number of the line, from 1, and its text.

    Examples
    --------
    >>> rows_of('# of 2025\nturnout,date\n,\n"",""\r\nt1,2025-01-01\n')
    [(2, 'turnout,date'), (5, 't1,2025-01-01')]
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [
        (n, line)
        for n, line in enumerate(lines, 1)
        if line.strip(EMPTY_ROW)
        and not line.lstrip().startswith("#")
        and not (n == 1 and SEPARATOR_LINE.fullmatch(line))
    ]


def _titles(header: str, separator: str) -> tuple[str, ...]:
    """Stripped titles; empty columns on the right, as spreadsheets write them, are ignored."""
    try:
        titles = [title.strip() for title in next(csv.reader([header], strict=True, delimiter=separator), [])]
    except csv.Error:
        titles = [title.strip() for title in header.split(separator)]
    while titles and not titles[-1]:
        titles.pop()
    return tuple(titles)


def _title_problem(
    title: str, titles: tuple[str, ...], k: int, columns: tuple[str, ...], allow_others: bool
) -> tuple[str, str] | None:
    """(problem, remedy) of the ``k``-th title if it cannot be used, else None."""
    if title in titles[:k]:
        return f"column {title!r} for the second time", "Keep one of them"
    if title in columns:
        return None
    missing = [t for t in columns if t not in titles]
    if allow_others and not get_close_matches(title, missing, cutoff=0.7):
        return None
    return f"unknown column {title!r}", suggestion(title, columns)


def _cells(line: str, titles: tuple[str, ...], separator: str = ",") -> Cells:
    cells = Cells(dict.fromkeys(titles, ""))
    cells.text, cells.titles, cells.separator = line, titles, separator
    try:
        values = [cell.strip() for cell in next(csv.reader([line], strict=True, delimiter=separator))]
    except csv.Error as error:
        open_quote = "unexpected end" in str(error)
        cells[BROKEN_LINE] = "a double quote that is not closed in its line" if open_quote else str(error)
        return cells
    for marks, mark in OTHER_SEPARATORS:
        if len(values) == 1 < len(titles) and mark in line:
            cells[WRONG_SEPARATOR] = f"{marks} between the columns"
            return cells
    while len(values) > len(titles) and not values[-1]:
        values.pop()
    cells.update(zip(titles, values))
    if len(values) > len(titles):
        cells[EXTRA_CELLS] = separator.join(values[len(titles) :])
    return cells


def _cell_columns(line: str, separator: str = ",") -> Iterator[int]:
    """Columns, counted from 1, at which the cells of a line of CSV begin.

    >>> list(_cell_columns('a,"b,c",d'))
    [1, 3, 9]
    """
    quoted = False
    yield 1
    for column, letter in enumerate(line, 1):
        quoted ^= letter == '"'
        if letter == separator and not quoted:
            yield column + 1
