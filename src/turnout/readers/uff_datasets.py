"""Parser of data sets 58 and 58b of a Universal File: delimiters, headers and numbers.

The numbers are fixed columns of text (58) or binary (58b). A binary set is skipped by its byte count, so that bytes
that look like a delimiter or a line break cannot split it. A damaged set has an explanation (``damage``).

Layout: Structural Dynamics Research Laboratory, University of Cincinnati, Universal File Dataset 58.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import accumulate, pairwise
from mmap import mmap
from typing import Any

import numpy as np

from turnout.readers.lazy import Column

Header = dict[str, Any]  # fields of records 1 to 11; those of a ``UffDataset`` are below "set"
END_58B = re.compile(rb"\r?\n? {4}-1 *(?:\r?\n|\r|$)")
REST_OF_LINE = re.compile(rb" *(?:\r?\n|\r|$)")


@dataclass(frozen=True)
class Delimiter:
    """A line with -1 in columns 5 and 6, then blanks: ``start`` of the line, ``end`` after its line break."""

    start: int
    end: int


def find_delimiter(data: bytes | mmap, position: int) -> Delimiter | None:
    """The first delimiter from ``position`` on; plain search, because a regular expression is slow on large files.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    position : int
        Byte from which to search.

    Returns
    -------
    Delimiter or None
        The delimiter; None if there is no further one.
    """
    start = position
    while (start := data.find(b"    -1", start)) >= 0:
        line_end = REST_OF_LINE.match(data, start + 6)
        if line_end and (start == 0 or data[start - 1] in b"\r\n"):
            return Delimiter(start, line_end.end())
        start += 1
    return None


def _numbers_per_value(header: Header) -> int:
    """Numbers stored for each value."""
    return (2 if header["complex"] else 1) + (0 if header["even"] else 1)


def binary_numbers(data: bytes | mmap, at: int, header: Header) -> tuple[np.ndarray, int, str]:
    """Numbers of a 58b set.

    If header and closing delimiter disagree, the delimiter counts: some exporters write 0 as byte count, and some
    declare single precision and write double.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    at : int
        Byte at which the numbers begin.
    header : dict
        Fields of the header, as ``read_datasets`` reads them.

    Returns
    -------
    tuple of (array, int, str)
        Numbers as they are stored; byte after the set; explanation of the damage, "" for an intact set.
    """
    if header["float_format"] not in (0, 2):
        closing_delimiter = find_delimiter(data, at)
        position = closing_delimiter.end if closing_delimiter else len(data)
        return np.empty(0), position, f"floating-point format {header['float_format']} is not IEEE 754 (2)"
    count = header["set"]["promised"] * _numbers_per_value(header)
    sizes = {"d" if header["double"] else "f": count * (8 if header["double"] else 4), "d": count * 8}
    for letter, size in sizes.items():
        if (closing_match := END_58B.match(data, at + size)) is not None:
            return np.frombuffer(data, header["byte_order"] + letter, count, at), closing_match.end(), ""
    item = 8 if header["double"] else 4
    closing = END_58B.search(data, at)
    stop = closing.start() if closing else len(data)
    n_stored = (stop - at) // item
    n_read = min(n_stored, count)
    values = np.frombuffer(data, f"{header['byte_order']}f{item}", n_read, at)
    per_value = _numbers_per_value(header)
    damage = f"ends after {n_read // per_value} of {header['set']['promised']} samples"
    if n_stored >= count:
        damage = f"its {count * item} bytes are not followed by the closing -1"
    return values, closing.end() if closing else len(data), damage


def ascii_numbers(data: bytes | mmap, at: int, header: Header) -> tuple[np.ndarray, int, str]:
    """Numbers of a 58 set: fixed columns, not always separated by blanks.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    at : int
        Byte at which the numbers begin.
    header : dict
        Fields of the header, as ``read_datasets`` reads them.

    Returns
    -------
    tuple of (array, int, str)
        Numbers as they are stored; byte after the set; explanation of the damage, "" for an intact set.
    """
    closing_delimiter = find_delimiter(data, at)
    damage = "" if closing_delimiter else "the set is not closed by -1"
    body = data[at : closing_delimiter.start if closing_delimiter else len(data)]
    position = closing_delimiter.end if closing_delimiter else len(data)
    if header["even"]:
        widths = [20] * 4 if header["double"] else [13] * 6
    elif header["double"]:
        widths = [13, 20, 20] if header["complex"] else [13, 20, 13, 20]
    else:
        widths = [13] * 6
    try:
        values = _numbers(body, widths)
    except ValueError as error:
        return np.empty(0), position, f"a number cannot be read ({_reason_of(error)})"
    return values, position, damage


TEXT_IN_PLACE = re.compile(r".*(?:float|base 10): (?:np\.bytes_\()?b?(['\"])(.*?)\1\)?", re.DOTALL)


def _reason_of(error: ValueError) -> str:
    """What a conversion of text to a number reports, without the words of Python."""
    match = TEXT_IN_PLACE.fullmatch(str(error))
    return str(error) if match is None else f"'{match[2].strip()}' is no number" if match[2].strip() else "it is blank"


def _numbers(body: bytes, widths: Sequence[int]) -> np.ndarray:
    """Numbers in lines of fixed columns; the last line may be shorter, and exporters may strip blanks at its end."""
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
        columns = [np.ascontiguousarray(table[:, a:b]).view(f"S{b - a}") for a, b in _edges(tuple(widths))]
        values = np.hstack([c.astype(float) for c in columns]).ravel()
    last_values = [float(last[a:b].replace(b"D", b"E")) for a, b in _edges(tuple(widths)) if last[a:b].strip()]
    return np.concatenate([values, last_values])


@lru_cache
def _edges(widths: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    """First character of each column, and that behind its last one."""
    return tuple(pairwise(accumulate(widths, initial=0)))


def split_columns(values: np.ndarray, header: Header) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Ordinates and abscissae from the numbers of a set.

    Parameters
    ----------
    values : (n,) array of float
        Numbers as they are stored.
    header : dict
        Fields of the header, as ``read_datasets`` reads them.

    Returns
    -------
    tuple of (array, array or None, str)
        Ordinates, float or complex; abscissae, None if they are even; explanation if their number is not that of the
        header.
    """
    per_value = _numbers_per_value(header)
    promised = header["set"]["promised"]
    n = min(len(values) // per_value, promised)
    damage = ""
    if len(values) < promised * per_value:
        damage = f"ends after {len(values) // per_value} of {promised} samples"
    elif len(values) > promised * per_value:
        damage = f"has {len(values) // per_value} samples where its header says {promised}"
    table = np.asarray(values[: n * per_value]).reshape(n, per_value)
    x = None if header["even"] else np.ascontiguousarray(table[:, 0], dtype=float)
    if header["complex"]:
        return table[:, -2] + 1j * table[:, -1], x, damage
    return np.ascontiguousarray(table[:, -1]), x, damage


HEADER_LINES = 12  # from the set's number to record 11


@dataclass(frozen=True)
class UffDataset:
    """One function at nodal degree of freedom. ``damage`` is empty for an intact set.

    ``func_type`` 1 is a time response, 4 a frequency response; ``data`` are the ordinates (float or complex),
    ``x`` the abscissae if they are stored, else None: then they are ``start`` + k ``step``. ``promised`` is the number
    of values in the header, ``step_text`` the step as printed, ``sequence`` the version or sequence number.
    """

    offset: int
    dataset_type: str
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
    data: Column = field(default_factory=lambda: np.empty(0))
    x: np.ndarray | None = None
    damage: str = ""


def read_datasets(data: bytes | mmap) -> tuple[UffDataset, ...]:
    """All data sets of a Universal File.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.

    Returns
    -------
    tuple of UffDataset
        All data sets in their order; sets of other types have only ``dataset_type`` and ``offset``.
    """
    datasets = []
    position = 0
    while (begin := find_delimiter(data, position)) is not None:
        if len(data) - begin.end < 200 and not data[begin.end :].strip():
            datasets.append(UffDataset(begin.start, "", damage="a delimiter opens a set that never comes"))
            break
        # the opening delimiter of this set was used as the end of an unclosed set before it
        if data[begin.end : begin.end + 6] == b"    -1":
            datasets.append(UffDataset(begin.start, "", damage="a delimiter closes a set that was never opened"))
            position = begin.end
            continue
        dataset, position = _read_dataset(data, begin)
        datasets.append(dataset)
    if not datasets:
        return (UffDataset(0, "", damage="there is no delimiter (-1 in columns 5 and 6)"),)
    return tuple(datasets)


@dataclass(frozen=True)
class FileUnits:
    """Units of a file that dataset 164 states: metres and newtons per unit of length and of force."""

    length: float
    force: float


def file_units(data: bytes | mmap, sets: Iterable[UffDataset]) -> FileUnits | None:
    """Units that dataset 164 states: unit code 1 is SI, else by the factors, by which numbers are divided to become SI.

    Parameters
    ----------
    data : bytes
        Bytes of the file.
    sets : iterable of UffDataset
        All data sets of the file.

    Returns
    -------
    FileUnits or None
        None without a dataset 164, or with one that cannot be read.
    """
    for dataset in sets:
        if dataset.dataset_type == "164":
            lines, _ = _lines(data, data.find(b"\n", dataset.offset) + 1, 3)
            try:
                if int(lines[1][:10]) == 1:
                    return FileUnits(1.0, 1.0)
                length, force = map(_number, lines[2].split()[:2])
            except (ValueError, IndexError):
                return None
            is_usable = np.isfinite([length, force]).all() and length > 0.0 and force > 0.0
            return FileUnits(1.0 / length, 1.0 / force) if is_usable else None
    return None


def _read_dataset(data: bytes | mmap, begin: Delimiter) -> tuple[UffDataset, int]:
    """(set, position after its closing delimiter)."""
    start = begin.end
    lines, at = _lines(data, start, HEADER_LINES)
    dataset_type = lines[0][:7].strip().lower() if lines else ""
    if dataset_type not in ("58", "58b"):
        closing_delimiter = find_delimiter(data, start)
        damage = "" if closing_delimiter else "the set is not closed by -1"
        if not dataset_type.removesuffix("b").isdigit():
            dataset_type, damage = "", f"{dataset_type!r} is no number of a data set"
        return UffDataset(
            begin.start, dataset_type, damage=damage
        ), closing_delimiter.end if closing_delimiter else len(data)
    try:
        if len(lines) < HEADER_LINES:
            raise ValueError(f"its header ends after {len(lines)} of {HEADER_LINES} lines")
        header = _header(lines)
    except ValueError as error:
        closing_delimiter = find_delimiter(data, start)
        return UffDataset(
            begin.start, dataset_type, damage=f"the header cannot be read ({_reason_of(error)})"
        ), closing_delimiter.end if closing_delimiter else len(data)
    read_numbers = binary_numbers if dataset_type == "58b" else ascii_numbers
    values, position, damage = read_numbers(data, at, header)
    ordinates, x, length_damage = split_columns(values, header)
    dataset = UffDataset(
        begin.start, dataset_type, data=ordinates, x=x, damage=damage or length_damage, **header["set"]
    )
    return dataset, position


def _lines(data: bytes | mmap, position: int, count: int) -> tuple[list[str], int]:
    """(lines, position after them), without splitting the whole of a large file."""
    lines: list[str] = []
    while len(lines) < count and position < len(data):
        end = data.find(b"\n", position)
        if end < 0:
            break
        raw = data[position:end].rstrip(b"\r")
        lines.append(_decode_text(raw))
        position = end + 1
    return lines, position


def _decode_text(raw: bytes) -> str:
    """Header text: UTF-8 if valid, else Latin-1 (older exporters' "m/s²")."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _fields(line: str, widths: Sequence[int]) -> list[str]:
    """Fixed columns of one line, stripped."""
    line = line.ljust(80)
    return [line[a:b].strip() for a, b in _edges(tuple(widths))]


def _integer(text: str) -> int:
    return int(text) if text else 0


def _number(text: str) -> float:
    """A number whose exponent may be that of Fortran, "5.0D-05"; 0 for an empty field."""
    return float(text.replace("D", "E").replace("d", "e") or 0)


def _header(lines: Sequence[str]) -> Header:
    """Fields of records 1 to 11; ValueError for an invalid number."""
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
            "sequence": _integer(dof[2]),
            "response": (dof[4], _integer(dof[5]), _integer(dof[6])),
            "reference": (dof[7], _integer(dof[8]), _integer(dof[9])),
            "promised": promised,
            "start": _number(form[3]),
            "step": _number(form[4]),
            "step_text": form[4].upper().replace("D", "E"),
            "labels": tuple((_integer(a[0]), a[4], a[5]) for a in axes),
        },
        "double": ordinate_type in (4, 6),
        "complex": ordinate_type in (5, 6),
        "even": even == 1,
        "byte_order": ">" if first[2] == "2" else "<",
        "float_format": _integer(first[3]),
    }
