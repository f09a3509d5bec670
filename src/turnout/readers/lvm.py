"""Reader of LabVIEW measurement files (.lvm): each segment, or each write under one header, is a record.

The package lvm_read is not used: it turns unreadable numbers into NaN, does not detect truncated segments, and needs
some 2 µs per number. Layout: National Instruments, "Specification for the LabVIEW Measurement File".
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import pyarrow as pa
from pyarrow import csv

from turnout.errors import ReadError
from turnout.readers.array_metadata import Metadata
from turnout.readers.csv_cells import DECIMAL, INVALID_VALUE
from turnout.readers.entries import Entry, entries_of, step_entry
from turnout.readers.lost_entries import control_character_errors
from turnout.readers.rate_units import rate_unit
from turnout.readers.rate_vocabulary import is_time_name
from turnout.readers.record_borders import IMPACT_SHARE
from turnout.readers.source import CONDITIONS, COPY_AGAIN, RawFile, RawRecord, Source, number_or_text
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import scale_problem, scale_statements, without_drawings
from turnout.readers.texts import decode_text, wide_encoding
from turnout.readers.time_texts import parse_time
from turnout.readers.timing import check_simultaneous, start_offsets

END_OF_HEADER = b"***End_of_Header***"
SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read_raw(source: Source) -> RawFile:
    """Records of an LVM file; the head of the file may state their number (``Records``).

    Parameters
    ----------
    source : Source
        The LabVIEW measurement file.

    Returns
    -------
    RawFile
        One record per segment.

    Raises
    ------
    ReadError
        If the header has no end, or no segment follows.
    """
    if encoding := wide_encoding(source.head):
        raise source.error("byte 0", f"its text is in {encoding[:6].upper()}", "Save it as UTF-8 with a text editor")
    lines = decode_text(source.data[: source.data.find(END_OF_HEADER)]).splitlines()
    head = _fields(lines, _separator(lines))
    if END_OF_HEADER not in source.data:
        if not source.head.startswith(FIRST_WORDS) and _is_row(source.head.partition(b"\n")[0]):
            problem = "it has no header: LabVIEW wrote it with the setting 'Segment headers: no headers'"
            raise source.error("the header", problem, NO_HEADER_REMEDY)
        raise source.error("the header", "it has no end", COPY_AGAIN, reason="truncated")
    separator = _separator(lines)
    starts = _segments(source.data)
    if not starts:
        body = source.data[source.data.find(END_OF_HEADER) + len(END_OF_HEADER) :].lstrip().partition(b"\n")[0]
        if _is_row(body):
            problem = (
                "numbers follow its header without the header of a segment, so their channels and rate are not stated"
            )
            raise source.error("the file", problem, NO_HEADER_REMEDY)
        raise source.error("the file", "no segment of samples follows its header", COPY_AGAIN, reason="empty")
    edges = [*starts, len(source.data)]
    records: list[RawRecord | ReadError] = []
    for k, start in enumerate(starts):
        try:
            records.extend(_records(source, start, edges[k + 1], head, separator, k, len(starts)))
        except ReadError as error:
            records.append(error)
    remarks = control_character_errors(source.data[: starts[0]], source)
    return RawFile(tuple(records), Metadata(head, source).count(("records",)), remarks)


FIRST_WORDS = b"LabVIEW Measurement"
NO_HEADER_REMEDY = (
    "Set 'Segment headers: one header per segment' in LabVIEW; to read this file, set 'format: csv' and the rate "
    "in the layout and name its columns 0, 1 ..."
)


def _is_row(line: bytes) -> bool:
    """Whether a line holds only numbers."""
    cells = [cell.strip().replace(b",", b".") for cell in re.split(rb"[\t;]", line.strip())]
    return any(cells) and all(re.fullmatch(rb"[+-]?[\d.]+(?:[eE][+-]?\d+)?", cell) for cell in cells if cell)


def _separator(lines: Sequence[str]) -> str:
    named = next((line for line in lines if line.startswith("Separator")), "Separator\tTab")
    return SEPARATORS.get(named[10:].strip().strip(",;"), "\t")


def _fields(lines: Sequence[str], separator: str) -> dict[str, str]:
    pairs = (line.split(separator) for line in lines)
    return {cells[0].strip(): cells[1].strip() for cells in pairs if len(cells) > 1 and cells[0].strip()}


HEADER_NAME = re.compile(rb"(?!nan\b|inf|x_value)[a-z]", re.IGNORECASE)  # at the beginning of a line: no row has it


def _segments(data: bytes) -> list[int]:
    """Offsets at which the headers of the segments begin; their line "Channels" need not be the first."""
    offsets, offset = [], data.find(END_OF_HEADER)
    while (offset := data.find(b"\nChannels", offset)) >= 0:
        start = offset + 1
        while HEADER_NAME.match(data, above := data.rfind(b"\n", 0, start - 1) + 1):
            start = above
        offsets.append(start)
        offset += 1
    return offsets


@dataclass(frozen=True)
class _Segment:
    """Header of a segment: cells of its lines, and of each channel its name, samples, step and offset of X.

    ``n_x_columns`` is 0, 1, or 2 for one X column per channel; ``first`` is the offset of the first row in the file.
    ``steps`` and ``offsets`` are in ``x_unit``, a unit of time.
    """

    where: str
    fields: dict[str, list[str]]
    names: list[str]
    samples: list[int]
    steps: list[float]
    offsets: list[float]
    decimal_mark: str
    n_x_columns: int
    first: int
    x_unit: str


def _records(
    source: Source, start: int, stop: int, head: Mapping[str, str], separator: str, k: int, n: int
) -> list[RawRecord]:
    """One segment: its header of one column per channel, then rows of X_Value, the channels and a comment.

    With one header for several writes the segment is cut into records of the number of samples in the header, unless a
    time column continues.
    """
    segment = _segment(source, start, stop, head, separator, f"record {k + 1} of {n}")
    fields, count = segment.fields, len(segment.names)
    columns, x = _columns(
        source, source.data[segment.first : stop], separator, segment.decimal_mark, count, segment.n_x_columns,
        segment.where,
    )  # fmt: skip
    n_row = len(columns[0]) if columns else 0
    n_write, samples = _writes(source, segment, columns, x)
    _check_lengths(source, segment, samples, columns, n_write)
    _check_starts(source, segment)
    units = fields.get("Y_Unit_Label", [])
    started_text = _date_and_time(
        *(_per_channel(fields, name, 1)[0] or head.get(name, "") for name in ("Date", "Time"))
    )
    of_head = _date_and_time(head.get("Date", ""), head.get("Time", ""))
    entries = (*_entries(fields, segment.x_unit), *entries_of(head, "the file's header"))
    has_x = x is not None and len(x) == n_row and bool(np.isfinite(x).all())
    n_sample = n_row // n_write
    undecided = _undecided_scales(fields, head, count)
    seconds = x * _seconds_per_x(segment.x_unit) if has_x and x is not None else None
    return [
        RawRecord(
            names=tuple(segment.names),
            samples=[column[i * n_sample : (i + 1) * n_sample] for column in columns],
            entries=entries,
            is_time_in_seconds=True,
            time=None if seconds is None else seconds[i * n_sample : (i + 1) * n_sample],
            units=tuple(units[:count]) if len(units) >= count else ("",) * count,
            **(start_fields(started_text, of_head) if i == 0 else {}),  # of later writes no time is stated
            conditions={name: number_or_text(head[name]) for name in CONDITIONS if name in head},
            undecided=undecided,
        )
        for i in range(n_write)
    ]


def _segment(source: Source, start: int, stop: int, head: Mapping[str, str], separator: str, where: str) -> _Segment:
    """Header of the segment between two offsets; an error if it has no end or names too few channels."""
    end = source.data.find(END_OF_HEADER, start, stop)
    first = source.data.find(b"\n", source.data.find(b"\nX_Value", max(end, start), stop) + 1, stop) + 1
    if end < 0 or first == 0 or b"\nX_Value" not in source.data[end:stop]:
        raise source.error(where, "its header has no end", COPY_AGAIN, reason="truncated")
    text = decode_text(source.data[start:end]).splitlines()
    n_x_columns = {"No": 0, "One": 1}.get(head.get("X_Columns", "One"), 2)
    fields = {cells[0].strip(): [c.strip() for c in cells[1:]] for cells in (line.split(separator) for line in text)}
    if n_x_columns == 2:
        fields = {name: _cells_of_channels(cells) for name, cells in fields.items()}
    mark = head.get("Decimal_Separator", ".")
    x_line = decode_text(source.data[source.data.find(b"\nX_Value", end) + 1 : first])
    titles = x_line.rstrip("\r\n").split(separator)[1 :: max(n_x_columns, 1)]
    names = [name for name in titles if name and name != "Comment"]
    with source.parsed_by("the header", where):
        count = int(fields["Channels"][0])
        samples = [int(s) for s in fields.get("Samples", [])[:count]]
        steps = [float(s.replace(mark, ".")) for s in fields.get("Delta_X", [])[:count] if s] or [0.0]
        offsets = [float(x.replace(mark, ".") or 0.0) for x in _per_channel(fields, "X0", count)]
    if len(names) != count:
        raise source.error(where, f"it names {len(names)} of {count} channels", COPY_AGAIN, reason="truncated")
    x_unit = _x_unit(fields, where, source)
    return _Segment(where, fields, names, samples, steps, offsets, mark, n_x_columns, first, x_unit)


def _x_unit(fields: Mapping[str, list[str]], where: str, source: Source) -> str:
    """Unit of time of the X axis, "s" if none is stated; ReadError for an axis of another quantity."""
    unit, quantity = (next((c for c in fields.get(name, []) if c), "") for name in ("X_Unit_Label", "X_Dimension"))
    known = rate_unit(unit) if unit else None
    if (unit and (known is None or not known.is_step)) or (quantity and not is_time_name(quantity)):
        problem = f"its X axis is {quantity or 'no time'}{f' in {unit!r}' if unit else ''}, and not the time"
        raise source.error(where, problem, "Export the samples of force and acceleration over the time")
    return unit or "s"


def _seconds_per_x(x_unit: str) -> float:
    unit = rate_unit(x_unit)
    return float(unit.scale) if unit else 1.0


def _writes(
    source: Source, segment: _Segment, columns: Sequence[np.ndarray], x: np.ndarray | None
) -> tuple[int, list[int]]:
    """Number of writes under one header, and samples of each channel in one of them.

    Raises
    ------
    ReadError
        If the rows are no whole number of writes, or a write has no impact: nothing tells it from a part of a record.
    """
    n_row = len(columns[0]) if columns else 0
    samples = segment.samples
    if not (samples and len(set(samples)) == 1 and samples[0] > 0 and n_row > samples[0]):
        return 1, samples
    if x is not None and len(x) == n_row and np.all(np.diff(x) > 0):  # one write, continued
        return 1, [n_row] * len(segment.names)
    n_write, remainder = divmod(n_row, samples[0])
    remedy = "Set 'Segment headers: one header per segment' in LabVIEW, or copy the file again"
    if remainder:
        problem = f"{n_row} rows follow its header of {samples[0]} samples: no whole number of writes"
        raise source.error(segment.where, problem, remedy, reason="wrong_length")
    if not any(_smallest_peak(column, n_write) >= IMPACT_SHARE for column in columns):
        problem = f"{n_row} rows follow its header of {samples[0]} samples, and not each {samples[0]} have an impact"
        problem = f"{problem}: they may be one record that LabVIEW wrote in parts"
        raise source.error(segment.where, problem, remedy, reason="wrong_length")
    return n_write, samples


def _smallest_peak(column: np.ndarray, n_write: int) -> float:
    """Smallest of the peaks of equal parts of a column, over the largest."""
    peaks = np.abs(np.nan_to_num(column - np.nanmedian(column))).reshape(n_write, -1).max(axis=1)
    return float(peaks.min() / peaks.max()) if peaks.max() > 0 else 0.0


def _check_lengths(
    source: Source, segment: _Segment, samples: Sequence[int], columns: Sequence[np.ndarray], n_write: int
) -> None:
    """An error if a channel has not the samples that its header states."""
    for name, promised, column in zip(segment.names, samples, columns):
        if len(column) != promised * n_write:
            place = f"{segment.where}, channel {name!r}"
            problem = f"ends after {len(column)} of {promised} samples"
            raise source.error(place, problem, COPY_AGAIN, reason="truncated")


def _check_starts(source: Source, segment: _Segment) -> None:
    """An error if the channels were not sampled together."""
    count = len(segment.names)
    dates, clocks = (_per_channel(segment.fields, name, count) for name in ("Date", "Time"))
    stamps = [_parse_date_and_time(*cells) for cells in zip(dates, clocks)]
    scale = _seconds_per_x(segment.x_unit)
    starts = [a + b * scale for a, b in zip(start_offsets(stamps), segment.offsets)]
    check_simultaneous(segment.names, [step * scale for step in segment.steps], starts, segment.where, source)


def _undecided_scales(fields: Mapping[str, list[str]], head: Mapping[str, str], count: int) -> dict[int, str]:
    """Of each channel whose scale the file states, but not whether its numbers contain it, the problem."""
    listed = {name: _scales_of_channels(values, count) for name, values in fields.items() if any(values)}
    problems = enumerate(map(scale_problem, scale_statements({**without_drawings(head), **listed}, count)))
    return {i: problem for i, problem in problems if problem}


def _cells_of_channels(cells: list[str]) -> list[str]:
    """Cells of the channels in a header line with one X column each: every second cell, if those between are empty."""
    return cells[::2] if not any(cells[1::2]) else cells


def _scales_of_channels(cells: list[str], count: int) -> list[str]:
    """Cells of a header line, one per channel; a single cell holds for all channels.

    Behind them a line may have empty cells and a comment.
    """
    if not any(cells[1:]):
        return cells[:1]
    return [*cells, *[""] * count][:count]


def _per_channel(fields: Mapping[str, list[str]], name: str, count: int) -> list[str]:
    """The field ``name`` of each channel, "" if absent."""
    return [*fields.get(name, []), *[""] * count][:count]


def _entries(fields: Mapping[str, list[str]], x_unit: str) -> Iterator[Entry]:
    """Entries of a segment's header, one per channel where the channels differ."""
    for name, values in fields.items():
        if name == "Delta_X":
            step = next((value for value in values if value and value.casefold() != "nan"), "0")
            yield step_entry("header of the segment: Delta_X", step, x_unit)
            continue
        for value in dict.fromkeys(value for value in values if value):
            # of several writes under one header it counts the first
            yield Entry(f"header of the segment: {name}", name, value, is_defined=name == "Samples")


def _date_and_time(date: str, clock: str) -> str:
    return f"{date.replace('/', '-')}T{clock.replace(',', '.')[:15]}" if date or clock else ""


def _parse_date_and_time(date: str, clock: str) -> datetime | None:
    return parse_time(_date_and_time(date, clock))


def _columns(
    source: Source, body: bytes, separator: str, decimal_mark: str, count: int, n_x_columns: int, where: str
) -> tuple[list[np.ndarray], np.ndarray | None]:
    """One array per channel, and the X column if there is one: the rows up to the blank line that ends a segment."""
    body = body.replace(b"\r", b"")
    for segment_end in (b"\n\n", b"\n" + separator.encode() + b"\n"):
        body = body.partition(segment_end)[0] + b"\n" if segment_end in body else body
    if not body.strip():
        return [np.empty(0)] * count, None
    if not body.endswith(b"\n"):
        problem = "its last line has no line break: the last number may be cut"
        raise source.error(where, problem, COPY_AGAIN, reason="truncated")
    indices = [1 + 2 * i for i in range(count)] if n_x_columns > 1 else [1 + i for i in range(count)]
    width = indices[-1] + 1
    indices = [0, *indices] if n_x_columns else indices
    separator_bytes = separator.encode()
    with source.parsed_by("pyarrow", where), _cell_errors(where, decimal_mark, source):
        try:
            table = _table(body, width, separator, decimal_mark, indices)
        except pa.ArrowInvalid:  # a comment behind the channels: only some rows have one
            rows = [line.split(separator_bytes)[:width] for line in body.splitlines()]
            table = _table(b"\n".join(map(separator_bytes.join, rows)) + b"\n", width, separator, decimal_mark, indices)
    columns = [column.to_numpy(zero_copy_only=False) for column in table.columns]
    return (columns[1:], columns[0]) if n_x_columns else (columns, None)


@contextmanager
def _cell_errors(where: str, decimal_mark: str, source: Source) -> Iterator[None]:
    """Context that converts pyarrow's error about a cell with another decimal mark than that of the header."""
    try:
        yield
    except pa.ArrowInvalid as error:
        cell = INVALID_VALUE.search(str(error))
        if not cell or not DECIMAL.fullmatch(cell[3].strip()):
            raise
        problem = f"{cell[3].strip()[:60]!r} has another decimal mark than {decimal_mark!r}, which its header states"
        remedy = "Export it again with one decimal mark; somebody or another program changed the file"
        raise source.error(where, problem, remedy) from error


def _table(body: bytes, width: int, separator: str, decimal_mark: str, indices: Sequence[int]) -> pa.Table:
    names = [str(i) for i in range(width)]
    return csv.read_csv(
        pa.py_buffer(body),
        read_options=csv.ReadOptions(use_threads=False, column_names=names, block_size=1 << 24),
        parse_options=csv.ParseOptions(delimiter=separator),
        convert_options=csv.ConvertOptions(
            column_types={names[i]: pa.float64() for i in indices},
            decimal_point=decimal_mark,
            include_columns=[names[i] for i in indices],
            null_values=["", "NaN"],
        ),
    )
