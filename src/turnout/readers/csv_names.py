"""Which line above the numbers of a text file holds the names of the columns, and which their units."""

import re

from turnout.readers.channels import MEANINGLESS
from turnout.readers.time_column import SECONDS, WORDS
from turnout.units import conversion

NAME_WITH_UNIT = re.compile(r"^(.*?)\s*[\[(]([^\[\]]*)[\])]$")


def names_among(lines):
    """(number of the line of names, that of the units or None) of lines of cells, as many as there are columns.

    The names stand above a line of units; without one they are the last line that names a time or has units in
    brackets, for comments may follow, or else the last line. What stands further up may be anything.

    Examples
    --------
    >>> names_among([["Messung", "Gleis 3"], ["Zeit", "Kraft"], ["s", "kN"], ["Uhr", "Hammer"]])
    (1, 2)
    >>> names_among([["Messung", "Gleis 3"], ["Rail", "Kraft"]])
    (1, None)
    """
    last = len(lines) - 1
    for i in range(last, 0, -1):
        if _are_units(lines[i], 0.5 if i == last else 1.0):
            return i - 1, i
    return next((i for i in range(last, -1, -1) if _are_names(lines[i])), last), None


def _are_units(cells, share):
    """Whether at least this share of the cells that are not empty are units."""
    said = [cell for cell in cells if cell]
    return sum(map(_is_unit, said)) >= share * len(said)


def _is_unit(cell):
    """A unit that is known, one that says nothing, or whatever stands in brackets; "12 m" is a length."""
    bare = cell.strip("[]() ")
    if cell[0] in "[(" or bare.casefold() in MEANINGLESS or bare.replace("\u03bc", "µ") in SECONDS:
        return True
    try:
        return not bare[0].isdigit() and bool(conversion(bare))
    except ValueError:
        return False


def _are_names(cells):
    """Whether a time is among the cells, or a unit in brackets behind a name; beside "08:30" it is no column."""
    if any(cell[:1].isdigit() for cell in cells):
        return False
    in_brackets = [match[2] for cell in cells if (match := NAME_WITH_UNIT.match(cell)) and match[1]]
    return any(cell.lower() in WORDS for cell in cells) or any(unit and _is_unit(unit) for unit in in_brackets)
