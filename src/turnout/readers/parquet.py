"""Reader of Parquet: a column per channel, and a column ``record`` that numbers the records if there are several.

``rate``, ``started_at`` and other metadata are in the schema (JSON under ``turnout``, or plain keys), a unit is in the
metadata of its field. A truncated file lacks its footer and cannot be opened; pages have checksums.
"""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from turnout.readers.lazy import Column
from turnout.readers.named_arrays import COUNT, START, TIME, Facts
from turnout.readers.source import COPY_AGAIN, RawFile, RawRecord
from turnout.readers.timing import TEXT, moment


def read_raw(source) -> RawFile:
    """Records of a Parquet file."""
    with source.parsed_by("pyarrow"):
        file = pq.ParquetFile(source.path, page_checksum_verification=True)
        schema, n_row = file.schema_arrow, file.metadata.num_rows
        rows = RowGroups(file) if source.stay and "record" not in schema.names else None
        columns = _columns(file, rows)
    facts = Facts(_notes(schema), source)
    units = {field.name: _unit(field) for field in schema}
    numbers = columns.pop("record", None)
    edges = [0, n_row]
    if numbers is not None:
        edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1), n_row]
    time = next((name for name in columns if name.lower() in TIME), None)
    names = [name for name, x in columns.items() if name != time and x.dtype.kind in "fiu"]
    n = len(edges) - 1
    records = []
    for k in range(n):
        part = slice(edges[k], edges[k + 1])
        promised = facts.count(("n_samples",), k, n)
        if promised is not None and part.stop - part.start != promised:
            found = f"has {part.stop - part.start} of the {promised} samples that its metadata promise"
            records.append(source.error(f"record {k + 1} of {n}", found, COPY_AGAIN, reason="truncated"))
            continue
        records.append(
            RawRecord(
                names=tuple(names),
                samples=[columns[name] if rows else columns[name][part] for name in names],
                **facts.rated(TEXT),
                units=tuple(units[name] for name in names),
                started_at=moment(facts.one(START, k, n)),
                conditions=facts.conditions(k, n),
                time=None if time is None else _seconds(columns[time][part]),
            )
        )
    return RawFile(tuple(records) if n_row else (), facts.count(COUNT))


def _columns(file, rows):
    """Name -> numbers, or a lazy column if ``rows`` is given; a time column is always read."""
    names = file.schema_arrow.names
    if rows is None:
        table = file.read(use_threads=False)
        return {name: table.column(name).to_numpy() for name in names}
    stay = [f.name for f in file.schema_arrow if (pa.types.is_floating(f.type) or pa.types.is_integer(f.type))]
    stay = [name for name in stay if name.lower() not in TIME]
    table = file.read([name for name in names if name not in stay], use_threads=False)
    read = {name: table.column(name).to_numpy() for name in table.column_names}
    kept = {name: rows.column(name) for name in stay}
    return {name: read.get(name, kept.get(name)) for name in names}


class RowGroups:
    """Reads row groups of a file; two adjacent ones are cached, because a block may lie across their border."""

    def __init__(self, file):
        self.file, self.held = file, {}
        sizes = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
        self.edges = np.concatenate([[0], np.cumsum(sizes)]).astype(int)

    def column(self, name):
        """One column, read lazily."""
        dtype = self.file.schema_arrow.field(name).type.to_pandas_dtype()
        return Column(lambda start, stop: self._stretch(name, start, stop), int(self.edges[-1]), dtype)

    def _stretch(self, name, start, stop):
        first, last = np.searchsorted(self.edges, [start, max(stop - 1, start)], side="right") - 1
        parts = []
        for k in range(first, last + 1):
            low, high = max(start - self.edges[k], 0), stop - self.edges[k]
            parts.append(self._group(k).column(name).to_numpy()[low:high])
        return np.concatenate(parts)

    def _group(self, k):
        if k not in self.held:
            self.held = {i: group for i, group in self.held.items() if abs(i - k) == 1}
            self.held[k] = self.file.read_row_group(k, use_threads=False)
        return self.held[k]


def _notes(schema):
    """The metadata of the schema as variables, decoded from JSON where possible."""
    raw = {k.decode("utf-8", "replace"): v.decode("utf-8", "replace") for k, v in (schema.metadata or {}).items()}
    notes = {}
    for key, text in raw.items():
        try:
            notes[key] = json.loads(text)
        except ValueError:
            notes[key] = text
    return {**notes, **notes.get("turnout", {})} if isinstance(notes.get("turnout", {}), dict) else notes


def _unit(field):
    metadata = field.metadata or {}
    return next((metadata[k].decode("utf-8", "replace") for k in (b"unit", b"units") if k in metadata), "")


def _seconds(time):
    """A time column in seconds; time stamps are counted from the first one."""
    if time.dtype.kind == "M":
        return (time - time[0]).astype("timedelta64[ns]").astype(float) * 1e-9
    return np.asarray(time, dtype=float)
