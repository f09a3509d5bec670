"""Rows without numbers in a text file: empty lines, and rows of separators alone, as spreadsheets write them."""

import re
from collections.abc import Sequence
from mmap import mmap

import numpy as np
import pyarrow as pa

from turnout.errors import ReadError
from turnout.readers.record_columns import may_number_records
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_counts import stated_counts

SEPARATORS_AND_BLANKS = b';,\t| "\r'
BLANK_ROW = re.compile(rb'^[;,\t| "\r]+$', re.MULTILINE)
REMEDY = "Delete them if they are no samples; export each record to a file, or number them in a column 'record'"


EMPTY_LINE = re.compile(rb"[;,\t| \"\r]*")
MIN_LOST_ROWS = 32  # rows of separators below the samples: fewer lost samples are under 2 ms of a decay at usual rates


def end_without_blank_rows(data: bytes | mmap, end: int) -> int:
    """Byte behind the last line with content: spreadsheets write rows of separators alone below the table.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the text.
    end : int
        Byte behind the text.

    Returns
    -------
    int
        ``end`` if its last line has content.
    """
    while (start := data.rfind(b"\n", 0, max(end - 1, 0)) + 1) and EMPTY_LINE.fullmatch(data[start:end].rstrip(b"\n")):
        end = start
    return end


def blank_end_remarks(rows: bytes, records: Sequence[RawRecord | ReadError], source: Source) -> tuple[ReadError, ...]:
    """Remark on rows of separators below the samples: a logger may have written them in place of its last samples.

    Parameters
    ----------
    rows : bytes
        The rows without content behind the last one with content.
    records : sequence of RawRecord or ReadError
        Records of the file.
    source : Source
        The text file.

    Returns
    -------
    tuple of ReadError
        Empty for few rows, for empty lines, and if the file states as many samples as it has.
    """
    n_row = sum(1 for line in rows.splitlines() if line.strip(b" \r\n"))
    read = [record for record in records if isinstance(record, RawRecord) and record.samples]
    n_samples = {len(record.samples[0]) for record in read}
    if n_row < MIN_LOST_ROWS or any(stated_counts(record) & {*n_samples, sum(n_samples)} for record in read):
        return ()
    problem = f"{n_row} rows of separators stand below its last sample: they may be in place of lost samples"
    return (source.error("the end", problem, BLANK_END_REMEDY, reason="entry_unknown"),)


BLANK_END_REMEDY = "Compare the number of samples with the logger's own program; delete these rows if none is missing"


def with_empty_lines(rows: bytes) -> bytes:
    """Rows with an empty line in place of each line of separators, blanks and quotation marks alone.

    Parameters
    ----------
    rows : bytes
        Rows of numbers.

    Returns
    -------
    bytes
        As many lines.

    Examples
    --------
    >>> with_empty_lines(b"1;2\\n ; \\n3;4\\n")
    b'1;2\\n\\n3;4\\n'
    """
    return BLANK_ROW.sub(b"", rows)


def without_blank_rows(table: pa.Table, rows: bytes, first_line: int, names: Sequence[str], source: Source) -> pa.Table:
    """A table without its blank rows: those below the numbers, those between two records, and one behind each row.

    A blank row within a record whose rows are numbered stays, as a missing sample of that record.

    Parameters
    ----------
    table : pa.Table
        Cells of all lines, null where a cell is empty or says that a number is missing.
    rows : bytes
        The lines, one per row of the table.
    first_line : int
        Number of the first of them in the file, from 1.
    names : sequence of str
        Names of the columns.
    source : Source
        The text file.

    Returns
    -------
    pa.Table

    Raises
    ------
    ReadError
        If any other blank row has numbers below it: they may be a summary or another record, or samples are missing.
    """
    is_null = np.logical_and.reduce([column.is_null().to_numpy() for column in table.columns])
    if not is_null.any():
        return table
    lines = rows.splitlines()
    is_blank = np.array([null and not lines[k].strip(SEPARATORS_AND_BLANKS) for k, null in enumerate(is_null)])
    filled = np.flatnonzero(~is_blank)
    blank = np.setdiff1d(np.arange(filled[0], filled[-1]), filled) if len(filled) else filled
    if len(blank) and len(set(np.diff(filled))) > 1:
        i = next((i for i, name in enumerate(names) if may_number_records(name)), None)
        if i is None or not pa.types.is_floating(table.schema.types[i]):
            k = blank[0]
            noun, meaning = "an empty line", "they may be a summary or another record"
            if lines[k]:
                noun, meaning = "a row without numbers", f"its samples are missing, or {meaning}"
            n_row = np.count_nonzero(filled > k)
            problem = f"{noun} stands before its last {n_row} rows: {meaning}"
            raise source.error(f"line {first_line + k}", problem, REMEDY, reason="wrong_length")
        numbers = table.column(i).to_numpy()
        before, after = filled[np.searchsorted(filled, blank) - 1], filled[np.searchsorted(filled, blank)]
        is_within = numbers[before] == numbers[after]
        is_blank[blank[is_within]] = False
        numbers = numbers.copy()
        numbers[blank] = numbers[before]
        table = table.set_column(i, table.schema.field(i), pa.array(numbers))
    return table.filter(pa.array(~is_blank))
