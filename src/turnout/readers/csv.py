"""Reader of text files with separated columns: a head of ``name: value`` lines, a line of names, then numbers.

What is recognised:

* separators: comma, semicolon, tab, ``|`` or blanks, also with tabs among them; a decimal comma where the separator
  is not a comma;
* head lines with or without ``#``: ``rate`` or ``dt`` and what ``rate_vocabulary`` recognises, ``started_at``,
  ``n_records``, ``n_samples``, conditions, and the words of other languages listed in ``named_arrays``;
* units in brackets after the names ("force [N]", "force (N)"), behind a slash, a comma or "in" where most names have
  one ("F/N", "Force, N", "Kraft in N"), or in a line of their own;
* a column of time in numbers or as the time of day, "13.05.2026 10:00:00.00005"; a column ``record`` that numbers the
  records;
* the start, where the head states none, in the first row: a date with a time of day, or a time column since 1970.

Without names channels are called "0", "1" ... All lines of the head are entries in which
``turnout.readers.rate_statements`` finds the sampling rate.

The text is UTF-8, UTF-16, or UTF-32 with a byte order mark. Head lines that are neither are read as Windows-1252;
the layout may name a channel as it reads in another 8-bit encoding, such as that of Russian or Chinese.
A last line without line break may end in a truncated number: it is left out and reported, unless its last number has as
many decimals as all others.
"""

import codecs
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from mmap import mmap

import numpy as np

from turnout.errors import ReadError
from turnout.readers.array_metadata import Metadata
from turnout.readers.csv_blank_rows import blank_end_remarks, end_without_blank_rows
from turnout.readers.csv_cells import (
    BLANK,
    BREAK_IN_CELL,
    SEPARATORS,
    cells_of,
    first_cells,
    is_row,
    is_text,
    with_whole_cells,
)
from turnout.readers.csv_columns import seconds_per_number, time_column
from turnout.readers.csv_header import Head, read_head
from turnout.readers.csv_outer_rows import outer_row_remarks
from turnout.readers.csv_rows import columns_in_memory, lazy_columns
from turnout.readers.csv_words import holds_words
from turnout.readers.entries import Entry
from turnout.readers.label_lines import has_labels, with_joined_labels
from turnout.readers.lazy import Column, LazyColumn
from turnout.readers.lost_entries import control_character_errors
from turnout.readers.metadata_names import RECORD_COUNT_NAMES, SAMPLE_COUNT_NAMES, START_NAMES
from turnout.readers.number_notations import has_other_notation, with_plain_numbers
from turnout.readers.record_columns import (
    may_number_records,
    missing_record,
    numbers_of_texts,
    record_column,
    spans_of_records,
)
from turnout.readers.repeated_heads import check_separate, tables_of
from turnout.readers.source import BLOCK_SIZE, COPY_AGAIN, HEAD_SIZE, RawFile, RawRecord, Source
from turnout.readers.start_columns import start_or_clock_in_cells
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import entry_statements
from turnout.readers.stated_units import decoded_units
from turnout.readers.texts import decode_text, other_readings, wide_encoding
from turnout.readers.thousands_marks import ambiguous_marks
from turnout.readers.word_columns import check_valid, entries_of_words, rarest_words


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
    end, remarks = _end_of_content(data, source)
    if data.find(b"\n") < 0:
        data, lazy = data[:end].replace(b"\r", b"\n"), False
    first = source.head
    if not lazy or has_other_notation(first) or BREAK_IN_CELL.search(first) or has_labels(first):
        lazy, data = False, with_joined_labels(with_whole_cells(with_plain_numbers(data[:end])))
        end = len(data)
    end_of_text = end_without_blank_rows(data, end)
    blank_rows = data[end_of_text:end]
    end, further_remarks = _end_of_rows(data, end_of_text, source)
    remarks += further_remarks
    if isinstance(data, bytes):
        data = data[:end]
    head = read_head(data, source)
    if tables := tables_of(data, head.offset, head.separator):
        raw_files = [_read_damaged_table(table, len(tables), source) for table in tables]
        records = tuple(record for raw in raw_files for record in raw.records)
        check_separate(records, source)
        remarks += tuple(remark for raw in raw_files for remark in raw.remarks)
        return RawFile(records, raw_files[0].expected, remarks)
    raw = _read_table(data, end, lazy, head, source)
    if data[end - 1 : end] not in (b"\n", b"\r"):
        remarks += _short_record_remarks(raw.records, source)
    remarks += blank_end_remarks(blank_rows, raw.records, source)
    return replace(raw, remarks=remarks + raw.remarks)


def _short_record_remarks(records: Sequence[RawRecord | ReadError], source: Source) -> tuple[ReadError, ...]:
    """Remark on a last record that is shorter than each of the others, in a text that ends within a line."""
    counts = [len(record.samples[0]) for record in records if isinstance(record, RawRecord) and record.samples]
    if len(counts) < 2 or counts[-1] >= min(counts[:-1]):
        return ()
    where = f"record {len(records)} of {len(records)}"
    problem = f"has {counts[-1]} samples and each other record {min(counts[:-1])} or more, and its last line has no end"
    return (source.error(where, problem, f"{COPY_AGAIN} if it was cut off", reason="truncated"),)


def _read_damaged_table(table: bytes, n_table: int, source: Source) -> RawFile:
    """Records of one of several tables of a text; the error about a damaged one is its record."""
    try:
        return _read_table(table, len(table), False, read_head(table, source), source, n_table)
    except ReadError as error:
        return RawFile((error,))


def _read_table(data: bytes | mmap, end: int, lazy: bool, head: Head, source: Source, n_table: int = 1) -> RawFile:
    """Records of a head and the rows below it; ``end`` is the byte behind the rows, ``n_table`` counts the tables."""
    names, units, offset, separator = head.names, [*decoded_units(head.units)], head.offset, head.separator
    if separator == BLANK:
        data = data[:end]
        data = data[:offset] + _with_single_blanks(data[offset:])
    is_in_memory = separator == BLANK or any(map(may_number_records, names))
    is_in_memory = is_in_memory or any(map(is_text, first_cells(data, offset, separator)))
    time = time_column(names, units)
    if lazy and not is_in_memory:
        columns, footer = lazy_columns(source, data, offset, end, separator, names, time)
    else:
        columns, footer = columns_in_memory(source, data[:end], offset, separator, names)
    remarks: tuple[ReadError, ...] = ()
    if time is None:  # else such a row has no time that fits
        remarks = tuple(outer_row_remarks(data, head, min(end, len(data)), source))
    head = head._replace(entries=(*head.entries, *footer), units=units)
    remarks += control_character_errors(data[:offset], source)
    facts = Metadata(head.notes, source)
    first = start_or_clock_in_cells(first_cells(data, offset, separator), names)
    marks = ambiguous_marks(columns, data, offset, separator)
    records = tuple(_records(columns, head, time, facts, source, first, marks, n_table))
    return RawFile(records, facts.count(RECORD_COUNT_NAMES), remarks)


def _with_single_blanks(rows: bytes) -> bytes:
    """Rows with one blank in place of the blanks and tabs between two words, and none at either end."""
    rows = re.sub(rb"[ \t]+", b" ", rows).replace(b"\n ", b"\n")
    return rows.replace(b" \n", b"\n").replace(b" \r\n", b"\r\n").strip(b" ")


N_COMPARED_ROWS = 20  # rows whose last numbers are compared with one that may be cut


def _end_of_rows(data: bytes | mmap, end: int, source: Source) -> tuple[int, tuple[ReadError, ...]]:
    """Byte behind the last row, without one that may be cut, and the remark on it; ``end`` is that behind the text.

    A row without line break is complete if it has as many separators as the rows above and its last number as many
    decimals as all of theirs.

    Raises
    ------
    ReadError
        If the text is empty or its only row may be cut.
    """
    if data[end - 1 : end] in (b"\n", b"\r"):
        return end, ()
    start = max(data.rfind(b"\n", 0, end), data.rfind(b"\r", 0, end)) + 1
    rows = data[max(0, start - N_COMPARED_ROWS * (end - start + 80)) : start].splitlines()[-N_COMPARED_ROWS:]
    last = data[start:end]
    if len(rows) == N_COMPARED_ROWS and all(_shape(row) == _shape(last) for row in rows) and _shape(last)[1]:
        return end, ()
    if not decode_text(last).strip() and not decode_text(data[:end]).strip():
        raise source.error("line 1", "there is no text", COPY_AGAIN, reason="empty")
    line = data[:end].count(b"\n") + 1
    problem = "the last line has no line break: its last number may be cut"
    remedy = f"{COPY_AGAIN}, or add the line break if it is whole"
    if start == 0 and not is_row(cells_of(text := decode_text(last), next((s for s in SEPARATORS if s in text), ","))):
        return end, ()  # not even numbers: the head is all that there is
    if start == 0:
        raise source.error(f"line {line}", problem, remedy, reason="truncated")
    return start, (source.error(f"line {line}", f"{problem}. It is left out", remedy, reason="truncated"),)


def _shape(row: bytes) -> tuple[int, int]:
    """Number of separators, and of digits behind the last decimal mark, of a row of numbers."""
    separator = next((s for s in (rb"[;\t|]", rb",", rb" +") if re.search(s, row.strip())), rb",")
    cells = re.split(separator, row.strip())
    decimals = re.fullmatch(rb' *"?[+-]?\d*[.,](\d+)(?:[eE][+-]?\d+)?"? *', cells[-1])
    return len(cells), len(decimals[1]) if decimals else 0


def _end_of_content(data: bytes | mmap, source: Source) -> tuple[int, tuple[ReadError, ...]]:
    """Byte behind the content, and the remark on zero bytes below it, where a file was reserved and not written.

    The remark states a line: the bytes of a text in UTF-16 are not those of the file.
    """
    end = len(data)
    while end and data[end - 1] == 0:
        block = data[max(0, end - HEAD_SIZE) : end]
        end -= len(block) - len(block.rstrip(b"\0"))
    remarks: tuple[ReadError, ...] = ()
    if end < len(data) and (n_line := max(data[:end].count(mark) for mark in (b"\n", b"\r"))):
        problem = "from here on all bytes are 0x00: nothing was written to them"
        remarks = (source.error(f"line {n_line + 1}", problem, COPY_AGAIN, reason="truncated"),)
    else:
        end = len(data)
    return end - (data[end - 1 : end] == END_OF_FILE), remarks


END_OF_FILE = b"\x1a"  # the mark with which programs of DOS end a text


def _in_utf8(source: Source, encoding: str) -> bytes:
    """A file that a spreadsheet saved as "Unicode" (UTF-16), or in UTF-32, converted to UTF-8.

    A replacement character stands for a last character that was cut.
    """
    decoder = codecs.getincrementaldecoder(encoding)()
    with source.parsed_by("Python", f"the text in {encoding[:6].upper()}"):
        text = decoder.decode(source.data)
    return f"{text}\ufffd".encode() if decoder.getstate()[0] else text.encode()


TIME_UNIT_REMEDY = "Find out which is right; then correct the other in the header of the file"


def _records(
    columns: list[Column],
    head: Head,
    time: int | None,
    facts: Metadata,
    source: Source,
    first: tuple[datetime | None, str],
    marks: Mapping[int, str],
    n_table: int,
) -> Iterator[RawRecord | ReadError]:
    """The records: one of all rows, or one per number in the column ``record``."""
    names, units, entries = head.names, head.units, head.entries
    numbering = record_column(dict(reversed([*zip(names, columns)])), source)
    numbers = columns[names.index(numbering)] if numbering is not None else None
    numbers = None if numbers is not None and _counts_rows(numbers) else numbers
    time = time if time is not None and columns[time].dtype.kind in "fiu" else None
    clocks = {
        i: np.asarray(column[:]).astype(float) * 1e-9 for i, column in enumerate(columns) if column.dtype.kind == "m"
    }
    selected = [i for i, name in enumerate(names) if name != numbering and i != time and columns[i].dtype.kind in "fiu"]
    selected = [i for i in selected if names[i] or len(selected) == 1 or not _says_nothing(columns[i])]
    seconds = (
        None
        if time is None or _is_empty(columns[time])
        else np.asarray(columns[time]) * seconds_per_number(units[time], source)
    )
    words = {names[i] or str(i): np.asarray(c[:]) for i, c in enumerate(columns) if holds_words(c)}
    check_valid(words, source)
    n_row = len(columns[0])
    spans = spans_of_records(numbers, n_row)
    n = len(spans)
    promised, rows = facts.count(("n_samples",)), facts.number(SAMPLE_COUNT_NAMES)
    if promised is None and rows is not None and n_row < rows != n_row * n_table:
        promised = int(rows)
    undecided = entry_statements(entries, [names[i] for i in selected])
    if time in head.unit_conflicts:
        raise source.error("the time column", head.unit_conflicts[time], TIME_UNIT_REMEDY, reason="unit_unknown")
    unit_conflicts = {k: head.unit_conflicts[i] for k, i in enumerate(selected) if i in head.unit_conflicts}
    entries = tuple(_of_channels(entry, selected, len(names)) for entry in entries)
    for k, span in enumerate(spans):
        if span is None:
            yield missing_record(k, n, source)
            continue
        a, b = span.start, span.stop
        if promised is not None and b - a != promised:
            is_cut_off = b - a < promised
            problem = f"has {b - a} of the {promised} samples that its header states"
            if not is_cut_off:
                problem = f"has {b - a} samples, and its header states {promised}"
            remedy = COPY_AGAIN if is_cut_off else "Write the right number into the header, without marks for thousands"
            yield source.error(
                f"record {k + 1} of {n}", problem, remedy, reason="truncated" if is_cut_off else "wrong_length"
            )
            continue
        start = facts.record_value((f"started_at_{k}", *START_NAMES), k, n)
        yield RawRecord(
            names=tuple(names[i] for i in selected),
            samples=[columns[i] if isinstance(columns[i], LazyColumn) else columns[i][a:b] for i in selected],
            units=tuple(units[i] for i in selected),
            **start_fields(start, declared=facts.label_of(START_NAMES)),
            axis_starts=(first,) if k == 0 else (),
            conditions=facts.conditions(k, n),
            time=None if seconds is None else seconds[a:b],
            aliases=tuple((*head.aliases[i], *other_readings(names[i])) for i in selected),
            marked_numbers={k: marks[i] for k, i in enumerate(selected) if i in marks},
            undecided=undecided,
            unit_conflicts=unit_conflicts,
            time_label="" if time is None else _label(names, units, time),
            is_time_in_seconds=time is not None and bool(units[time].strip()),
            clocks=tuple((f"column {_label(names, units, i)!r}", seconds[a:b]) for i, seconds in clocks.items()),
            entries=(*entries, *entries_of_words({name: column[a:b] for name, column in words.items()})),
            states={name: rarest_words(column[a:b]) for name, column in words.items()},
            counters={name: numbers_of_texts(column[a:b]) for name, column in words.items()},
        )


def _of_channels(entry: Entry, selected: Sequence[int], n_column: int) -> Entry:
    """An entry that lists a text for each column, or for each but the first, with those of the channels alone."""
    n_before = n_column - len(entry.value) if isinstance(entry.value, list) else -1
    if n_before not in (0, 1) or not selected or selected[0] < n_before:
        return entry
    return replace(entry, value=[entry.value[i - n_before] for i in selected])


def _label(names: Sequence[str], units: Sequence[str], i: int) -> str:
    """Name of a column, or its number, with its unit if it has one."""
    name = names[i] or str(i + 1)
    return f"{name} [{units[i]}]" if units[i].strip() else name


def _counts_rows(column: Column) -> bool:
    """Whether each row has a number of its own: a logger counts the samples of one record."""
    return len(column) > 1 and bool(np.all(np.diff(np.asarray(column[:])) != 0.0))


def _is_empty(column: Column) -> bool:
    return column.dtype.kind == "f" and bool(np.isnan(column[:]).all())


def _says_nothing(column: Column) -> bool:
    """Whether a column has no numbers, or counts the rows, as the index that pandas writes without a name."""
    blocks = [(a, np.asarray(column[a : a + BLOCK_SIZE])) for a in range(0, len(column), BLOCK_SIZE)]
    first = blocks[0][1][0]
    is_index = first in (0.0, 1.0) and all((block == first + a + np.arange(len(block))).all() for a, block in blocks)
    return is_index or all(np.isnan(block).all() for _, block in blocks)
