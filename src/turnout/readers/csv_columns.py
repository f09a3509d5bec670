"""Columns of a text file: their names and units above the numbers, and which of them is the time."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from turnout.readers.metadata_names import TIME_NAMES
from turnout.readers.rate_units import rate_unit
from turnout.readers.source import MEANINGLESS_UNITS, Source
from turnout.readers.stated_units import SENSITIVITY_IN_NAME
from turnout.readers.time_numbers import SINCE
from turnout.units import conversion

TIME_WORDS = (*TIME_NAMES, "timestamp", "zeit", "zeitstempel", "tid", "temps", "horodatage", "tempo", "tiempo", "tijd")
# Units that say alone that a column is the time. "min" and "d" may be a minimum and a distance.
UNITS_OF_TIME_ALONE = ("", "s", "sec", "ms", "µs", "us", "ns")


def time_column(names: Sequence[str], units: Sequence[str]) -> int | None:
    """Number of the time column: by its name and unit, else by one of them.

    No sensor measures in seconds, so a unit of time identifies the column in any language. A column in the unit of
    another quantity is no time under any name, and "T" without a unit only if nothing else is.

    Parameters
    ----------
    names : sequence of str
        Names of the columns.
    units : sequence of str
        Unit of each column, "" if not stated.

    Returns
    -------
    int or None
        Number of the column, from 0; None without one.

    Examples
    --------
    >>> time_column(["Kraft", "Zeit"], ["N", "s"]), time_column(["idő", "erő"], ["ms", "N"])
    (1, 0)
    >>> time_column(["T", "t", "force"], ["°C", "s", "N"]), time_column(["T", "force"], ["°C", "N"])
    (1, None)
    """
    by_unit = [i for i, unit in enumerate(units) if unit.strip() and _plain_unit(unit) in UNITS_OF_TIME_ALONE]
    is_named = [name.strip().lower() in TIME_WORDS for name in names]
    by_name = [i for i, unit in enumerate(units) if is_named[i] and not _is_of_other_quantity(names[i], unit)]
    sure = [i for i in by_name if names[i].strip() != "T"]
    return next(iter([*(i for i in by_unit if is_named[i]), *sure, *by_unit, *by_name]), None)


def _is_of_other_quantity(name: str, unit: str) -> bool:
    """Whether a column has a unit of another quantity than time; under the name "T" any that is none of time."""
    time_unit = rate_unit(unit)
    if unit.strip().casefold() in MEANINGLESS_UNITS or (time_unit is not None and time_unit.is_step):
        return False
    try:
        return bool(conversion(unit))
    except ValueError:
        return name.strip() == "T"


def seconds_per_number(unit: str, source: Source) -> float:
    """Seconds per number in the time column.

    Parameters
    ----------
    unit : str
        Unit of the time column as it is written, such as "ms", "Sekunden" or "min"; "" means seconds.
    source : Source
        The text file.

    Returns
    -------
    float
        Factor that converts its numbers to seconds. [s]

    Raises
    ------
    ReadError
        For an unknown unit of time.
    """
    if not unit.strip():
        return 1.0
    since = SINCE.search(unit)
    time_unit = rate_unit(since[1] if since else unit)
    if time_unit is None or not time_unit.is_step:
        remedy = "Export the time in s, ms, µs, ns, min, h or d, or as the time of day with seconds"
        raise source.error("the time column", f"its unit {unit!r} is not known", remedy, reason="unit_unknown")
    return float(time_unit.scale)


def _plain_unit(unit: str) -> str:
    return unit.strip().replace("\u03bc", "µ")


NAME_WITH_UNIT = re.compile(r"^(.*?)\s*[\[(]([^\[\]]*)[\])]$")
BRACKETS = re.compile(r"\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\))\s*")


def name_and_unit(cell: str) -> tuple[str, str]:
    """Name and unit of a column: the unit is the known one in brackets, else what brackets at the end hold.

    Brackets at the end are no part of the name, nor is a slash before them, which stands for a division.

    Parameters
    ----------
    cell : str
        Name of a column as it is written.

    Returns
    -------
    tuple of (str, str)
        "" as unit if none is stated.

    Examples
    --------
    >>> name_and_unit("force [kN]"), name_and_unit("a/(m/s²)"), name_and_unit("Force [N] (ch 1)")
    (('force', 'kN'), ('a', 'm/s²'), ('Force [N] (ch 1)', 'N'))
    """
    sensitivity = SENSITIVITY_IN_NAME.search(cell)
    for match in reversed([*BRACKETS.finditer(cell)]):
        if sensitivity and sensitivity.start() < match.start() < sensitivity.end():  # of "10 mV/(m/s²)"
            return cell, ""
        unit = next(text for text in match.groups() if text is not None).strip()
        if _is_known(unit):
            return cell[: match.start()].rstrip("/ ") if match.end() == len(cell) else cell, unit
    match_at_end = NAME_WITH_UNIT.match(cell)
    return (match_at_end[1], match_at_end[2]) if match_at_end else (cell, "")


def _is_known(unit: str) -> bool:
    """Whether a unit is known: of a sensor, or of time."""
    try:
        return bool(conversion(unit))
    except ValueError:
        time_unit = rate_unit(unit)
        return time_unit is not None and time_unit.is_step


def names_among(lines: Sequence[Sequence[str]]) -> tuple[int, int | None]:
    """Find the line of names and the line of units among the lines above the numbers.

    The names are in the line above the units. In the last line, and directly below names of which one is a time, half
    of the cells have to be units; in others all. Without a line of units they are in the last line that names a time or
    has units in brackets, because comments may follow. Else they are in the last line.

    Parameters
    ----------
    lines : sequence of sequence of str
        Cells of each line, one per column.

    Returns
    -------
    tuple of (int, int or None)
        Number of the line of names and of that of the units, from 0; None without a line of units.

    Examples
    --------
    >>> names_among([["Messung", "Gleis 3"], ["Zeit", "Kraft"], ["s", "kN"], ["Uhr", "Hammer"]])
    (1, 2)
    >>> names_among([["Messung", "Gleis 3"], ["Rail", "Kraft"]])
    (1, None)
    """
    last = len(lines) - 1
    for i in range(last, 0, -1):
        if _are_units(lines[i], 0.5 if i == last or are_names(lines[i - 1]) else 1.0):
            return i - 1, i
    return next((i for i in range(last, -1, -1) if are_names(lines[i])), last), None


def _are_units(cells: Sequence[str], share: float) -> bool:
    """Whether at least this share of the filled cells are units."""
    filled_cells = [cell for cell in cells if cell]
    return sum(map(_is_unit, filled_cells)) >= share * len(filled_cells)


def _is_unit(cell: str) -> bool:
    """Whether a cell is a known unit, a meaningless one, or anything in brackets; "12 m" is a length."""
    bare = cell.strip("[]() ")
    if cell[0] in "[(" or bare.casefold() in MEANINGLESS_UNITS or bare.replace("\u03bc", "µ") in UNITS_OF_TIME_ALONE:
        return True
    try:
        return not bare[0].isdigit() and bool(conversion(bare))
    except ValueError:
        return False


def are_names(cells: Sequence[str]) -> bool:
    """Whether a cell names the time or has a unit in brackets; not if any cell starts with a digit, as in "08:30".

    Parameters
    ----------
    cells : sequence of str
        Cells of a line above the numbers.

    Returns
    -------
    bool
        True for names of columns.

    Examples
    --------
    >>> are_names(["time", "force"]), are_names(["Force [N]", "x"]), are_names(["Messung", "Gleis 3"])
    (True, True, False)
    """
    if any(cell[:1].isdigit() for cell in cells):
        return False
    in_brackets = [unit for name, unit in map(name_and_unit, cells) if name]
    return any(cell.lower() in TIME_WORDS for cell in cells) or any(unit and _is_unit(unit) for unit in in_brackets)


COMMENT = re.compile(r"comm?ent|komment|remar[kq]|bemerk|notes?$|anmerk|osserv|opmerk|event|ereign|mark", re.IGNORECASE)


class Columns(NamedTuple):
    """Names and units of the columns, and the ``further`` names beside them for which the rows have no cells."""

    names: list[str]
    units: list[str]
    further: list[str]


def _holds_unit(text: str) -> bool:
    return not text.isdigit() and any(_is_known(word) for word in text.split())


def _distinguished_by_brackets(pairs: Sequence[tuple[str, str]]) -> set[str]:
    """Names that several columns share, with different texts in brackets that are no units: "Y[0]", "acc (left)"."""
    texts: dict[str, list[str]] = {}
    for bare, text in pairs:
        texts.setdefault(bare, []).append(text)
    return {n for n, t in texts.items() if len(set(t)) == len(t) > 1 and not any(map(_holds_unit, t)) and all(t)}


def names_and_units(lines: list[list[str]], cells: list[str]) -> Columns:
    """Names and units of the columns. A separator after the last number, as in "1;2;", makes a column without a name.

    Parameters
    ----------
    lines : list of list of str
        Cells of the lines above the numbers.
    cells : list of str
        Cells of the first row.

    Returns
    -------
    Columns
        Names, "0", "1" ... if no line has them, and units, "" if not stated; further names that are none of a comment.
    """
    count, open_end = len(cells), not cells[-1]
    whole_lines = [line for line in lines if any(line) and len(line) >= count - open_end]
    lines = [(line + [""] * open_end)[:count] for line in whole_lines]
    if not lines:
        names = [str(i) for i in range(count)]
        return Columns([*names[:-1], ""] if open_end and count > 1 else names, [""] * count, [])
    name_line, unit_line = names_among(lines)
    names = lines[name_line]
    further = [cell for cell in whole_lines[name_line][count:] if cell and not COMMENT.match(cell)]
    units = [""] * count if unit_line is None else [cell.strip("[]() ") for cell in lines[unit_line]]
    pairs = [name_and_unit(name) for name in names]
    told_apart = _distinguished_by_brackets(pairs)
    for i, (name, (bare, unit)) in enumerate(zip(names, pairs)):
        if bare in told_apart:
            continue
        names[i], units[i] = bare, unit if unit or bare != name else units[i]
    return Columns(names, units, further)
