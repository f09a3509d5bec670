"""Columns of a text file: their names and units above the numbers, and which of them is the time."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from turnout.readers.attached_units import (
    TIME_WORDS,
    UNITS_OF_TIME_ALONE,
    have_most_a_unit,
    is_known,
    name_and_unit,
    names_and_units_in,
    unit_behind_mark,
)
from turnout.readers.clock_texts import is_clock_or_date
from turnout.readers.csv_cells import is_number, is_word
from turnout.readers.rate_units import rate_unit
from turnout.readers.source import MEANINGLESS_UNITS, Source
from turnout.readers.stated_units import known_unit, same_unit
from turnout.readers.texts import readings_together
from turnout.readers.time_numbers import SINCE
from turnout.readers.unit_names import is_unit_name, is_unit_of_other
from turnout.unit_spellings import BRACKETS_IN_ASCII, without_brackets
from turnout.units import conversion, in_latin


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
    by_unit = [i for i, unit in enumerate(units) if unit.strip() and _is_unit_of_time_alone(unit)]
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


def _is_unit_of_time_alone(unit: str) -> bool:
    """Whether a unit says alone that a column is the time: a symbol, or a word that is no abbreviation."""
    plain, of_rate = _plain_unit(unit), rate_unit(unit)
    is_word = len(plain) > MAX_ABBREVIATION_SIZE and of_rate is not None and of_rate.is_step and not of_rate.is_sampling
    return plain in UNITS_OF_TIME_ALONE or is_word


MAX_ABBREVIATION_SIZE = 3  # letters: "min", "h" and "d" may be a minimum, a height and a distance


def _plain_unit(unit: str) -> str:
    return in_latin(unit.strip()).replace("\u03bc", "µ")


def names_among(lines: Sequence[Sequence[str]]) -> tuple[int, int | None]:
    """Find the line of names and the line of units among the lines above the numbers.

    The names are in the line above the units, or in the one below them if only that can hold names. In the last line,
    and directly below names of which one is a time, half of the cells have to be units; in others all, or all behind a
    label such as "Unit". The names of a labelled line may stand further up. Without a line of units they are in the
    last line that names a time or has units in brackets, because comments may follow. Else they are in the last line.

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
    >>> names_among([["s", "kN"], ["Zeit", "Kraft"]]), names_among([["Unit", "g", "N"], ["Name", "Rail", "Kraft"]])
    ((1, 0), (1, 0))
    """
    last = len(lines) - 1
    labelled = [
        i for i, line in enumerate(lines) if is_unit_name(line[0]) and any(line[1:]) and _are_units(line[1:], 1.0)
    ]
    for i in (*reversed(labelled), *(i for i in range(last, -1, -1) if i not in labelled)):
        if is_unit_of_other(lines[i][0]):  # of the time: "HUnit;s;s"
            continue
        names = _names_of_units(lines, i, i in labelled)
        share = 0.5 if i and (i == last or are_names(lines[i - 1])) else 1.0
        if names is not None and (i in labelled or _are_units(lines[i], share)):
            return names, i
    return next((i for i in range(last, -1, -1) if are_names(lines[i])), last), None


def _names_of_units(lines: Sequence[Sequence[str]], i: int, is_labelled: bool) -> int | None:
    """Number of the line of names if line ``i`` holds units; None if no other line can hold names."""
    below = range(i + 1, len(lines) if is_labelled else min(i + 2, len(lines)))
    named = [k for k in below if are_names(lines[k])]
    if named and (is_labelled or not i or not are_names(lines[i - 1])):
        return named[-1]
    if not is_labelled:
        above = [k for k in reversed(range(i)) if not _are_units(lines[k], 1.0)]  # a second line of units has no names
        return (above or [i - 1])[0] if i else next((k for k in below if not _begins_with_digit(lines[k])), None)
    return next((k for k in (*reversed(range(i)), *below) if not _begins_with_digit(lines[k])), None)


def _begins_with_digit(cells: Sequence[str]) -> bool:
    return any(cell[:1].isdigit() for cell in cells)


def _are_units(cells: Sequence[str], share: float) -> bool:
    """Whether at least this share of the filled cells are units."""
    filled_cells = [cell for cell in cells if cell]
    return sum(map(_is_unit, filled_cells)) >= share * len(filled_cells)


NUMBER_BEFORE_UNIT = re.compile(r"[+-]?[.,]?\d")  # as of a length, "12 m", and of a range, "-10 V" or ".5 V"


def _is_unit(cell: str) -> bool:
    """Whether a cell is a known unit, a meaningless one, or anything in brackets; "12 m" is a length."""
    bare = without_brackets(cell)
    if (
        not bare
        or cell[0].translate(BRACKETS_IN_ASCII) in "[("
        or bare.casefold() in MEANINGLESS_UNITS
        or bare.replace("\u03bc", "µ") in UNITS_OF_TIME_ALONE
    ):
        return True
    try:
        return not NUMBER_BEFORE_UNIT.match(bare) and bool(conversion(bare))
    except ValueError:
        return False


def are_names(cells: Sequence[str]) -> bool:
    """Whether a cell names the time or has a unit in brackets, or most of several have one behind a slash or the like.

    Not if any cell starts with a digit, as in "08:30".

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
    if _begins_with_digit(cells):
        return False
    in_brackets = [unit for name, unit in map(name_and_unit, cells) if name]
    if any(cell.lower() in TIME_WORDS for cell in cells) or any(unit and _is_unit(unit) for unit in in_brackets):
        return True
    return len(cells) > 1 and have_most_a_unit(cells)


COMMENT = re.compile(r"comm?ent|komment|remar[kq]|bemerk|notes?$|anmerk|osserv|opmerk|event|ereign|mark", re.IGNORECASE)


class Columns(NamedTuple):
    """Names and units of the columns, and the ``further`` names beside them for which the rows have no cells.

    ``aliases`` are for each column its name with the unit, and what the other lines of words have in its place;
    ``conflicts`` tells by the number of a column of two units for it.
    """

    names: list[str]
    units: list[str]
    further: list[str]
    aliases: list[tuple[str, ...]]
    conflicts: dict[int, str]


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
    if any(len(line) == count + 1 and is_unit_name(line[0]) for line in lines):  # labels, and none before the rows
        is_labelled = [len(line) == count + 1 for line in lines]
        lines = [
            line[1:] if is_label else line
            for is_label, line in zip(is_labelled, lines)
            if not (is_label and is_unit_of_other(line[0]))  # of the time: "HUnit;s;s"
        ]
    whole_lines = [line for line in lines if any(line) and len(line) >= count - open_end]
    lines = [(line + [""] * open_end)[:count] for line in whole_lines]
    if not lines:
        names = [str(i) for i in range(count)]
        names = [*names[:-1], ""] if open_end and count > 1 else names
        return Columns(names, [""] * count, [], [(name,) for name in names], {})
    of_words = [is_word(cell) for cell in cells]  # what stands above a column of words is no unit of a sensor
    name_line, unit_line = names_among([[b if not a else "" for a, b in zip(of_words, line)] for line in lines])
    written = _in_known_encoding(lines[name_line])
    if unit_line is not None:  # it may hold a name with its unit below an empty cell or the label of the line of names
        pairs_of_cells = zip(written, lines[unit_line])
        written = [lower if _is_name_below(upper, lower) else upper for upper, lower in pairs_of_cells]
    further = [cell for cell in whole_lines[name_line][count:] if cell and not COMMENT.match(cell)]
    below = [""] * count if unit_line is None else [without_brackets(cell) for cell in lines[unit_line]]
    below[0] = "" if is_unit_name(below[0]) else below[0]  # a label
    pairs = names_and_units_in(written)
    names = [name for name, _ in pairs]
    units = [unit if unit or name != cell else other for (name, unit), cell, other in zip(pairs, written, below)]
    conflicts = {
        i: f"its name {cell!r} says {unit!r}, the line of units {other!r}"
        for i, (cell, other) in enumerate(zip(written, below))
        if (unit := _contradicting_unit(cell, other))
    }
    others = [line for i, line in enumerate(lines) if i not in (name_line, unit_line) and not any(map(is_number, line))]
    for line in (line for line in ([*map(without_brackets, line)] for line in others) if _are_units_alone(line)):
        pairs_of_units = enumerate(zip(below, line))
        problems = {
            i: f"its lines of units say {b!r} and {a!r}" for i, (a, b) in pairs_of_units if _are_different(b, a)
        }
        conflicts = problems | conflicts
    return Columns(names, units, further, [*zip(written, *others)], conflicts)


def _in_known_encoding(cells: list[str]) -> list[str]:
    """Cells of the line of names in the only encoding in which the most names have a unit behind a mark: "Сила, Н"."""
    if have_most_a_unit(cells):
        return cells
    readings = [reading for reading in readings_together(cells) if have_most_a_unit(reading)]
    counts = [sum(unit_behind_mark(cell) is not None for cell in reading) for reading in readings]
    return list(readings[counts.index(max(counts))]) if readings and counts.count(max(counts)) == 1 else cells


def _is_name_below(upper: str, lower: str) -> bool:
    """Whether a cell of the line of units holds the name of its column: below an empty cell, or with a unit of time."""
    if not lower or _is_unit(lower):
        return False
    unit = name_and_unit(lower)[1]
    return not upper or (bool(unit) and _is_unit_of_time_alone(unit))


def _are_units_alone(cells: Sequence[str]) -> bool:
    """Whether several cells are known units, without a number before them."""
    return len(cells) > 1 and all(is_known(cell) and not NUMBER_BEFORE_UNIT.match(cell) for cell in cells)


def _contradicting_unit(cell: str, unit: str) -> str:
    """The unit in a name that contradicts the one in the line of units, or ""; behind a slash it may be a side."""
    in_brackets = name_and_unit(cell)[1]
    attached = unit_behind_mark(cell)
    stated = in_brackets if is_known(in_brackets) else attached[1] if attached else ""
    first, second = known_unit(stated), known_unit(unit)
    is_side = stated != in_brackets and first and second and first.dimension != second.dimension
    return "" if is_side or not _are_different(stated, unit) else stated


def _are_different(stated: str, unit: str) -> bool:
    """Whether two units are known, of samples or of time, and are not the same."""
    if not (is_known(stated) and is_known(unit)):
        return False
    if known_unit(stated) is None or known_unit(unit) is None:  # one of them is of time
        return rate_unit(stated) != rate_unit(unit)
    return not same_unit(stated, unit)


def is_line_of_names(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Whether cells are the names of the columns, with or without units.

    Parameters
    ----------
    cells : sequence of str
        Cells of a line above the numbers.
    names : sequence of str
        Names of the columns, without units.

    Returns
    -------
    bool
        False for a single column, of which another line may repeat the name, and for times, "Time;10:00:00;10:00:00".
    """
    if any(map(is_clock_or_date, cells)):
        return False
    cells = [cells[0].lstrip("#% "), *cells[1:]]
    bare = [name for name, _ in names_and_units_in(cells)]
    return len(names) > 1 and bare[: len(names)] == list(names)


def describes_columns(cells: Sequence[str], names: Sequence[str], units: Sequence[str]) -> bool:
    """Whether cells are the names of the columns, or their units.

    Parameters
    ----------
    cells : sequence of str
        Cells of a line above the numbers.
    names, units : sequence of str
        Names and units of the columns.

    Returns
    -------
    bool
        True for a line that states nothing beside them.
    """
    return any(cells) and (is_line_of_names(cells, names) or [*map(without_brackets, cells)] == list(units))
