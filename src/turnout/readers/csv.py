"""Text with separated columns: a head of ``name: value`` lines, a line of names, then numbers.

What is recognised: separators comma, semicolon, tab; a decimal comma where the separator is not a comma; head lines
with or without ``#``: ``rate`` (or ``fs``, ``sample_rate`` ..., in Hz) or ``dt`` [s], ``started_at``, ``n_records``,
``n_samples``, conditions; units in brackets behind the names ("force [N]", "force (N)") or in a line of their own; a
column ``time`` or ``t`` [s]; a column ``record`` that numbers the records. Without names the channels are "0", "1" ...

The last line must end with a line break: without it nobody can tell a cut number from a whole one.
"""

import io
import re
from itertools import pairwise

import numpy as np
import pyarrow as pa
from pyarrow import csv

from turnout.readers.raw import COPY_AGAIN, RawFile, RawRecord
from turnout.readers.stamps import moment
from turnout.readers.variables import COUNT, RATE, START, STEP, TIME, Facts

NOTE = re.compile(r"^#?\s*([A-Za-z_][\w .]*?)\s*[:=,;\t]\s*(.*)$")
NAME_WITH_UNIT = re.compile(r"^(.*?)\s*[\[(]([^\[\]]*)[\])]$")
NOTES = {*RATE, *STEP, *START, *COUNT, "n_samples"}


def read_raw(source) -> RawFile:
    """Records of a text file."""
    if source.data[-1:] not in (b"\n", b"\r"):
        found = "the last line has no line break: its last number may be cut"
        line = source.data.count(b"\n") + 1
        raise source.error(
            f"line {line}", found, f"{COPY_AGAIN}, or add the line break if it is whole", reason="truncated"
        )
    head, names, units, at, separator = _head(source)
    columns = _table(source, at, separator, len(names))
    facts = Facts(head, source)
    records = tuple(_records(columns, names, units, facts, source))
    return RawFile(records, facts.count(COUNT))


def _head(source):
    """(notes, names, units, offset of the first number, separator)."""
    notes: dict[str, float | str] = {}
    before: list[list[str]] = []
    position = 0
    while position < len(source.data):
        end = source.data.find(b"\n", position)
        end = len(source.data) if end < 0 else end
        line = source.data[position:end].decode("utf-8-sig", "replace").strip("\r\n")
        separator = max(("\t", ";", ","), key=line.count)
        cells = [cell.strip().strip('"') for cell in line.split(separator)]
        if line.strip() and all(_is_number(cell) or cell == "" for cell in cells) and any(cells):
            return notes, *_names(before, len(cells)), position, separator
        match = NOTE.match(line.strip())
        if match and (line.startswith("#") or match[1].strip().lower() in NOTES):
            notes[match[1].strip()] = _value(match[2].strip(separator + " "))
        elif line.strip():
            before.append(cells)
        position = end + 1
    raise source.error("line 1", "no line of numbers follows", COPY_AGAIN, reason="empty")


def _is_number(cell):
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _value(text):
    """A number where the text begins with one ("51200 Hz"), else the text."""
    first = text.split()[0] if text.split() else ""
    return float(first) if first and _is_number(first) and "-" not in first[1:].lower().replace("e-", "") else text


def _names(lines, count):
    """(names, units) out of the lines between head and numbers: names, and perhaps a line of units."""
    lines = [line for line in lines if len(line) >= count]
    if not lines:
        return [str(i) for i in range(count)], [""] * count
    names, units = lines[0][:count], [""] * count
    if len(lines) > 1:
        units = [cell.strip("[]() ") for cell in lines[1][:count]]
    for i, name in enumerate(names):
        if match := NAME_WITH_UNIT.match(name):
            names[i], units[i] = match[1], match[2]
    return names, units


def _table(source, at, separator, width):
    """Columns of numbers."""
    first = source.data[at : at + 4096]
    point = "," if separator != "," and b"," in first and b"." not in first else "."
    head = source.data[:at].count(b"\n")
    options = csv.ConvertOptions(
        column_types={str(i): pa.float64() for i in range(width)},
        decimal_point=point,
        null_values=["", "NaN", "nan", "NA", "-"],
        strings_can_be_null=True,
    )
    reading = csv.ReadOptions(use_threads=False, column_names=[str(i) for i in range(width)], block_size=1 << 24)
    with source.parsed_by("pyarrow", f"the numbers after line {head}"):
        table = csv.read_csv(
            io.BytesIO(memoryview(source.data)[at:]),
            read_options=reading,
            parse_options=csv.ParseOptions(delimiter=separator),
            convert_options=options,
        )
    return [column.to_numpy(zero_copy_only=False) for column in table.columns]


def _records(columns, names, units, facts, source):
    """The records: all rows, or one per number in the column ``record``."""
    lower = [name.strip().lower() for name in names]
    number = columns[lower.index("record")] if "record" in lower else None
    time = next((i for i, name in enumerate(lower) if name in TIME), None)
    kept = [i for i, name in enumerate(lower) if name != "record" and i != time]
    n_row = len(columns[0])
    edges = [0, n_row]
    if number is not None:
        if not np.isfinite(number).all():
            raise source.error("column 'record'", "it does not number every row", COPY_AGAIN)
        edges = [0, *(np.flatnonzero(np.diff(number)) + 1), n_row]
    n = len(edges) - 1
    promised = facts.count(("n_samples",))
    for k, (a, b) in enumerate(pairwise(edges)):
        if promised is not None and b - a != promised:
            found = f"has {b - a} of the {promised} samples that its head promises"
            yield source.error(f"record {k + 1} of {n}", found, COPY_AGAIN, reason="truncated")
            continue
        start = facts.one((f"started_at_{k}", *START), k, n)
        yield RawRecord(
            names=tuple(names[i] for i in kept),
            samples=[columns[i][a:b] for i in kept],
            rate=facts.rate(),
            units=tuple(units[i] for i in kept),
            started_at=moment(start),
            conditions=facts.conditions(k, n),
            time=None if time is None else columns[time][a:b],
        )
