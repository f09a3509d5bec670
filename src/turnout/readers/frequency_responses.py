"""Frequency responses of a file instead of recordings: UFF58 function type 4, text with complex columns, npz."""

from __future__ import annotations

import re
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import ReadError
from turnout.readers.rate_units import hertz_of, rate_unit
from turnout.readers.source import GZIP_HEAD, Source, load
from turnout.readers.stated_units import is_meaningless, known_unit
from turnout.readers.uff import FREQUENCY_RESPONSE, TIME_RESPONSE, read_frf
from turnout.readers.uff_datasets import read_datasets

if TYPE_CHECKING:
    from collections.abc import Sequence

FREQUENCY_WORD = re.compile(r"freq|frek|fréq|\bhz\b|\bf\b", re.IGNORECASE)
FREQUENCY_NAMES = ("f", "freq", "freqs", "frequency", "frequencies", "frequenz", "frequence", "frekvens", "x")
REAL = re.compile(r"(?<![a-z])(real|realteil|reell|réel|reel|re)(?![a-z])", re.IGNORECASE)
IMAGINARY = re.compile(r"(?<![a-z])(imag\w*|imaginär\w*|im)(?![a-z])", re.IGNORECASE)
MAGNITUDE = re.compile(r"(?<![a-z])(mag|magn\w*|abs|ampl?\w*|betrag|module)(?![a-z])", re.IGNORECASE)
PHASE = re.compile(r"(?<![a-z])(phas\w*|angle|winkel)(?![a-z])", re.IGNORECASE)
IN_UNIT = re.compile(r"(?:freq|frek|fréq)\w*\s*(?:in\s+|[\[(])([^\])\s,;]+)", re.IGNORECASE)  # "frequency in kHz"
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
UNSIGNED = NUMBER.removeprefix("[+-]?")
COMPLEX = re.compile(
    rf"\(?\s*({NUMBER})\s*([+-])\s*({UNSIGNED})\s*\*?\s*[ij]\s*\)?|\(\s*({NUMBER})\s*,\s*({NUMBER})\s*\)"
)
SEPARATORS = ("\t", ";", ",", None)  # None: blanks
MAX_TEXT_SIZE = 2**27  # bytes: a longer text holds no frequency responses
MIN_LINES = 40  # frequencies
MAX_UNEVEN = 1e-3  # relative deviation of a frequency step


@dataclass(frozen=True)
class FrequencyResponses:
    """``frf`` (n_response, n_frequency) over ``frequency`` (n_frequency,) [Hz]; ``names`` and ``units`` of each."""

    frequency: np.ndarray
    frf: np.ndarray
    names: tuple[str, ...]
    units: tuple[str, ...]
    format: str


def find_responses(path: PathLike | str, root: PathLike | str) -> FrequencyResponses | None:
    """Frequency responses of a file that holds these and no recordings.

    Parameters
    ----------
    path, root : path-like
        As for ``turnout.readers.read``.

    Returns
    -------
    FrequencyResponses or None
        None for any other file: ``turnout.readers.read`` says what is wrong with it.

    Raises
    ------
    ReadError
        If the file cannot be opened, or its frequency responses are damaged or over different frequencies.
    """
    source = load(path, root)
    with source.parsed_by("the search for frequency responses"):
        return _find(source, path, root)


def _find(source: Source, path: PathLike | str, root: PathLike | str) -> FrequencyResponses | None:
    head = source.head
    if head.lstrip()[:2] == b"-1" or head.startswith(GZIP_HEAD):
        return _of_uff(source, path, root)
    if head[:4] == b"PK\x03\x04" and source.path.suffix.lower() == ".npz":
        return _of_npz(source)
    if source.size > MAX_TEXT_SIZE or b"\0" in head.replace(b"\0\0", b""):
        return None
    return _of_text(source)


def _of_uff(source: Source, path: PathLike | str, root: PathLike | str) -> FrequencyResponses | None:
    types = {
        s.func_type for s in read_datasets(source.unpacked_data()) if s.dataset_type in ("58", "58b") and not s.damage
    }
    if FREQUENCY_RESPONSE not in types or TIME_RESPONSE in types:
        return None
    responses = read_frf(path, root)
    names = tuple(f"{name} ({response} / {reference})" for name, response, reference in
                  zip(responses.names, responses.responses, responses.references))  # fmt: skip
    return FrequencyResponses(responses.frequency, responses.frf, names, responses.units, "uff58")


def check_evaluable(responses: FrequencyResponses, path: PathLike | str) -> None:
    """Check that modes can be identified from responses.

    Parameters
    ----------
    responses : FrequencyResponses
        Responses of one file.
    path : path-like
        The file, for the message.

    Raises
    ------
    ReadError
        If there are too few frequencies, they are not evenly spaced, or a response holds values that are not finite.
    """
    frequency, where = responses.frequency, "the frequency responses"
    if len(frequency) < MIN_LINES:
        problem = f"they have {len(frequency)} frequencies, {MIN_LINES} are needed"
        raise ReadError(path, where, problem, "Export more lines", "wrong_length")
    step = np.diff(frequency)
    if not np.isfinite(frequency).all() or not np.all(np.abs(step - np.median(step)) <= MAX_UNEVEN * np.median(step)):
        problem = f"their frequencies are not evenly spaced: the steps go from {step.min():.6g} to {step.max():.6g} Hz"
        raise ReadError(path, where, problem, "Export them with evenly spaced lines, all of them", "wrong_rate")
    if not np.isfinite(responses.frf).all():
        k, line = np.argwhere(~np.isfinite(responses.frf))[0]
        problem = f"{responses.names[k]!r} is no number at {frequency[line]:.6g} Hz"
        raise ReadError(path, where, problem, "Export them again without that line", "not_finite")


def _of_npz(source: Source) -> FrequencyResponses | None:
    """Responses of complex arrays beside a vector of frequencies."""
    with source.parsed_by("numpy"), np.load(source.path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    frequency = next((v for k, v in arrays.items() if k.casefold() in FREQUENCY_NAMES and v.ndim == 1), None)
    rows: list[np.ndarray] = []
    names: list[str] = []
    for name, array in arrays.items():
        if frequency is None or array.dtype.kind != "c" or len(frequency) not in array.shape:
            continue
        moved = np.moveaxis(array, array.shape.index(len(frequency)), -1).reshape(-1, len(frequency))
        rows += list(moved)
        names += [name] if len(moved) == 1 else [f"{name}[{k}]" for k in range(len(moved))]
    if frequency is None or not rows:
        return None
    units = str(arrays["units"]) if "units" in arrays and arrays["units"].ndim == 0 else ""
    return FrequencyResponses(frequency.astype(float), np.array(rows), tuple(names), (units,) * len(rows), "npz")


def _of_text(source: Source) -> FrequencyResponses | None:
    """Responses of a text: a column of frequencies, then complex numbers or pairs of columns."""
    head = _text_of(source.head)
    pairs = (IMAGINARY, REAL), (PHASE, MAGNITUDE)
    if not (FREQUENCY_WORD.search(head) and (COMPLEX.search(head) or any(a.search(head) for a, _ in pairs))):
        return None
    lines = [line for line in _text_of(source.data).splitlines() if line.strip()]
    for separator in SEPARATORS:
        table = _table(lines, separator)
        if table is not None:
            return _responses_of_table(*table, source)
    return None


def _text_of(data: bytes) -> str:
    for encoding in ("utf-8-sig", "cp1252", "latin-1"):
        try:
            return data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else encoding)
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1", "replace")


def _table(lines: Sequence[str], separator: str | None) -> tuple[list[str], list[str], np.ndarray] | None:
    """(lines above the table, its title cells, numbers (n_row, n_column) complex) of a text, None without a table."""
    rows: list[list[complex]] = []
    first = 0
    for i, line in enumerate(lines):
        numbers = [_number(cell, separator) for cell in line.strip().split(separator) if cell.strip()]
        is_row = len(numbers) >= 2 and None not in numbers
        if is_row and not rows:
            first = i
        if is_row and (not rows or len(numbers) == len(rows[0])):
            rows.append([number for number in numbers if number is not None])
        elif rows and len(rows) < MIN_LINES:
            rows = []
        elif rows:
            break
    if len(rows) < MIN_LINES or not np.all(np.diff(np.array([row[0].real for row in rows])) > 0.0):
        return None
    above = list(lines[:first])
    cells_above = [[c.strip().strip('"') for c in line.strip().split(separator) if c.strip()] for line in above[-3:]]
    cells_above = [cells for cells in cells_above if len(cells) == len(rows[0])]
    titles = next((cells for cells in reversed(cells_above) if FREQUENCY_WORD.search(cells[0])), [])
    titles = titles or next(reversed(cells_above), [])
    units = cells_above[-1] if cells_above and hertz_of(cells_above[-1][0]) else []
    if units and titles is units and len(cells_above) > 1:
        titles = cells_above[-2]
    if units and titles is not units:  # a line of units below that of the titles
        titles = [f"{title} [{unit.strip('[]() ')}]" for title, unit in zip(titles, units)]
    return above, titles, np.array(rows, dtype=complex)


def _number(cell: str, separator: str | None) -> complex | None:
    """A cell as a complex number, None if it is none."""
    text = cell.strip().strip('"')
    if separator != ",":
        text = re.sub(r"(?<=\d),(?=\d)", ".", text)
    match = COMPLEX.fullmatch(text)
    if match:
        if match[4] is not None:
            return complex(float(match[4]), float(match[5]))
        return complex(float(match[1]), float(match[2] + match[3]))
    try:
        return complex(float(text))
    except ValueError:
        return None


def _responses_of_table(
    above: Sequence[str], titles: Sequence[str], numbers: np.ndarray, source: Source
) -> FrequencyResponses | None:
    """Responses of a table of text by its title cells, or by the lines above it where the columns have no titles."""
    n_column = numbers.shape[1]
    if titles and not FREQUENCY_WORD.search(titles[0]):
        return None
    names = list(titles) or [""] * n_column
    words = " ".join(above)
    scale = _hertz_per_number(titles[0] if titles else "".join(IN_UNIT.findall(words)[:1]), source)
    rows: list[np.ndarray] = []
    used: list[str] = []
    k = 1
    while k < n_column:
        pair = " ".join(names[k : k + 2]) if titles else words
        column, following = numbers[:, k], numbers[:, k + 1] if k + 1 < n_column else None
        if np.any(column.imag):
            rows.append(column)
            k += 1
        elif following is not None and (real := REAL.search(pair)) and (imaginary := IMAGINARY.search(pair)):
            columns = (column, following) if real.start() < imaginary.start() else (following, column)
            rows.append(columns[0].real + 1j * columns[1].real)
            k += 2
        elif following is not None and (phase := PHASE.search(pair)) and (magnitude := MAGNITUDE.search(pair)):
            columns = (column, following) if magnitude.start() < phase.start() else (following, column)
            rows.append(_magnitude(columns[0].real, pair) * np.exp(1j * _phase(columns[1].real, pair)))
            k += 2
        else:
            k += 1
            continue
        used.append(names[k - 1] if np.any(column.imag) else names[k - 2])
    if not rows:
        return None
    labels = tuple(name or f"response {i + 1}" for i, name in enumerate(used))
    frequency = scale * numbers[:, 0].real
    return FrequencyResponses(frequency, np.array(rows), labels, tuple(map(_unit, labels)), "csv")


def _hertz_per_number(title: str, source: Source) -> float:
    """Hertz of one unit of the column of frequencies, by its title: in brackets or its last word; else 1.

    A word in round brackets may be a remark, as in "Frequency (FFT)", unless it is another unit.
    """
    in_brackets = re.findall(r"[\[(]([^\])]*)[\])]", title)
    in_brackets = [text for text in in_brackets if not is_meaningless(text)]
    last_word = re.split(r"[\s_,]+", title.strip())[-1]
    scale = next((s for text in (*in_brackets, last_word) if (s := hertz_of(text)) is not None), None)
    other_units = [text for text in in_brackets if f"[{text}]" in title or rate_unit(text) or known_unit(text)]
    if scale is None and other_units:
        unit = other_units[-1]
        problem = f"the title of the frequencies is {title[:60]!r}, and {unit[:20]!r} is no unit of a frequency"
        remedy = "Export frequency responses with their frequencies in Hz, kHz, rad/s or rpm"
        raise source.error("the line of titles", problem, remedy, reason="wrong_rate")
    return 1.0 if scale is None else scale


def _magnitude(values: np.ndarray, title: str) -> np.ndarray:
    return 10.0 ** (values / 20.0) if re.search(r"\bdb\b", title, re.IGNORECASE) else values


def _phase(values: np.ndarray, title: str) -> np.ndarray:
    """Phase in radians; without a unit, numbers over more than two turns of a radian are degrees."""
    is_degree = bool(re.search(r"deg|°|grad", title, re.IGNORECASE))
    if not is_degree and not re.search(r"(?<![a-z])rad", title, re.IGNORECASE):
        is_degree = np.ptp(values) > 4.0 * np.pi
    return np.radians(values) if is_degree else values


def _unit(title: str) -> str:
    """Unit in brackets in a title, "" without one."""
    units = re.findall(r"[\[(]([^\])]*/\s*k?N)[\])]", title)
    return units[0] if units else ""
