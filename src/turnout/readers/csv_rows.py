"""Rows of numbers of a text file: all in memory, or read in blocks when they are sliced, and what stands below them."""

import io
import re
from collections.abc import Sequence
from mmap import mmap
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from turnout.readers.clock_texts import with_dates, with_durations
from turnout.readers.csv_blank_rows import with_empty_lines, without_blank_rows
from turnout.readers.csv_cells import (
    INVALID_VALUE,
    MISSING_VALUES,
    cell_errors,
    cells_of,
    check_thousands,
    decode_line,
    first_cells,
    is_text,
)
from turnout.readers.csv_entries import entries_of_lines
from turnout.readers.csv_row_reader import N_SUMMARY_ROWS, RowReader
from turnout.readers.csv_words import are_words
from turnout.readers.entries import Entry
from turnout.readers.lazy import Column
from turnout.readers.source import Source


def columns_in_memory(
    source: Source, data: bytes, offset: int, separator: str, names: Sequence[str]
) -> tuple[list[Column], tuple[Entry, ...]]:
    """All columns as arrays.

    Parameters
    ----------
    source : Source
        The text file.
    data : bytes
        Bytes of the file.
    offset : int
        Byte of the first number.
    separator : str
        Separator of the cells.
    names : sequence of str
        Names of the columns.

    Returns
    -------
    tuple of (list of Column, tuple of Entry)
        Columns, and entries of the lines of text below the numbers.

    Raises
    ------
    ReadError
        If a cell is no number, a row has another width, or an empty line separates the rows.
    """
    options = _options(data, offset, separator, len(names))
    options["parse_options"] = csv.ParseOptions(delimiter=separator, ignore_empty_lines=False)
    line = line_number(data, offset)
    end = len(data)
    rows: bytes | memoryview = memoryview(data)[offset:]
    with source.parsed_by("pyarrow", f"the numbers after line {line}"), cell_errors(source, line, names):
        try:
            table = _read_table(rows, options)
        except pa.ArrowInvalid:
            end = _start_of_footer(data, offset, len(data), separator)
            rows = with_empty_lines(data[offset:end])
            table = _read_table(rows, options)
    if table.column(0).null_count:
        table = without_blank_rows(table, bytes(rows), line + 1, names, source)
    columns = _columns_of(table, source, data, offset, separator, names)
    _check_summary(columns, line + 1, source)
    return columns, _footer_entries(data, end, len(data), separator, names)


def _read_table(rows: bytes | memoryview, options: dict[str, Any]) -> pa.Table:
    """The cells of rows. A column of marks that are no numbers, empty above the first of them, is one of texts."""
    converting = options["convert_options"]
    while True:
        try:
            return csv.read_csv(io.BytesIO(rows), **options)
        except pa.ArrowInvalid as error:
            match = INVALID_VALUE.search(str(error))
            types = {**converting.column_types, match[1]: pa.string()} if match else converting.column_types
            if match is None or types == converting.column_types:
                raise
            of_column = csv.ConvertOptions(column_types=types, include_columns=[match[1]], null_values=["", " "])
            of_column.strings_can_be_null = True
            column = csv.read_csv(io.BytesIO(rows), **{**options, "convert_options": of_column}).column(0)
            if not are_words(column.to_numpy(zero_copy_only=False)):
                raise
            converting.column_types = types


def _footer_entries(
    data: bytes | mmap, start: int, end: int, separator: str, names: Sequence[str]
) -> tuple[Entry, ...]:
    """Entries of the lines of text below the numbers; statistics of the columns are none."""
    below = [decode_line(text) for text in data[start:end].splitlines()]
    below = ["" if STATISTICS.match(line) else line for line in below]
    return tuple(entries_of_lines(below, separator, names, line_number(data, start) + 1)) if below else ()


def _columns_of(
    table: pa.Table, source: Source, data: bytes | mmap, offset: int, separator: str, names: Sequence[str]
) -> list[Column]:
    """The columns of a table as arrays, whose marks are no marks for thousands."""
    columns: list[Column] = []
    cells = with_dates([column.to_numpy(zero_copy_only=False) for column in table.columns])
    for i, column in enumerate(cells):
        numbers = with_durations(column, "column", names[i] or str(i + 1), source)
        check_thousands(numbers, i, names[i], data, offset, separator, source)
        columns.append(numbers)
    return columns


MAX_FOOTER_LINES = 20
# The first word of a line with a statistic of each column, below the samples.
STATISTICS = re.compile(
    r"\W*(?:(?:abs(?:olute?)?|arithm\w*|std|standard|root)[ .-]*)?"
    r"(?:min(?:im(?:um|a|o|al\w*))?|max(?:im(?:um|a|o|al\w*))?|mean|avg|average|median|rms|std|stdev|sd|var(?:iance)?"
    r"|sum(?:me|m)?|peak|dev(?:iation)?|mittel(?:wert)?|durchschnitt|effektivwert|standardabweichung|moyenne"
    r"|écart[ -]type|middelværdi|gennemsnit|medelvärde|gemiddelde|media|σ|µ|μ|Ø)(?:[ -]?(?:value|wert|val))?"
    r"\W*(?:[;,\t|:=]|$)",
    re.IGNORECASE,
)


def _start_of_footer(data: bytes | mmap, offset: int, end: int, separator: str) -> int:
    """Byte at which lines of words begin that end the text, as "End of data"; ``end``, its own end, without one.

    A line with a number in one of its cells is a row of samples with an error in it, unless it begins with the word
    for a statistic, as "Max;2000;90". Behind the mark of a comment a number may stand, "# 500 samples".
    """
    number = re.compile(rb'"?[-+]?[.,]?\d[\d.,eE+-]*"?')
    for _ in range(MAX_FOOTER_LINES):
        start = max(data.rfind(b"\n", offset, end - 1), offset - 1) + 1
        line = data[start:end].strip()
        if line and not re.match(rb"[#%!]|//|[\W_]*(?!(?i:nan|inf(?:inity)?)\b)[A-Za-z\x80-\xff]", line):
            break
        has_number = any(number.fullmatch(cell.strip()) for cell in line.split(separator.encode())[1:])
        if has_number and not STATISTICS.match(decode_line(line)):
            break
        end = start
        if start <= offset:
            break
    return end


def _check_summary(columns: Sequence[Column], first_line: int, source: Source) -> None:
    """ReadError if a row at one end holds the least, and one the largest number that each column has in other rows.

    No other row does, as that of a periodic signal would. The first row is in line ``first_line``.
    """
    numbers = [np.asarray(column[:]) for column in columns if column.dtype.kind == "f"]
    n_row = len(columns[0]) if columns else 0
    if len(numbers) < 2 or n_row <= 2 * N_SUMMARY_ROWS:
        return
    summaries = []
    for extreme in (np.min, np.max):
        is_extreme = [column == extreme(column) for column in numbers]
        rows = np.flatnonzero(np.logical_and.reduce(is_extreme))
        if len(rows) != 1 or any(np.count_nonzero(column) < 2 for column in is_extreme):
            return
        summaries.append(int(rows[0]))
    if min(summaries) >= n_row - N_SUMMARY_ROWS or max(summaries) < N_SUMMARY_ROWS:
        is_below = min(summaries) >= n_row - N_SUMMARY_ROWS
        line = first_line + (min(summaries) if is_below else max(summaries))
        problem = "rows hold the least and the largest number of each column: they are a summary"
        problem = f"{'from here on' if is_below else 'up to here'} {problem}"
        raise source.error(f"line {line}", problem, "Delete the rows that are no samples", reason="wrong_length")


def lazy_columns(
    source: Source,
    data: bytes | mmap,
    offset: int,
    end: int,
    separator: str,
    names: Sequence[str],
    time: int | None,
) -> tuple[list[Column], tuple[Entry, ...]]:
    """Columns that read their numbers when sliced; a time column is read at once, and a text with blank rows as well.

    Parameters
    ----------
    source : Source
        The text file.
    data : bytes or mmap
        Bytes of the file.
    offset : int
        Byte of the first number.
    end : int
        Byte behind the text.
    separator : str
        Separator of the cells.
    names : sequence of str
        Names of the columns.
    time : int or None
        Number of the time column, from 0; None without one.

    Returns
    -------
    tuple of (list of Column, tuple of Entry)
        Columns, and entries of the lines of text below the numbers.

    Raises
    ------
    ReadError
        If a cell is no number, a row has another width, or an empty line separates the rows.
    """
    options = _options(data, offset, separator, len(names))
    rows = RowReader(source.path, offset, end, options)
    line = line_number(data, offset)
    with source.parsed_by("pyarrow", f"the numbers after line {line}"), cell_errors(source, line, names):
        try:
            times = rows.scan(time)
        except pa.ArrowInvalid:
            end_of_numbers = _start_of_footer(data, offset, end, separator)
            if end_of_numbers == end:
                raise
            rows = RowReader(source.path, offset, end_of_numbers, options)
            times = rows.scan(time)
    if rows.has_blank_rows or any(data.find(mark, offset, rows.end) >= 0 for mark in (b"\n\n", b"\n\r\n")):
        return columns_in_memory(source, data[:end], offset, separator, names)
    columns: list[Column] = [rows.column(i) for i in range(len(names))]
    if rows.n_row > N_SUMMARY_ROWS and rows.may_have_summary:
        _check_summary(columns, line + 1, source)
    for i, statistics in enumerate(rows.marks):
        if statistics.may_be_for_thousands:
            check_thousands(columns[i][:], i, names[i], data, offset, separator, source)
    if time is not None and times is not None:
        columns[time] = times
    return columns, _footer_entries(data, rows.end, end, separator, names)


def line_number(data: bytes | mmap, offset: int) -> int:
    return data[:offset].count(b"\n")


SIZE_OF_FIRST_ROWS = 2**13  # bytes in which a decimal comma is looked for
QUOTED_DECIMAL_COMMA = re.compile(rb'"\s*[+-]?\d*,\d+(?:[eE][+-]?\d+)?\s*"')  # between commas


def _options(data: bytes | mmap, offset: int, separator: str, width: int) -> dict[str, Any]:
    """Options of pyarrow for the numbers from byte ``offset`` on."""
    dot_offset = data.find(b".", offset)
    has_decimal_comma = separator != "," and data.find(b",", offset, dot_offset if dot_offset >= 0 else len(data)) >= 0
    if separator == ",":
        first_rows = data[offset : offset + SIZE_OF_FIRST_ROWS]
        has_decimal_comma = QUOTED_DECIMAL_COMMA.search(first_rows) is not None and b"." not in first_rows
    are_texts = [is_text(cell) for cell in first_cells(data, offset, separator)]
    if any(are_texts):  # dates and times of day have marks of their own
        end = data.find(b"\n", offset + SIZE_OF_FIRST_ROWS)
        rows = decode_line(data[offset : end if end >= 0 else len(data)]).splitlines()
        numbers = [
            cell for row in rows for cell, is_of_text in zip(cells_of(row, separator), are_texts) if not is_of_text
        ]
        has_decimal_comma = separator != "," and any("," in cell for cell in numbers)
    decimal_mark = "," if has_decimal_comma else "."
    converting = csv.ConvertOptions(
        column_types={
            str(i): pa.string() if i < len(are_texts) and are_texts[i] else pa.float64() for i in range(width)
        },
        decimal_point=decimal_mark,
        null_values=list(MISSING_VALUES),
        strings_can_be_null=True,
    )
    reading = csv.ReadOptions(use_threads=False, column_names=[str(i) for i in range(width)], block_size=1 << 24)
    parsing = csv.ParseOptions(delimiter=separator)
    return {"read_options": reading, "parse_options": parsing, "convert_options": converting}
