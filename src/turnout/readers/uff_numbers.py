"""The numbers of a data set 58 or 58b: fixed columns of text, or binary, up to the closing delimiter."""

import re
from dataclasses import dataclass
from itertools import pairwise
from mmap import mmap

import numpy as np

END_58B = re.compile(rb"\r?\n? {4}-1 *(?:\r?\n|\r|$)")
REST_OF_LINE = re.compile(rb" *(?:\r?\n|\r|$)")


@dataclass(frozen=True)
class Delimiter:
    """A line of -1 in columns 5 and 6, blanks behind it: ``start`` of the line, ``end`` behind its line break."""

    start: int
    end: int


def delimiter(data: bytes | mmap, position: int) -> Delimiter | None:
    """The first delimiter from ``position`` on; plain search, because a pattern over megabytes of numbers is slow."""
    at = position
    while (at := data.find(b"    -1", at)) >= 0:
        rest = REST_OF_LINE.match(data, at + 6)
        if rest and (at == 0 or data[at - 1] in b"\r\n"):
            return Delimiter(at, rest.end())
        at += 1
    return None


def _per_value(header):
    """Numbers stored for each value."""
    return (2 if header["complex"] else 1) + (0 if header["even"] else 1)


def binary_numbers(data, at, header):
    """(numbers, position behind the set, damage) of a 58b set.

    Where the header and the closing delimiter disagree, the delimiter decides: some exporters leave the byte count 0,
    some say single precision and write double.
    """
    if header["float_format"] not in (0, 2):
        end = delimiter(data, at)
        position = end.end if end else len(data)
        return np.empty(0), position, f"floating-point format {header['float_format']} is not IEEE 754 (2)"
    count = header["set"]["promised"] * _per_value(header)
    sizes = {"d" if header["double"] else "f": count * (8 if header["double"] else 4), "d": count * 8}
    for letter, size in sizes.items():
        if (closed := END_58B.match(data, at + size)) is not None:
            return np.frombuffer(data, header["byte_order"] + letter, count, at), closed.end(), ""
    item = 8 if header["double"] else 4
    late = END_58B.search(data, at)
    stop = late.start() if late else len(data)
    there = (stop - at) // item
    kept = min(there, count)
    values = np.frombuffer(data, f"{header['byte_order']}f{item}", kept, at)
    per = _per_value(header)
    damage = f"ends after {kept // per} of {header['set']['promised']} samples"
    if there >= count:
        damage = f"its {count * item} bytes are not followed by the closing -1"
    return values, late.end() if late else len(data), damage


def ascii_numbers(data, at, header):
    """(numbers, position behind the set, damage) of a 58 set: fixed columns, which need not be parted by blanks."""
    end = delimiter(data, at)
    damage = "" if end else "the set is not closed by -1"
    body = data[at : end.start if end else len(data)]
    position = end.end if end else len(data)
    if header["even"]:
        widths = [20] * 4 if header["double"] else [13] * 6
    elif header["double"]:
        widths = [13, 20, 20] if header["complex"] else [13, 20, 13, 20]
    else:
        widths = [13] * 6
    try:
        values = _numbers(body, widths)
    except ValueError as error:
        return np.empty(0), position, f"a number cannot be read ({error})"
    return values, position, damage


def _numbers(body, widths):
    """Numbers in lines of fixed columns; the last line may hold fewer, some exporters cut blanks off at the end."""
    width = sum(widths)
    lines = [line for line in body.replace(b"\r", b"").split(b"\n") if line and not line.isspace()]
    if not lines:
        return np.empty(0)
    last = lines.pop().ljust(width)
    block = b"".join([line[:width].ljust(width) for line in lines])
    block = block.replace(b"D", b"E") if b"D" in block else block
    if len(set(widths)) == 1:
        values = np.frombuffer(block, f"S{widths[0]}").astype(float)
    else:
        table = np.frombuffer(block, "S1").reshape(-1, width)
        columns = [np.ascontiguousarray(table[:, a:b]).view(f"S{b - a}") for a, b in _edges(widths)]
        values = np.hstack([c.astype(float) for c in columns]).ravel()
    rest = [float(last[a:b].replace(b"D", b"E")) for a, b in _edges(widths) if last[a:b].strip()]
    return np.concatenate([values, rest])


def _edges(widths):
    return list(pairwise(np.cumsum([0, *widths])))


def columns(values, header):
    """(ordinates, abscissae or None, damage) of a set's numbers."""
    per = _per_value(header)
    promised = header["set"]["promised"]
    n = min(len(values) // per, promised)
    damage = ""
    if len(values) < promised * per:
        damage = f"ends after {len(values) // per} of {promised} samples"
    elif len(values) > promised * per:
        damage = f"has {len(values) // per} samples where its header says {promised}"
    table = np.asarray(values[: n * per]).reshape(n, per)
    x = None if header["even"] else np.ascontiguousarray(table[:, 0], dtype=float)
    if header["complex"]:
        return table[:, -2] + 1j * table[:, -1], x, damage
    return np.ascontiguousarray(table[:, -1]), x, damage
