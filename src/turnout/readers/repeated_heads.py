"""Text files whose head comes again below their rows: several tables in one file, each of which is a record."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from mmap import mmap

import numpy as np

from turnout.errors import ReadError
from turnout.readers.csv_cells import cells_of, decode_line, is_row
from turnout.readers.csv_rows import STATISTICS
from turnout.readers.source import RawRecord, Source
from turnout.readers.split_starts import with_stated_starts

NOT_BLANK = re.compile(rb"[^\s]")
LETTER = re.compile(rb"[A-Za-z\x80-\xff]")
DELETE_REMEDY = "Delete the lines between the rows"
NUMBER_REMEDY = "Export each record to a file, with a time column, or number the records in a column 'record'"


def tables_of(data: bytes | mmap, offset: int, separator: str) -> list[bytes]:
    """The tables of a text in which the last line of the head comes again, each as a text of its own.

    The lines of the head that do not come again are about the whole file: they precede each table. Empty lines stand
    for what is left out, so that a line keeps its number.

    Parameters
    ----------
    data : bytes or mmap
        The text.
    offset : int
        Byte of its first number.
    separator : str
        Separator of the cells.

    Returns
    -------
    list of bytes
        Empty if the head does not come again.

    Examples
    --------
    >>> tables_of(b"fs: 100\\na;b\\n1;2\\n3;4\\nTest 2\\na;b\\n5;6\\n", 12, ";")
    [b'fs: 100\\na;b\\n1;2\\n3;4\\n', b'fs: 100\\n\\n\\n\\nTest 2\\na;b\\n5;6\\n']
    """
    head = data[:offset]
    last_line = next((line for line in reversed(head.splitlines(keepends=True)) if line.strip()), b"")
    if not LETTER.search(last_line):
        return []
    starts, second_head = [0], b""
    position = data.find(b"\n" + last_line, offset - 1)
    while position >= 0:
        end = position + 1 + len(last_line)
        if _is_row_next(data, end, separator):
            start = _start_of_head(data, position + 1, offset, separator)
            second_head = second_head or data[start:end]
            starts.append(start)
        position = data.find(b"\n" + last_line, end - 1)
    if len(starts) == 1:
        return []
    of_file = _lines_of_file(head, second_head)
    further_tables = [
        of_file + b"\n" * data[len(of_file) : a].count(b"\n") + _without_statistics(data[a:b])
        for a, b in pairwise([*starts[1:], len(data)])
    ]
    return [data[: starts[1]], *further_tables]


def _is_row_next(data: bytes | mmap, position: int, separator: str) -> bool:
    """Whether the first line with content from byte ``position`` on is a row of numbers."""
    content = NOT_BLANK.search(data, position)
    if not content:
        return False
    end = data.find(b"\n", content.start())
    line = data[content.start() : end if end >= 0 else len(data)]
    return is_row(cells_of(decode_line(line), separator))


def _without_statistics(table: bytes) -> bytes:
    """A table without the statistics of the table above it, "Max;2000;90", which begin it."""
    n, position = 0, 0
    while position < len(table):
        end = table.find(b"\n", position) + 1 or len(table)
        line = table[position:end]
        if line.strip() and not STATISTICS.match(decode_line(line)):
            break
        n, position = n + 1, end
    return b"\n" * n + table[position:]


def _lines_of_file(head: bytes, second_head: bytes) -> bytes:
    """The first lines of a head, above the last ones that come again: ``second_head`` is that of the second table."""
    lines, repeated = head.splitlines(keepends=True), {_key_of_line(line) for line in second_head.splitlines()}
    n = next((i for i in range(len(lines), 0, -1) if _key_of_line(lines[i - 1]) not in repeated | {b""}), 0)
    return b"".join(lines[:n])


def _key_of_line(line: bytes) -> bytes:
    """What a line has in common with that of another record, "Test" of "Test 2" and "Start" of "Start: 10:00"."""
    return re.sub(rb"[\d\s#%]+", b"", re.split(rb"[:=;,\t]", line, maxsplit=1)[0])


def _start_of_head(data: bytes | mmap, end: int, first: int, separator: str) -> int:
    """Byte behind the last row of numbers before byte ``end``, not before ``first``."""
    while end > first:
        start = max(data.rfind(b"\n", first, end - 1) + 1, first)
        if is_row(cells_of(decode_line(data[start:end]), separator)):
            break
        end = start
    return end


def check_separate(records: Sequence[RawRecord | ReadError], source: Source) -> None:
    """Check that the tables of a text are records of their own, and not parts of one.

    Parameters
    ----------
    records : sequence of RawRecord or ReadError
        The records of the tables.
    source : Source
        The text file.

    Raises
    ------
    ReadError
        If the time goes on from one table to the next, or if neither a time column nor a start tells it.
    """
    for k, (problem, remedy) in enumerate(_connections(with_stated_starts(records))):
        if problem:
            where = f"table {k + 2} of {len(records)}"
            raise source.error(where, f"its head comes again between the rows, {problem}", remedy)


def _connections(records: Sequence[RawRecord | ReadError]) -> Iterator[tuple[str, str]]:
    """Problem and remedy of each table but the first, "" for a new record."""
    for before, record in pairwise(records):
        if isinstance(before, ReadError) or isinstance(record, ReadError):
            yield "", ""
        elif before.time is not None and record.time is not None and len(before.time) > 1:
            step = np.diff(before.time).max()  # of a coarse clock, which may also repeat the last time
            goes_on = abs(record.time[0] - before.time[-1]) < 1.5 * step and record.time[0] > before.time[0]
            yield ("and the time goes on: it is one record", DELETE_REMEDY) if goes_on else ("", "")
        else:
            is_later = before.started_at and record.started_at and before.started_at != record.started_at
            yield ("", "") if is_later else ("and nothing says whether another record begins", NUMBER_REMEDY)
