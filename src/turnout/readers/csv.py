"""Reader of text files with separated columns: a head of ``name: value`` lines, a line of names, then numbers.

What is recognised:

* separators: comma, semicolon, tab, ``|`` or blanks; a decimal comma where the separator is not a comma;
* head lines with or without ``#``: ``rate`` or ``dt`` and what ``rate_words`` recognises, ``started_at``,
  ``n_records``, ``n_samples``, conditions, and the words of other languages listed in ``named_arrays``;
* units in brackets after the names ("force [N]", "force (N)") or in a line of their own;
* a column of time in numbers or as the time of day, "13.05.2026 10:00:00.00005"; a column ``record`` that numbers the
  records.

Without names channels are called "0", "1" ... All lines of the head are entries in which ``turnout.readers.statements``
finds the sampling rate.

The text is UTF-8, UTF-16, or UTF-32 with a byte order mark. Head lines that are neither are read as Windows-1252.
A last line without line break may end in a truncated number: it is left out and reported, unless its last number has as
many decimals as all others.
"""

import codecs
import io
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from mmap import mmap
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from turnout.errors import ReadError
from turnout.readers.array_metadata import (
    RECORD_COUNT_NAMES,
    SAMPLE_COUNT_NAMES,
    START_DATE_NAMES,
    START_NAMES,
    Metadata,
)
from turnout.readers.clock_texts import is_clock_or_date, with_durations
from turnout.readers.csv_cells import MISSING_VALUES, cell_errors, check_thousands
from turnout.readers.csv_header import (
    BLANK,
    cells_of,
    decode_line,
    entries_of_lines,
    first_cells,
    read_head,
    seconds_per_number,
    time_column,
)
from turnout.readers.entries import Entry
from turnout.readers.lazy import Column, LazyColumn
from turnout.readers.lost_entries import control_character_errors
from turnout.readers.source import BLOCK_SIZE, COPY_AGAIN, RawFile, RawRecord, Source
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import entry_statements, scale_problem, scale_statements, without_drawings


def read_raw(source: Source) -> RawFile:
    """Records of a text file.

    Parameters
    ----------
    source : Source
        The text file.

    Returns
    -------
    RawFile
        One record, or one per number in the column ``record``.

    Raises
    ------
    ReadError
        If the head, the columns or a number cannot be read, or the last line is incomplete.
    """
    encoding = wide_encoding(source.head)
    lazy = source.lazy and not encoding
    data = source.memory_map if lazy else _in_utf8(source, encoding) if encoding else source.data
    if isinstance(data, bytes):
        data = data.removesuffix(END_OF_FILE)
    if isinstance(data, bytes) and b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    data, remarks = _without_cut_row(data, source)
    head, names, units, offset, separator, entries = read_head(data, source)
    if separator == BLANK:
        data = data[:offset] + _with_single_blanks(data[offset:])
    is_in_memory = separator == BLANK or "record" in [name.strip().lower() for name in names]
    is_in_memory = is_in_memory or any(map(is_clock_or_date, first_cells(data, offset, separator)))
    read_columns = _lazy_columns if lazy and not is_in_memory else _columns_in_memory
    time = time_column(names, units)
    columns, footer = read_columns(source, data, offset, separator, names, time)
    entries = (*entries, *footer)
    remarks += control_character_errors(data[:offset], source)
    facts = Metadata(head, source)
    records = tuple(_records(columns, names, units, time, facts, source, entries))
    return RawFile(records, facts.count(RECORD_COUNT_NAMES), remarks)


def _with_single_blanks(rows: bytes) -> bytes:
    """Rows with one blank between two words and none at either end."""
    rows = re.sub(rb" +", b" ", rows).replace(b"\n ", b"\n")
    return rows.replace(b" \n", b"\n").replace(b" \r\n", b"\r\n").strip(b" ")


N_COMPARED_ROWS = 20  # rows whose last numbers are compared with one that may be cut


def _without_cut_row(data: bytes | mmap, source: Source) -> tuple[bytes | mmap, tuple[ReadError, ...]]:
    """The text without its last row if that may be cut, and the remark on it.

    A row without line break is complete if it has as many separators as the rows above and its last number as many
    decimals as all of theirs. Only text in memory can be shortened: a lazy file is rejected.

    Raises
    ------
    ReadError
        If the file is read lazily and its last row may be cut.
    """
    if data[-1:] in (b"\n", b"\r"):
        return data, ()
    start = max(data.rfind(b"\n"), data.rfind(b"\r")) + 1
    rows = data[max(0, start - N_COMPARED_ROWS * (len(data) - start + 80)) : start].splitlines()[-N_COMPARED_ROWS:]
    last = data[start:]
    if len(rows) == N_COMPARED_ROWS and all(_shape(row) == _shape(last) for row in rows) and _shape(last)[1]:
        return data, ()
    line = data[:].count(b"\n") + 1
    problem = "the last line has no line break: its last number may be cut"
    remedy = f"{COPY_AGAIN}, or add the line break if it is whole"
    if isinstance(data, mmap) or start == 0:
        raise source.error(f"line {line}", problem, remedy, reason="truncated")
    left_out = source.error(f"line {line}", f"{problem}. It is left out", remedy, reason="truncated")
    return data[:start], (left_out,)


def _shape(row: bytes) -> tuple[int, int]:
    """Number of separators, and of digits behind the last decimal mark, of a row of numbers."""
    separator = next((s for s in (rb"[;\t|]", rb",", rb" +") if re.search(s, row.strip())), rb",")
    cells = re.split(separator, row.strip())
    decimals = re.fullmatch(rb' *"?[+-]?\d*[.,](\d+)(?:[eE][+-]?\d+)?"? *', cells[-1])
    return len(cells), len(decimals[1]) if decimals else 0


END_OF_FILE = b"\x1a"  # the mark with which programs of DOS end a text
MIN_UTF16_SIZE = 16  # bytes: fewer do not tell the encoding


def wide_encoding(head: bytes) -> str:
    """Encoding of a text in UTF-16 or UTF-32, by its byte order mark or by the zero bytes of its letters in UTF-16.

    Parameters
    ----------
    head : bytes
        First bytes of the file.

    Returns
    -------
    str
        "" for another text.

    Examples
    --------
    >>> wide_encoding("force;rail".encode("utf-16-le")), wide_encoding(b"force;rail [m/s2]")
    ('utf-16-le', '')
    """
    if head[:4] in (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE):
        return "utf-32"
    if head[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    even, odd = head[0::2], head[1::2]
    if len(head) < MIN_UTF16_SIZE or max(even.count(0), odd.count(0)) < MIN_ZERO_SHARE * len(odd):
        return ""
    return "utf-16-le" if not even.count(0) else "utf-16-be" if not odd.count(0) else ""


MIN_ZERO_SHARE = 0.9  # of the high bytes of a text of numbers with some other letters


def _in_utf8(source: Source, encoding: str) -> bytes:
    """A file that a spreadsheet saved as "Unicode" (UTF-16), or in UTF-32, converted to UTF-8."""
    with source.parsed_by("Python", f"the text in {encoding[:6].upper()}"):
        return source.data.decode(encoding).encode()


def _columns_in_memory(
    source: Source, data: bytes | mmap, offset: int, separator: str, names: Sequence[str], time: int | None
) -> tuple[list[Column], tuple[Entry, ...]]:
    """(all columns as arrays, entries of the lines of text below the numbers)."""
    context = source, data, offset, separator, names
    options = _options(data, offset, separator, len(names))
    line = _line_number(data, offset)
    end = len(data)
    strict = options | {"parse_options": csv.ParseOptions(delimiter=separator, ignore_empty_lines=False)}
    with source.parsed_by("pyarrow", f"the numbers after line {line}"), cell_errors(source, line, names):
        try:
            table = csv.read_csv(io.BytesIO(memoryview(data)[offset:]), **strict)
            if not table.column(0).null_count:  # an empty line is a row without values
                return _columns_of(table, *context), ()
        except pa.ArrowInvalid:
            pass
        try:
            table = csv.read_csv(io.BytesIO(memoryview(data)[offset:]), **options)
        except pa.ArrowInvalid:
            end = _start_of_footer(data, offset, separator)
            if end == len(data):
                raise
            table = csv.read_csv(io.BytesIO(memoryview(data)[offset:end]), **options)
    _check_one_block(data, offset, end, source)
    below = [decode_line(text) for text in data[end:].splitlines()]
    return _columns_of(table, *context), tuple(entries_of_lines(below, separator, names, _line_number(data, end) + 1))


def _columns_of(
    table: pa.Table, source: Source, data: bytes | mmap, offset: int, separator: str, names: Sequence[str]
) -> list[Column]:
    """The columns of a table as arrays, whose marks are no marks for thousands."""
    columns: list[Column] = []
    for i, column in enumerate(table.columns):
        numbers = with_durations(column.to_numpy(zero_copy_only=False), f"column {names[i] or i + 1!r}", source)
        check_thousands(numbers, i, names[i], data, offset, separator, source)
        columns.append(numbers)
    return columns


MAX_FOOTER_LINES = 20


def _start_of_footer(data: bytes | mmap, offset: int, separator: str) -> int:
    """Byte at which lines of words begin that end the file, as "End of data"; its length without one.

    A line with a number in one of its cells is a row of samples with an error in it, never a footer.
    """
    end = len(data)
    number = re.compile(rb'"?[-+]?[.,]?\d[\d.,eE+-]*"?')
    for _ in range(MAX_FOOTER_LINES):
        start = max(data.rfind(b"\n", offset, end - 1), offset - 1) + 1
        line = data[start:end].strip()
        if line and not re.match(rb'["#]*[A-Za-z\x80-\xff](?!an\b|nf)', line):
            break
        if any(number.fullmatch(cell.strip()) for cell in line.split(separator.encode())[1:]):
            break
        end = start
        if start <= offset:
            break
    return end


def _check_one_block(data: bytes | mmap, offset: int, end: int, source: Source) -> None:
    """ReadError if an empty line separates rows from further ones: a summary of the columns, or another record.

    The parser skips empty lines. They separate nothing where one follows each row.
    """
    empty = [i for mark in (b"\n\n", b"\n\r\n") if 0 <= (i := data.find(mark, offset, end))]
    if not empty or not data[min(empty) : end].strip():
        return
    first = min(empty)
    n_row = sum(1 for line in data[first:end].splitlines() if line.strip())
    if b"\n" not in data[offset:first].strip(b"\r\n") and 2 * n_row <= data[first:end].count(b"\n") + 1:
        return
    problem = f"an empty line stands before its last {n_row} rows: they may be a summary or another record"
    remedy = "Delete them if they are no samples; export each record to a file, or number them in a column 'record'"
    raise source.error(f"line {_line_number(data, first) + 2}", problem, remedy, reason="wrong_length")


def _lazy_columns(
    source: Source, data: bytes | mmap, offset: int, separator: str, names: Sequence[str], time: int | None
) -> tuple[list[Column], tuple[Entry, ...]]:
    """(columns that read their numbers when sliced, no entries); a time column is read at once."""
    options = _options(data, offset, separator, len(names))
    rows = RowReader(source.path, offset, options)
    line = _line_number(data, offset)
    with source.parsed_by("pyarrow", f"the numbers after line {line}"), cell_errors(source, line, names):
        times = rows.scan(time)
    _check_one_block(data, offset, len(data), source)
    columns: list[Column] = [rows.column(i) for i in range(len(names))]
    if time is not None and times is not None:
        columns[time] = times
    return columns, ()


def _line_number(data: bytes | mmap, offset: int) -> int:
    return data[:offset].count(b"\n")


class RowReader:
    """Reads the rows of a text file in order; a request for earlier rows starts again at the beginning.

    Parameters
    ----------
    path : Path
        The text file.
    offset : int
        Byte at which the numbers begin.
    options : dict of str to any
        Options of ``pyarrow.csv.open_csv``.
    """

    def __init__(self, path: Path, offset: int, options: dict[str, Any]):
        self.path, self.offset, self.options = path, offset, options
        self.n_row, self.begin = 0, 0
        self.batches: list[pa.RecordBatch] = []
        self.reader: csv.CSVStreamingReader | None = None

    def scan(self, time: int | None) -> np.ndarray | None:
        """Count the rows and read the time column.

        Parameters
        ----------
        time : int or None
            Number of the time column, from 0; None: there is none.

        Returns
        -------
        (n_row,) array or None
            The time as it is written; None without a time column.
        """
        values = []
        for batch in self._open():
            self.n_row += batch.num_rows
            if time is not None:
                values.append(batch.column(time).to_numpy(zero_copy_only=False))
        return None if time is None else np.concatenate(values)

    def column(self, i: int) -> LazyColumn:
        """Column number ``i``.

        Parameters
        ----------
        i : int
            Number of the column, from 0.

        Returns
        -------
        LazyColumn
            Its numbers, read when it is sliced.
        """
        return LazyColumn(lambda start, stop: self._read_rows(i, start, stop), self.n_row, np.dtype(float))

    def _open(self) -> csv.CSVStreamingReader:
        file = self.path.open("rb")
        file.seek(self.offset)
        return csv.open_csv(file, **self.options)

    def _read_rows(self, i: int, start: int, stop: int) -> np.ndarray:
        if self.reader is None or start < self.begin:
            self.reader, self.begin, self.batches = self._open(), 0, []
        end = self.begin + sum(batch.num_rows for batch in self.batches)
        while end < stop:
            self.batches.append(self.reader.read_next_batch())
            end += self.batches[-1].num_rows
            while self.begin + self.batches[0].num_rows <= start:
                self.begin += self.batches.pop(0).num_rows
        table = pa.Table.from_batches(self.batches).slice(start - self.begin, stop - start)
        return table.column(i).to_numpy()


SIZE_OF_FIRST_ROWS = 2**13  # bytes in which a decimal comma is looked for


def _options(data: bytes | mmap, offset: int, separator: str, width: int) -> dict[str, Any]:
    """Options of pyarrow for the numbers from byte ``offset`` on."""
    dot_offset = data.find(b".", offset)
    has_decimal_comma = separator != "," and data.find(b",", offset, dot_offset if dot_offset >= 0 else len(data)) >= 0
    if separator == ",":
        has_decimal_comma = re.match(rb'\s*"[+-]?\d*,\d+"', data[offset : offset + 200]) is not None
    is_text = [is_clock_or_date(cell) for cell in first_cells(data, offset, separator)]
    if any(is_text):  # dates and times of day have marks of their own
        end = data.find(b"\n", offset + SIZE_OF_FIRST_ROWS)
        rows = decode_line(data[offset : end if end >= 0 else len(data)]).splitlines()
        numbers = [
            cell for row in rows for cell, is_of_text in zip(cells_of(row, separator), is_text) if not is_of_text
        ]
        has_decimal_comma = separator != "," and any("," in cell for cell in numbers)
    decimal_mark = "," if has_decimal_comma else "."
    converting = csv.ConvertOptions(
        column_types={str(i): pa.string() if i < len(is_text) and is_text[i] else pa.float64() for i in range(width)},
        decimal_point=decimal_mark,
        null_values=list(MISSING_VALUES),
        strings_can_be_null=True,
    )
    reading = csv.ReadOptions(use_threads=False, column_names=[str(i) for i in range(width)], block_size=1 << 24)
    parsing = csv.ParseOptions(delimiter=separator)
    return {"read_options": reading, "parse_options": parsing, "convert_options": converting}


def _records(
    columns: list[Column],
    names: Sequence[str],
    units: Sequence[str],
    time: int | None,
    facts: Metadata,
    source: Source,
    entries: tuple[Entry, ...],
) -> Iterator[RawRecord | ReadError]:
    """The records: one of all rows, or one per number in the column ``record``."""
    lower = [name.strip().lower() for name in names]
    number = columns[lower.index("record")] if "record" in lower else None
    time = time if time is not None and columns[time].dtype.kind in "fiu" else None
    clocks = {
        i: np.asarray(column[:]).astype(float) * 1e-9 for i, column in enumerate(columns) if column.dtype.kind == "m"
    }
    selected = [i for i, name in enumerate(lower) if name != "record" and i != time and columns[i].dtype.kind in "fiu"]
    selected = [i for i in selected if names[i] or len(selected) == 1 or not _is_empty(columns[i])]
    seconds = None if time is None else np.asarray(columns[time]) * seconds_per_number(units[time], source)
    n_row = len(columns[0])
    edges = [0, n_row]
    if number is not None:
        if not np.isfinite(number).all():
            raise source.error("column 'record'", "it does not number every row", COPY_AGAIN)
        edges = [0, *(np.flatnonzero(np.diff(number)) + 1), n_row]
    n = len(edges) - 1
    promised, rows = facts.count(("n_samples",)), facts.number(SAMPLE_COUNT_NAMES)
    if promised is None and rows is not None and rows > n_row:
        promised = int(rows)
    of_notes = enumerate(map(scale_problem, scale_statements(without_drawings(facts.variables), len(selected))))
    undecided = entry_statements(entries, [names[i] for i in selected]) | {i: text for i, text in of_notes if text}
    for k, (a, b) in enumerate(pairwise(edges)):
        if promised is not None and b - a != promised:
            problem = f"has {b - a} of the {promised} samples that its head promises"
            yield source.error(f"record {k + 1} of {n}", problem, COPY_AGAIN, reason="truncated")
            continue
        date, start = (
            facts.record_value(START_DATE_NAMES, k, n),
            facts.record_value((f"started_at_{k}", *START_NAMES), k, n),
        )
        yield RawRecord(
            names=tuple(names[i] for i in selected),
            samples=[columns[i] if isinstance(columns[i], LazyColumn) else columns[i][a:b] for i in selected],
            units=tuple(units[i] for i in selected),
            **start_fields(date if start is None else start, f"{date} {start}" if date and start else None),
            conditions=facts.conditions(k, n),
            time=None if seconds is None else seconds[a:b],
            undecided=undecided,
            is_time_in_seconds=time is not None and bool(units[time].strip()),
            clocks=tuple((f"column {names[i] or i + 1!r}", seconds[a:b]) for i, seconds in clocks.items()),
            entries=entries,
        )


def _is_empty(column: Column) -> bool:
    return all(np.isnan(column[a : a + BLOCK_SIZE]).all() for a in range(0, len(column), BLOCK_SIZE))
