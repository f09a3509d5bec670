"""Reader of Parquet: a column per channel, and a column ``record`` that numbers the records if there are several.

A table with a row for each record has the samples of a channel in one cell, as a list.

``rate``, ``started_at`` and other metadata are in the schema (JSON under ``turnout``, or plain keys), a unit is in the
metadata of its field. A truncated file lacks its footer and cannot be opened; pages have checksums.
"""

import json
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from turnout.errors import ReadError
from turnout.readers.array_metadata import Metadata
from turnout.readers.channel_maps import kind_of
from turnout.readers.clock_texts import with_durations
from turnout.readers.declared_sizes import check_parquet
from turnout.readers.entries import entries_of
from turnout.readers.lazy import Column, LazyColumn
from turnout.readers.metadata_names import RECORD_COUNT_NAMES, START_NAMES, TIME_NAMES
from turnout.readers.record_columns import (
    are_texts,
    may_number_records,
    missing_record,
    numbers_of_texts,
    record_column,
    spans_of_records,
)
from turnout.readers.sample_variables import is_flag_series
from turnout.readers.source import COPY_AGAIN, RawFile, RawRecord, Source
from turnout.readers.start_columns import start_in_columns
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import entry_statements, scale_text, without_drawings
from turnout.readers.texts import decode_text
from turnout.readers.time_texts import stated_time
from turnout.readers.timing import seconds_since_first
from turnout.readers.word_columns import check_valid, entries_of_words

ROWS_REMEDY = "Write one row for each sample and one column of numbers for each channel"
MAX_LISTED = 6  # columns that a message names


def read_raw(source: Source) -> RawFile:
    """Records of a Parquet file.

    Parameters
    ----------
    source : Source
        The Parquet file.

    Returns
    -------
    RawFile
        One record, or one per number in the column ``record``.

    Raises
    ------
    ReadError
        If the file cannot be opened or a page is damaged.
    """
    with source.parsed_by("pyarrow"):
        file = pq.ParquetFile(source.path, page_checksum_verification=True)
        check_parquet(file.metadata, source)
        if repeated := [name for name, n in Counter(file.schema_arrow.names).items() if n > 1]:
            problem = f"several columns have the name {repeated[0]!r}"
            raise source.error("the columns", problem, "Write the file again with a name of its own for each column")
        schema, n_row = file.schema_arrow, file.metadata.num_rows
        remarks = tuple(_differing_copies(schema.metadata, file.metadata.metadata, source))
        is_listed = any(map(_holds_lists, schema))
        is_lazy = source.lazy and not is_listed and not any(map(may_number_records, schema.names))
        rows = RowGroupReader(file) if is_lazy else None
        columns = _columns_of_lists(file, source) if is_listed else _columns(file, rows, source)
        n_row = len(next(iter(columns.values()))) if is_listed else n_row
    notes = _notes_of(schema.metadata)
    facts = Metadata(notes, source)
    units = {field.name: _unit(field) for field in schema}
    stated = {f.name: scale_text({**without_drawings(notes), **_notes_of(f.metadata)}) for f in schema}
    numbering = record_column(columns, source)
    spans = spans_of_records(columns.pop(numbering) if numbering is not None else None, n_row)
    time = next((name for name, x in columns.items() if name.lower() in TIME_NAMES and x.dtype.kind in "fiumM"), None)
    names = [name for name, x in columns.items() if name != time and (x.dtype.kind in "fiu" or is_flag_series(x))]
    if n_row and not names:
        kinds = ", ".join(f"{field.name!r} ({field.type})" for field in list(schema)[:MAX_LISTED])
        raise source.error("the columns", f"none holds one number in a row; there are {kinds}", ROWS_REMEDY, "empty")
    others = {name: x.dtype for name, x in columns.items() if x.dtype.kind not in "fiumM"}
    words = {name: x for name, x in columns.items() if isinstance(x, np.ndarray) and are_texts(x)}
    check_valid(words, source)
    not_numbers = {name: f"{kind_of(dtype)}, no real numbers" for name, dtype in others.items()}
    clocks = [name for name, x in columns.items() if name != time and x.dtype.kind in "mM"]
    stamped = [name for name, x in columns.items() if x.dtype.kind == "M"]
    fields = {f"column {f.name!r}": _field_notes(f) for f in schema}
    common = tuple(entries_of(_metadata(schema), "metadata"))
    entries = (*common, *entries_of(fields, ""))
    nested = entry_statements(common, names)
    n = len(spans)
    records: list[RawRecord | ReadError] = []
    for k, span in enumerate(spans):
        if span is None:
            records.append(missing_record(k, n, source))
            continue
        promised = facts.count(("n_samples",), k, n)
        if promised is not None and span.stop - span.start != promised:
            problem = f"has {span.stop - span.start} of the {promised} samples that its metadata promise"
            records.append(source.error(f"record {k + 1} of {n}", problem, COPY_AGAIN, reason="truncated"))
            continue
        records.append(
            RawRecord(
                names=tuple(names),
                samples=[columns[name] if rows else columns[name][span] for name in names],
                entries=(*entries, *entries_of_words({name: x[span] for name, x in words.items()}))
                if words
                else entries,
                units=tuple(units[name] for name in names),
                **start_fields(facts.record_value(START_NAMES, k, n), declared=facts.label_of(START_NAMES)),
                axis_starts=(
                    *(_first_time(columns[name][span], schema.field(name)) for name in stamped),
                    start_in_columns({name: x[span] for name, x in columns.items() if x.dtype.kind in "OUSTm"}),
                ),
                conditions=facts.conditions(k, n),
                time=None if time is None else _seconds(columns[time][span]),
                undecided=nested | {i: stated[name] for i, name in enumerate(names) if stated[name]},
                time_label="" if time is None else f"{time} [{units[time]}]" if units[time].strip() else time,
                is_time_in_seconds=time is not None and columns[time].dtype.kind in "mM",
                clocks=tuple(
                    (f"column {name!r}", _seconds(columns[name][span]))
                    for name in clocks
                    if _varies(columns[name][span])
                ),
                not_numbers=not_numbers,
                counters={name: numbers_of_texts(x[span]) for name, x in words.items()},
            )
        )
    return RawFile(tuple(records) if n_row else (), facts.count(RECORD_COUNT_NAMES), remarks)


def _differing_copies(
    of_schema: dict[bytes, bytes] | None, of_file: dict[bytes, bytes] | None, source: Source
) -> Iterator[ReadError]:
    """Remark on the first entry of the metadata whose two copies differ: Arrow stores the schema once more."""
    copies = of_file or {}
    for name, value in (of_schema or {}).items():
        if copies.get(name, value) != value:
            problem = f"its two copies of the entry {name.decode('utf-8', 'replace')!r} differ"
            yield source.error("the metadata", problem, COPY_AGAIN, reason="condition_lost")
            return


def _columns(file: pq.ParquetFile, rows: "RowGroupReader | None", source: Source) -> dict[str, Column]:
    """Name -> numbers, or a lazy column if ``rows`` is given; a time column is always read."""
    names = file.schema_arrow.names
    if rows is None:
        table = file.read(use_threads=False)
        return {name: _to_numpy(table.column(name), name, source) for name in names}
    lazy_names = [f.name for f in file.schema_arrow if (pa.types.is_floating(f.type) or pa.types.is_integer(f.type))]
    lazy_names = [name for name in lazy_names if name.lower() not in TIME_NAMES]
    table = file.read([name for name in names if name not in lazy_names], use_threads=False)
    columns: dict[str, Column] = {name: _to_numpy(table.column(name), name, source) for name in table.column_names}
    columns |= {name: rows.column(name) for name in lazy_names}
    return {name: columns[name] for name in names}


def _holds_lists(field: pa.Field) -> bool:
    """Whether each cell of a column holds the samples of a record."""
    kind = field.type
    is_list = pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    return is_list and (pa.types.is_floating(kind.value_type) or pa.types.is_integer(kind.value_type))


def _columns_of_lists(file: pq.ParquetFile, source: Source) -> dict[str, Column]:
    """Columns with a row for each sample, of a table with a row for each record; other cells are repeated."""
    table = file.read(use_threads=False)
    listed = [field.name for field in table.schema if _holds_lists(field)]
    lengths = {name: pc.fill_null(pc.list_value_length(table.column(name)), 0).to_numpy() for name in listed}
    of_rows = next(iter(lengths.values()))
    for name, of_channel in lengths.items():
        if (is_other := of_channel != of_rows).any():
            k = int(np.argmax(is_other))
            problem = f"row {k + 1} has {of_channel[k]} samples in {name!r} and {of_rows[k]} in {listed[0]!r}"
            raise source.error("the columns", problem, COPY_AGAIN, reason="truncated")
    columns: dict[str, Column] = {}
    for name in table.column_names:
        column = table.column(name)
        if name in listed:
            columns[name] = _to_numpy(pa.chunked_array([pc.list_flatten(c) for c in column.chunks]), name, source)
        else:
            columns[name] = np.repeat(_to_numpy(column, name, source), of_rows)
    if table.num_rows > 1 and record_column(columns, source) is None:
        columns["record"] = np.repeat(np.arange(1, table.num_rows + 1), of_rows)
    return columns


def _to_numpy(column: pa.ChunkedArray, name: str, source: Source) -> np.ndarray:
    """Values of a column; times of day become durations since midnight, or since the first one where they are text."""
    if pa.types.is_time(column.type):
        whole = column.cast(pa.int64() if column.type.bit_width == 64 else pa.int32()).to_numpy()
        return whole.astype("int64").view(f"timedelta64[{column.type.unit}]") if whole.dtype.kind == "i" else whole
    if pa.types.is_decimal(column.type):
        column = column.cast(pa.float64())
    return with_durations(column.to_numpy(), "column", name, source)


class RowGroupReader:
    """Reads row groups of a file; two adjacent ones are cached, because a block may lie across their border.

    Parameters
    ----------
    file : pq.ParquetFile
        The open file.
    """

    def __init__(self, file: pq.ParquetFile):
        self.file = file
        self.groups: dict[int, pa.Table] = {}
        sizes = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
        self.edges = np.concatenate([[0], np.cumsum(sizes)]).astype(int)

    def column(self, name: str) -> LazyColumn:
        """One column, read lazily.

        Parameters
        ----------
        name : str
            Name of the column.

        Returns
        -------
        LazyColumn
            Its numbers, read when it is sliced.
        """
        dtype = self.file.schema_arrow.field(name).type.to_pandas_dtype()
        return LazyColumn(lambda start, stop: self._read_rows(name, start, stop), int(self.edges[-1]), dtype)

    def _read_rows(self, name: str, start: int, stop: int) -> np.ndarray:
        first, last = np.searchsorted(self.edges, [start, max(stop - 1, start)], side="right") - 1
        pieces = []
        for k in range(first, last + 1):
            low, high = max(start - self.edges[k], 0), stop - self.edges[k]
            pieces.append(self._group(k).column(name).to_numpy()[low:high])
        return np.concatenate(pieces)

    def _group(self, k: int) -> pa.Table:
        if k not in self.groups:
            self.groups = {i: group for i, group in self.groups.items() if abs(i - k) == 1}
            self.groups[k] = self.file.read_row_group(k, use_threads=False)
        return self.groups[k]


def _notes_of(metadata: dict[bytes, bytes] | None) -> dict[str, Any]:
    """The metadata of the schema or of a field as variables, decoded from JSON where possible."""
    raw = {decode_text(k): decode_text(v) for k, v in (metadata or {}).items()}
    notes = {}
    for key, text in raw.items():
        try:
            notes[key] = json.loads(text)
        except ValueError:
            notes[key] = text
    return {**notes, **notes.get("turnout", {})} if isinstance(notes.get("turnout", {}), dict) else notes


def _metadata(schema: pa.Schema) -> dict[str, Any]:
    """The notes without pandas' description of its own index and columns, of which only the attributes are data."""
    notes = {
        name: value for name, value in _notes_of(schema.metadata).items() if name not in ("ARROW:schema", "turnout")
    }
    pandas = notes.pop("pandas", None)
    return {**notes, "pandas": pandas["attributes"]} if isinstance(pandas, dict) and pandas.get("attributes") else notes


def _field_notes(field: pa.Field) -> dict[str, str]:
    return {decode_text(k): decode_text(v) for k, v in (field.metadata or {}).items()}


def _varies(stamps: Column) -> bool:
    """Whether time stamps differ: one that is the same in every row is no time axis."""
    values = np.asarray(stamps[:])
    return len(values) > 1 and bool((values != values[0]).any())


def _first_time(stamps: Column, field: pa.Field) -> tuple[datetime | None, str]:
    """First time stamp of a column, in UTC if the column has a time zone, and "" as it cannot be misread."""
    time, text = stated_time(stamps[:1][0]) if len(stamps) else (None, "")
    return time.replace(tzinfo=UTC) if time and field.type.tz else time, text


def _unit(field: pa.Field) -> str:
    metadata = field.metadata or {}
    return next((metadata[k].decode("utf-8", "replace") for k in (b"unit", b"units") if k in metadata), "")


def _seconds(time: np.ndarray) -> np.ndarray:
    """A time column in seconds; time stamps are counted from the first one."""
    if time.dtype.kind in "mM":
        return seconds_since_first(time)
    return np.asarray(time, dtype=float)
