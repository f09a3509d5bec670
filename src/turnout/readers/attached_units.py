"""Units that stand in the names of the columns of a text file: "F [kN]", "F/kN", "Kraft in kN", "Force, kN".

Brackets are no part of a name, so each cell is read alone. A slash, a comma and the word "in" may be part of one. They
separate a unit only where most names of the line have a unit, as in "t/s;F/N;a/(m/s²)" after ISO 80000 and DIN 1313.
A blank and an underscore are always part of the name: the layout states the unit of "force_N".
"""

import re
from collections.abc import Sequence

from turnout.readers.metadata_names import TIME_NAMES
from turnout.readers.rate_units import rate_unit, words_of
from turnout.readers.source import MEANINGLESS_UNITS
from turnout.readers.stated_units import SENSITIVITY_IN_NAME, known_unit
from turnout.unit_spellings import BRACKETS_IN_ASCII, without_brackets
from turnout.units import SI, in_latin

TIME_WORDS = (*TIME_NAMES, "timestamp", "zeit", "zeitstempel", "tid", "temps", "horodatage", "tempo", "tiempo", "tijd")
# Units that say alone that a column is the time. "min" and "d" may be a minimum and a distance.
UNITS_OF_TIME_ALONE = ("", "s", "sec", "ms", "µs", "us", "ns")
NAME_WITH_UNIT = re.compile(r"^(.*?)\s*[\[(]([^\[\]]*)[\])]$")
BRACKETS = re.compile(r"\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\)|\{([^{}]*)\}|<([^<>]*)>)\s*")
MARK = re.compile(r"[/,]|(?<=\s)(?:in|en|i)(?=\s)")  # "Kraft in N", "force en N", "kraft i N"
MARK_AT_END = re.compile(r"(?:[/,]|(?<=\s)(?:in|en|i))$")
MAX_UNIT_SIZE = 40  # characters of a unit behind a mark
IN_BRACKETS = re.compile(r"[\[(](.*)[\])]")
# The last word of "hammer pC/N", which is a sensitivity: an SI prefix and the symbol of a unit.
PREFIXED_UNIT = re.compile(r"[pnµ\u03bcumkM](?:[ACFHNTVWΩ]|Hz|Ohm|Pa|bar)|Hz|[Bb]its?")


def name_and_unit(cell: str) -> tuple[str, str]:
    """Name and unit of a column: the unit is the known one in brackets, else what brackets at the end hold.

    Brackets at the end are no part of the name, nor is what links them to it: a slash, a comma or "in".

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
    >>> name_and_unit("v/(m/s)"), name_and_unit("rail mV/(m/s²)")
    (('v', 'm/s'), ('rail mV/(m/s²)', ''))
    """
    sensitivity = SENSITIVITY_IN_NAME.search(cell)
    for match in reversed([*BRACKETS.finditer(cell.translate(BRACKETS_IN_ASCII))]):
        if sensitivity and sensitivity.start() < match.start() < sensitivity.end():  # of "10 mV/(m/s²)"
            return cell, ""
        unit = without_brackets(next(text for text in match.groups() if text is not None))
        if is_known(unit):
            before = cell[: match.start()]
            name = _bare_name(MARK_AT_END.sub("", before)) if match.end() == len(cell) else cell
            is_division = before.endswith("/")
            return (cell, "") if is_division and _ends_with_unit(name, but_symbols=True) else (name, unit)
    match_at_end = NAME_WITH_UNIT.match(cell.translate(BRACKETS_IN_ASCII))
    return (cell[: match_at_end.end(1)], match_at_end[2]) if match_at_end else (cell, "")


def _bare_name(name: str) -> str:
    """A name without blanks around it, and without the comma of "Kraft, in N"."""
    return name.strip().rstrip(",").rstrip()


def is_known(unit: str) -> bool:
    """Whether a unit is known: of a sensor, or of time.

    Parameters
    ----------
    unit : str
        Unit as it is written.

    Returns
    -------
    bool
        False for any other text.
    """
    return known_unit(unit) is not None or _is_of_time(unit)


def _is_of_time(unit: str) -> bool:
    time_unit = rate_unit(unit)
    return time_unit is not None and time_unit.is_step


def names_and_units_in(cells: Sequence[str]) -> list[tuple[str, str]]:
    """Name and unit of each column of a line.

    Parameters
    ----------
    cells : sequence of str
        Cells of the line.

    Returns
    -------
    list of tuple of (str, str)
        The cell itself and "" where no unit is stated, and for columns that only such a text distinguishes.

    Examples
    --------
    >>> names_and_units_in(["t/s", "F/kN", "a/m/s²"]), names_and_units_in(["time", "force", "rail/m"])
    ([('t', 's'), ('F', 'kN'), ('a', 'm/s²')], [('time', ''), ('force', ''), ('rail/m', '')])
    """
    in_brackets = [name_and_unit(cell) for cell in cells]
    shared = _distinguished_by_brackets(in_brackets)
    pairs = [(cell, "") if pair[0] in shared else pair for cell, pair in zip(cells, in_brackets)]
    if not have_most_a_unit(cells):
        return pairs
    attached = [unit_behind_mark(cell) if pair[0] == cell else None for cell, pair in zip(cells, pairs)]
    stems = [new[0] if new else _before_last_mark(name) for new, (name, _) in zip(attached, pairs)]
    return [new if new and stems.count(new[0]) == 1 else pair for new, pair in zip(attached, pairs)]


def _before_last_mark(name: str) -> str:
    """What a name has in common with others that differ behind the last mark: "S1" of "S1/left"."""
    starts = [mark.start() for mark in MARK.finditer(name)]
    return _bare_name(name[: starts[-1]]) if starts else name


def have_most_a_unit(cells: Sequence[str]) -> bool:
    """Whether most names of a line have a unit behind a mark; a time without one does not count.

    Parameters
    ----------
    cells : sequence of str
        Cells of the line.

    Returns
    -------
    bool
        True where a slash, a comma or "in" separates a unit from its name.

    Examples
    --------
    >>> have_most_a_unit(["time", "F/N", "a/g"]), have_most_a_unit(["time", "force", "rail/m"])
    (True, False)
    """
    named = [cell for cell in cells if cell and cell.lower() not in TIME_WORDS]
    return 2 * sum(unit_behind_mark(cell) is not None for cell in named) > len(named)


def unit_behind_mark(cell: str) -> tuple[str, str] | None:
    """Name and known unit of a cell, separated by a slash, a comma or the word "in".

    The slash of "v m/s" and of "hammer mV/N" is part of a unit: a unit stands before it. So is that of "flow l/s": only
    a time is divided by seconds. A text that begins with a number is a range, "Force, 5 kN".

    Parameters
    ----------
    cell : str
        Name of a column as it is written.

    Returns
    -------
    tuple of (str, str) or None
        None without such a unit.

    Examples
    --------
    >>> unit_behind_mark("a/m/s²"), unit_behind_mark("Kraft F in kN"), unit_behind_mark("Time, s")
    (('a', 'm/s²'), ('Kraft F', 'kN'), ('Time', 's'))
    >>> [unit_behind_mark(cell) for cell in ("v m/s", "hammer mV/N", "flow l/s", "Force, 5 kN", "in", "in N", "F/")]
    [None, None, None, None, None, None, None]
    """
    for mark in MARK.finditer(cell):
        if len(cell) - mark.end() > MAX_UNIT_SIZE:
            continue
        name, text = _bare_name(cell[: mark.start()]), cell[mark.end() :].strip()
        in_brackets = IN_BRACKETS.fullmatch(text)
        unit = in_brackets[1] if in_brackets else text
        is_division = mark[0] == "/"
        is_compound = is_division and _ends_with_unit(name, but_symbols=in_brackets is not None)
        if name and not is_compound and _can_be_unit(unit, name, is_division):
            return name, unit
    return None


def _can_be_unit(unit: str, name: str, is_division: bool) -> bool:
    """Whether a text behind the mark is the unit of a name; the name of a quantity, as "strain", is none."""
    plain = in_latin(unit).replace("\u03bc", "µ")
    if re.match(r"[^\W\d]|[°%]", plain) is None or plain.casefold() in (*MEANINGLESS_UNITS, *SI):
        return False
    if not _is_of_time(plain):
        return known_unit(plain) is not None
    is_time = not set(words_of(name)).isdisjoint(TIME_WORDS)
    return is_time or (not is_division and plain in UNITS_OF_TIME_ALONE)


def _ends_with_unit(name: str, but_symbols: bool) -> bool:
    """Whether the last word of a name is a unit or a number, so that a slash behind it continues a unit.

    Where brackets show that the unit begins behind the slash, "v" and other small letters are symbols of quantities.
    """
    last = re.split(r"[\s_]+", name)[-1]
    if but_symbols and len(last) == 1 and last.islower():
        return False
    return known_unit(last) is not None or PREFIXED_UNIT.fullmatch(last) is not None or last.isdigit()


def _distinguished_by_brackets(pairs: Sequence[tuple[str, str]]) -> set[str]:
    """Names that several columns share, with different texts in brackets that are no units: "Y[0]", "acc (left)"."""
    texts: dict[str, list[str]] = {}
    for bare, text in pairs:
        texts.setdefault(bare, []).append(text)
    return {n for n, t in texts.items() if len(set(t)) == len(t) > 1 and not any(map(_holds_unit, t)) and all(t)}


def _holds_unit(text: str) -> bool:
    return not text.isdigit() and any(is_known(word) for word in text.split())
