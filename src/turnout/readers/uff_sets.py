"""Data sets 58 and 58b of a Universal File: where each one begins and ends, its header, its numbers.

The file is walked set by set. A binary set (58b) is stepped over by its own byte count, so that bytes inside it which
look like the delimiter, or like an end of line, cannot part it. Every set says what is wrong with it (``damage``)
instead of coming back shorter than its header promises.

Layout: Structural Dynamics Research Laboratory, University of Cincinnati, Universal File Dataset 58.
"""

from dataclasses import dataclass, field
from itertools import pairwise
from mmap import mmap

import numpy as np

from turnout.readers.uff_numbers import ascii_numbers, binary_numbers, columns, delimiter

HEADER_LINES = 12  # from the set's number to record 11


@dataclass(frozen=True)
class UffSet:
    """One function at nodal degree of freedom. ``damage`` is empty for a sound set.

    ``func_type`` 1 is a time response, 4 a frequency response; ``data`` are the ordinates (float or complex),
    ``x`` the abscissae where they are stored, else None: ``start`` + k ``step``. ``promised`` is the number of
    values in the header, ``step_text`` the step as printed, ``sequence`` the version or sequence number.
    """

    offset: int
    kind: str
    ids: tuple[str, ...] = ()
    func_type: int = 0
    sequence: int = 0
    response: tuple[str, int, int] = ("", 0, 0)
    reference: tuple[str, int, int] = ("", 0, 0)
    promised: int = 0
    start: float = 0.0
    step: float = 0.0
    step_text: str = ""
    labels: tuple[tuple[int, str, str], ...] = ()
    data: np.ndarray = field(default_factory=lambda: np.empty(0))
    x: np.ndarray | None = None
    damage: str = ""


def sets_of(data: bytes | mmap) -> tuple[UffSet, ...]:
    """All data sets of a file, read or mapped, in their order; of other numbers ``kind`` and ``offset`` alone."""
    found = []
    position = 0
    while (begin := delimiter(data, position)) is not None:
        if len(data) - begin.end < 200 and not data[begin.end :].strip():
            found.append(UffSet(begin.start, "", damage="a delimiter opens a set that never comes"))
            break
        # an unclosed set has taken the opening of the next one for its end
        if data[begin.end : begin.end + 6] == b"    -1":
            found.append(UffSet(begin.start, "", damage="a delimiter closes a set that was never opened"))
            position = begin.end
            continue
        one, position = _one_set(data, begin)
        found.append(one)
    if not found:
        return (UffSet(0, "", damage="there is no delimiter (-1 in columns 5 and 6)"),)
    return tuple(found)


def says_si(data: bytes, sets) -> bool:
    """True where dataset 164 declares SI: unit code 1, or factors of 1 from the file's units to SI."""
    for one in sets:
        if one.kind == "164":
            lines, _ = _lines(data, data.find(b"\n", one.offset) + 1, 3)
            factors = _fields(lines[2].replace("D", "E"), [25, 25]) if len(lines) == 3 else ["nan"]
            try:
                return int(lines[1][:10]) == 1 or all(float(f) == 1.0 for f in factors)
            except ValueError:
                return False
    return False


def _one_set(data, begin):
    """(set, position after its closing delimiter)."""
    start = begin.end
    lines, at = _lines(data, start, HEADER_LINES)
    kind = lines[0][:7].strip().lower() if lines else ""
    if kind not in ("58", "58b"):
        end = delimiter(data, start)
        damage = "" if end else "the set is not closed by -1"
        if not kind.removesuffix("b").isdigit():
            kind, damage = "", f"{kind!r} is no number of a data set"
        return UffSet(begin.start, kind, damage=damage), end.end if end else len(data)
    try:
        if len(lines) < HEADER_LINES:
            raise ValueError(f"its header ends after {len(lines)} of {HEADER_LINES} lines")
        header = _header(lines)
    except ValueError as error:
        end = delimiter(data, start)
        return UffSet(begin.start, kind, damage=f"the header cannot be read ({error})"), end.end if end else len(data)
    read = binary_numbers if kind == "58b" else ascii_numbers
    values, position, damage = read(data, at, header)
    ordinates, x, short = columns(values, header)
    one = UffSet(begin.start, kind, data=ordinates, x=x, damage=damage or short, **header["set"])
    return one, position


def _lines(data, position, count):
    """(lines, position behind them) without building a list of all lines of a large file."""
    lines: list[str] = []
    while len(lines) < count and position < len(data):
        end = data.find(b"\n", position)
        if end < 0:
            break
        raw = data[position:end].rstrip(b"\r")
        lines.append(_text(raw))
        position = end + 1
    return lines, position


def _text(raw):
    """Header text: UTF-8 where it is valid, Latin-1 (older exporters' "m/s²") where not."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _fields(line, widths):
    """Fixed columns of one line, blanks cut off."""
    edges = np.cumsum([0, *widths])
    line = line.ljust(80)
    return [line[a:b].strip() for a, b in pairwise(edges)]


def _whole(text):
    return int(text) if text else 0


def _header(lines):
    """Records 1 to 11; ValueError where a number is none."""
    first = _fields(lines[0], [6, 1, 6, 6])
    dof = _fields(lines[6], [5, 10, 5, 10, 11, 10, 4, 11, 10, 4])
    form = _fields(lines[7], [10, 10, 10, 13, 13, 13])
    axes = [_fields(line, [10, 5, 5, 5, 21, 21]) for line in lines[8:12]]
    ordinate_type, promised, even = int(form[0]), int(form[1]), int(form[2])
    if ordinate_type not in (2, 4, 5, 6):
        raise ValueError(f"ordinate data type {ordinate_type} is none of 2, 4, 5, 6")
    if promised < 0:
        raise ValueError(f"it promises {promised} values")
    return {
        "set": {
            "ids": tuple(line.strip() for line in lines[1:6]),
            "func_type": int(dof[0]),
            "sequence": _whole(dof[2]),
            "response": (dof[4], _whole(dof[5]), _whole(dof[6])),
            "reference": (dof[7], _whole(dof[8]), _whole(dof[9])),
            "promised": promised,
            "start": float(form[3] or 0),
            "step": float(form[4] or 0),
            "step_text": form[4],
            "labels": tuple((_whole(a[0]), a[4], a[5]) for a in axes),
        },
        "double": ordinate_type in (4, 6),
        "complex": ordinate_type in (5, 6),
        "even": even == 1,
        "byte_order": ">" if first[2] == "2" else "<",
        "float_format": _whole(first[3]),
    }
