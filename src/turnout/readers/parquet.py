"""Parquet: a column per channel, a column ``record`` that numbers the records where there are several.

``rate``, ``started_at`` and the rest stand in the schema's metadata (JSON under ``turnout``, or plain keys), a unit in
the metadata of its field. A cut file has lost its footer and cannot be opened; pages carry checksums.
"""

import json

import numpy as np
import pyarrow.parquet as pq

from turnout.readers.raw import COPY_AGAIN, RawFile, RawRecord
from turnout.readers.stamps import moment
from turnout.readers.variables import COUNT, START, TIME, Facts


def read_raw(source) -> RawFile:
    """Records of a Parquet file."""
    with source.parsed_by("pyarrow"):
        table = pq.read_table(source.path, page_checksum_verification=True, use_threads=False)
        columns = {name: table.column(name).to_numpy() for name in table.column_names}
    facts = Facts(_notes(table.schema), source)
    units = {field.name: _unit(field) for field in table.schema}
    numbers = columns.pop("record", None)
    edges = [0, table.num_rows]
    if numbers is not None:
        edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1), table.num_rows]
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
                samples=[columns[name][part] for name in names],
                rate=facts.rate(),
                units=tuple(units[name] for name in names),
                started_at=moment(facts.one(START, k, n)),
                conditions=facts.conditions(k, n),
                time=None if time is None else _seconds(columns[time][part]),
            )
        )
    return RawFile(tuple(records) if table.num_rows else (), facts.count(COUNT))


def _notes(schema):
    """The metadata as variables: numbers as numbers."""
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
    """A time column in seconds from its first entry where it holds time stamps."""
    if time.dtype.kind == "M":
        return (time - time[0]).astype("timedelta64[ns]").astype(float) * 1e-9
    return np.asarray(time, dtype=float)
