"""Head of a text file: its ``name: value`` lines, and where the numbers begin."""

import re
import unicodedata
from collections.abc import Iterator, Sequence
from itertools import pairwise
from mmap import mmap
from typing import NamedTuple

from turnout.readers.attached_units import TIME_WORDS, is_known, name_and_unit, unit_behind_mark
from turnout.readers.csv_blank_rows import BLANK_ROW
from turnout.readers.csv_cells import (
    BLANK,
    DECIMAL_COMMA_REMEDY,
    NO_ROW_REMEDY,
    SEPARATORS,
    THOUSANDS_MARK,
    cells_of,
    decode_line,
    is_number,
    is_row,
)
from turnout.readers.csv_columns import are_names, describes_columns, names_and_units
from turnout.readers.csv_entries import HEAD_LINE, entries_of_lines, with_unit_in_brackets
from turnout.readers.csv_first_column import with_unnamed_first_column
from turnout.readers.csv_words import is_row_with_words
from turnout.readers.entries import Entry, entries_of_text
from turnout.readers.lost_entries import CONTROL_CHARACTER
from turnout.readers.metadata_names import (
    CONDITION_QUANTITIES,
    RECORD_COUNT_NAMES,
    SAMPLE_COUNT_NAMES,
    START_DATE_NAMES,
    START_NAMES,
    TEMPERATURES,
)
from turnout.readers.rate_vocabulary import is_rate_name
from turnout.readers.scale_vocabulary import is_scale_name, scale_meaning, value_of_word
from turnout.readers.source import CONDITIONS, COPY_AGAIN, HEAD_SIZE, Source
from turnout.unit_spellings import without_brackets

UNIT_SCALES = {"kHz": 1e3, "khz": 1e3, "MHz": 1e6, "ms": 1e-3, "µs": 1e-6, "\u03bcs": 1e-6, "us": 1e-6}
TIMES_OF_START = frozenset((*START_NAMES, *START_DATE_NAMES))
HEAD_NAMES = {*TIMES_OF_START, *RECORD_COUNT_NAMES, "n_samples"}
NUMERIC_HEAD_NAMES = {
    *TEMPERATURES, *SAMPLE_COUNT_NAMES,
}  # a head line only if a number follows, else the name of a column  # fmt: skip
EMPTY_LINES = re.compile(rb"\n+")
GROUPED_NUMBER = re.compile(rf"\d{{1,3}}(?:{THOUSANDS_MARK}\d{{3}})+(?!\d)")


class Head(NamedTuple):
    """Lines above the numbers of a text file: ``notes`` by name, ``names`` and ``units`` of the columns.

    The first number is at byte ``offset``; ``entries`` are all entries of the head with their lines. ``aliases`` are
    further names of the columns, ``unit_conflicts`` tells by the number of a column of two units for it.
    """

    notes: dict[str, float | str]
    names: list[str]
    units: list[str]
    offset: int
    separator: str
    entries: tuple[Entry, ...]
    aliases: list[tuple[str, ...]]
    unit_conflicts: dict[int, str]


def read_head(data: bytes | mmap, source: Source) -> Head:
    """Read the lines above the numbers, and find where the numbers begin.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    source : Source
        The text file.

    Returns
    -------
    Head

    Raises
    ------
    ReadError
        If no line of numbers follows.
    """
    notes: dict[str, float | str] = {}
    text_lines: list[str] = []
    head_lines: list[str] = []
    position = 0
    while position < len(data):
        if empty := EMPTY_LINES.match(data, position):
            head_lines += [""] * len(empty[0])
            position = empty.end()
            continue
        end = data.find(b"\n", position)
        end = len(data) if end < 0 else end
        line = with_unit_in_brackets(decode_line(data[position:end]))
        # a comma is the decimal mark where another separator stands
        separator = next((s for s in SEPARATORS if s in line), ",")
        cells = cells_of(line, separator)
        if not is_row(cells) and _are_rows_of_words(data, position):
            separator, cells = BLANK, cells_of(line, BLANK)
        of_words = [] if is_row(cells) else [s for s in (separator, BLANK) if is_row_with_words(data, position, s)]
        if of_words:
            separator, cells = of_words[0], cells_of(line, of_words[0])
        if of_words or is_row(cells):
            return _complete_head(notes, text_lines, head_lines, cells, separator, position, source, data)
        head_lines.append(line)
        note = _note_of(line, separator, len(cells))
        if note is not None:
            notes[note[0]] = note[1]
        elif line.strip():
            text_lines.append(line)
        position = end + 1
    if is_binary := CONTROL_CHARACTER.search(data, 0, HEAD_SIZE):
        raise source.error(f"byte {is_binary.start()}", f"{is_binary[0][0]:#04x} is no text", NO_TEXT_REMEDY)
    if len(text_lines) < 2:
        raise source.error("line 1", "no line of numbers follows", COPY_AGAIN, reason="empty")
    where, problem, remedy = _no_numbers(head_lines, text_lines[-1])
    raise source.error(where, problem, remedy)


def _complete_head(
    notes: dict[str, float | str],
    text_lines: Sequence[str],
    head_lines: list[str],
    cells: list[str],
    separator: str,
    offset: int,
    source: Source,
    data: bytes | mmap,
) -> Head:
    """The head above the first row, of which ``cells`` are the cells; ``text_lines`` are those without a note."""
    texts = [cells_of(text, separator) for text in text_lines]
    texts = with_unnamed_first_column(texts, len(cells), data, offset, separator)
    if separator == BLANK:
        texts = [words for words in texts if len(words) == len(cells)]
    texts += _names_between_other_separators(text_lines[-1:], texts, cells)
    texts += _commented_names(head_lines[-MAX_LINES_OF_NAMES:], texts, len(cells), separator)
    _check_row_above(texts, head_lines, cells, separator, source)
    _check_width(texts, cells, separator, len(head_lines), source)
    values_below, lines_of_values = _values_below_names(text_lines, separator, cells)
    if values_below:
        texts = list(_without_values(texts, [cells_of(line, separator) for line in lines_of_values], cells))
    names, units, further, aliases, conflicts = names_and_units(texts, cells)
    further = [name for name in further if name not in {entry.name for entry in values_below}]
    if further:
        problem = f"{len(names) + len(further)} columns have a name and the rows have {len(cells)} cells"
        where = f"line {len(head_lines) + 1}"
        raise source.error(where, f"{problem}: nothing says which name is of which cell", NAMES_REMEDY)
    scales = {
        _plain(a): b
        for a, b, *rest in (t for t in texts if len(t) > 1)
        if b and not any(rest) and a not in names and is_scale_name(a)
    }
    stated = [i for i, name in enumerate(names) if STATEMENT.fullmatch(name) and not cells[i]]
    lines_of_entries = [
        "" if t in lines_of_values or describes_columns(cells_of(t, separator), names, units) else t for t in head_lines
    ]
    # a word is no cell of a head, and where numbers have decimal commas a comma separates none
    separator_of_head = (";" if "," in "".join(cells) else ",") if separator == BLANK else separator
    entries = tuple(entries_of_lines(lines_of_entries, separator_of_head, names))
    for i in stated:  # "CH1(V),CH2(V),t0 = -0.01,tInc = 5e-05"
        entries += tuple(entries_of_text(names[i], f"the name of column {i + 1}"))
    entries += values_below
    stated += [i for i, name in enumerate(names) if not cells[i] and name in {entry.name for entry in values_below}]
    names = ["" if i in stated else name for i, name in enumerate(names)]
    conditions = _conditions(text_lines, separator, names)
    return Head({**conditions, **notes, **scales}, names, units, offset, separator, entries, aliases, conflicts)


def _note_of(line: str, separator: str, n_cells: int) -> tuple[str, float | str] | None:
    """Name and value of a line of the head that is a note: a comment, a known name, a rate or a scale."""
    match = HEAD_LINE.match(line.strip())
    if not match:
        return None
    name = match[1].strip()
    plain_name = _plain(name)
    value = match[3].strip(separator + " ")
    name_with_unit = f"{name} {match[2]}" if match[2] else name
    is_comment = line.startswith("#")
    is_rate = is_rate_name(name) and (is_comment or n_cells == 2 or _begins_with_number(value))
    is_note = (
        plain_name in HEAD_NAMES
        or (plain_name in NUMERIC_HEAD_NAMES and is_number(value.split()[0] if value else ""))
        or _states_scale(name_with_unit, value)
    )
    if plain_name in SAMPLE_COUNT_NAMES and (grouped := GROUPED_NUMBER.match(value)):
        value = re.sub(r"\D", "", grouped[0])
    if not (is_comment or is_note or is_rate):
        return None
    mark = match[0][match.end(2 if match[2] else 1) : match.start(3)]
    is_list = n_cells > 2 and set(mark.strip(" ")) == {separator}
    if _states_scale(name_with_unit, value):
        return name_with_unit, value.replace(separator, ";") if is_list else value  # its commas are no decimal marks
    if plain_name in TIMES_OF_START and is_list and len(values := set(value.split(separator))) == 1:
        return plain_name, values.pop()
    if plain_name in TIMES_OF_START and len(re.findall(r"\d+", value)) > 1 and not is_number(value):
        return plain_name, value  # "13 May 2026 10:00" is no number with a unit
    if plain_name in CONDITION_QUANTITIES:
        return plain_name, _value_of_condition(plain_name, value, match[2] or "")
    return plain_name if is_note else name, _value(f"{value} {match[2]}" if match[2] else value)


def _conditions(lines: Sequence[str], separator: str, names: Sequence[str]) -> dict[str, float | str]:
    """Conditions of the lines without a #, "speed: 80 km/h"; a name of a column is none."""
    conditions: dict[str, float | str] = {}
    for match in filter(None, (HEAD_LINE.match(line.strip()) for line in lines)):
        value = match[3].strip(separator + " ")
        name = _plain(match[1].strip())
        if name in CONDITIONS and match[1].strip() not in names and value and not re.search(r"[;\t]", value):
            conditions[name] = _value_of_condition(name, value, match[2] or "")
    return conditions


def _value_of_condition(name: str, value: str, unit: str) -> float | str:
    """A condition with the unit in brackets behind its name: a text if it has a quantity, else a number if possible."""
    text = f"{value} {unit}".strip()
    return text if name in CONDITION_QUANTITIES else _value(text)


def _values_below_names(
    lines: Sequence[str], separator: str, cells: Sequence[str]
) -> tuple[tuple[Entry, ...], frozenset[str]]:
    """Entries beside the names of the columns, with their values in the line of words below them, and these lines.

    As in "X,CH1,Increment" above "Sequence,VOLT,5E-05", they stand where the first row has no cell, or an empty one.
    """
    filled = [i for i, cell in enumerate(cells) if cell]
    for title, line in pairwise(lines):
        names, values = cells_of(title, separator), cells_of(line, separator)
        words = [row[i] for row in (names, values) for i in filled if i < len(row)]
        is_of_words = all(words) and not any(is_number(word) or re.search("[:=]", word) for word in words)
        if len(filled) < 2 or len(words) < 2 * len(filled) or not is_of_words:
            continue
        pairs = [(a, b) for i, (a, b) in enumerate(zip(names, values)) if i not in filled and a and is_number(b)]
        if entries := tuple(Entry(f"the line below {a!r}", a, b) for a, b in pairs if not is_number(a)):
            return entries, frozenset((title, line))
    return (), frozenset()


def _without_values(
    texts: Sequence[list[str]], lines_of_values: Sequence[list[str]], cells: Sequence[str]
) -> Iterator[list[str]]:
    """Cells of the lines above the rows; of the line with values below names the units alone, if it has some."""
    for line in texts:
        is_of_values = line in lines_of_values and any(map(is_number, line))
        words = [word for word, cell in zip(line, cells) if cell]
        if not is_of_values:
            yield line
        elif 2 * sum(is_known(without_brackets(word)) for word in words) >= len(words):
            yield ["" if is_number(cell) else cell for cell in line]


STATEMENT = re.compile(r"[^\d\W][^=]*=\s*[+-]?\d.*")  # in place of a name, above cells that are empty
MAX_LINES_OF_NAMES = 2  # behind a #: names and units
NAMES_REMEDY = "Export the file again with one cell in each row for each name"
NO_TEXT_REMEDY = (
    f"{COPY_AGAIN}; if the logger writes binary numbers, export them as text or in another format that is read"
)
N_ROWS_OF_WORDS = 5  # lines: numbers between blanks may be in a head, too, but not in so many lines


def _are_rows_of_words(data: bytes | mmap, position: int) -> bool:
    """Whether a line and those behind it are rows of as many numbers between blanks or tabs, without other marks."""
    end = position
    rows: list[list[str]] = []
    while len(rows) < N_ROWS_OF_WORDS and end < len(data):
        start, end = end, (data.find(b"\n", end) + 1) or len(data)
        line = decode_line(data[start:end])
        if BLANK_ROW.fullmatch(line.encode()) or not line:
            continue
        rows.append([] if ";" in line or "|" in line else cells_of(line, BLANK))
    return len(rows) > 1 and len(rows[0]) > 1 and all(len(row) == len(rows[0]) and is_row(row) for row in rows)


def _names_between_other_separators(
    last_lines: Sequence[str], texts: Sequence[Sequence[str]], cells: Sequence[str]
) -> list[list[str]]:
    """Cells of the last line of words if only another separator than that of the rows gives each column a name.

    A title has commas and blanks, too, and perhaps one unit, as "Hammer test [N]": between those, each name has a unit.
    """
    if any(len(text) >= len(cells) - (not cells[-1]) for text in texts):
        return []
    separated = [cells_of(line, separator) for line in last_lines for separator in SEPARATORS]
    lines = [names for names in separated if are_names(names)]
    of_text = [cells_of(line, separator) for line in last_lines for separator in (",", BLANK)]
    lines += [names for names in of_text if are_names(names) and all(map(_is_time_or_has_unit, names))]
    return [names for names in lines if len(names) == len(cells)][:1]


def _is_time_or_has_unit(cell: str) -> bool:
    return cell.lower() in TIME_WORDS or bool(name_and_unit(cell)[1]) or unit_behind_mark(cell) is not None


def _commented_names(
    last_lines: Sequence[str], texts: Sequence[Sequence[str]], n: int, separator: str
) -> list[list[str]]:
    """Cells of the lines directly above the numbers that name the columns behind a #, if no other line does."""
    names = [cells_of(line.lstrip("#%"), separator) for line in last_lines if line.startswith(("#", "%"))]
    if any(len(text) >= n and not text[0].startswith(("#", "%")) for text in texts):
        return []
    return [cells for cells in names if len(cells) == n and not any(map(is_number, cells))]


def _check_row_above(
    texts: Sequence[Sequence[str]], lines: Sequence[str], cells: Sequence[str], separator: str, source: Source
) -> None:
    """ReadError if the line above the first line of numbers is a row of samples, with a cell that is no number.

    Such a row has numbers in columns of samples, and the names of the columns stand above it. A text in its first cell
    alone is a label.
    """
    row = texts[-1] if texts and texts[-1] == cells_of(lines[-1], separator) else []
    numbers = [is_number(cell) and bool(sample) for cell, sample in zip(row, cells)]
    is_label = len(row) > 1 and not numbers[0] and all(n or not cell for n, cell in zip(numbers[1:], row[1:]))
    if len(row) != len(cells) or not any(numbers) or is_label:
        return
    if any(len(text) == len(cells) and not any(map(is_number, text)) for text in texts[:-1]):
        word = next((cell for cell, is_of_number in zip(row, numbers) if not is_of_number), "")
        problem = f"{word[:60]!r} is no number, in the first row of samples"
        raise source.error(f"line {len(lines)}", problem, NO_ROW_REMEDY)


def _check_width(
    texts: Sequence[Sequence[str]], cells: Sequence[str], separator: str, n_line: int, source: Source
) -> None:
    """ReadError if commas separate more cells of a row than there are names: some of them are decimal marks."""
    names = [name for name in texts[-1] if name] if texts else []
    if separator != "," or not len(names) < len(cells) <= 2 * len(names) or any(len(t) >= len(cells) for t in texts):
        return
    if are_names(texts[-1]) and all(cell.lstrip("+-").isdecimal() for cell in cells):
        problem = (
            f"the rows have {len(cells)} cells and {len(names)} names stand above them: commas are decimal marks, too"
        )
        raise source.error(f"line {n_line + 1}", problem, DECIMAL_COMMA_REMEDY)


CLOCK_TIME = re.compile(r"(?<!\d)\d{1,2}:\d{2}:\d{2}(?!\d)")


def _no_numbers(lines: Sequence[str], last: str) -> tuple[str, str, str]:
    """Place, problem and remedy of a text without a row of numbers; ``last`` is its last line that is no note."""
    if CLOCK_TIME.search(last):
        problem = f"no line of numbers; the last line reads {last[:60]!r}, with the time of a clock"
        return "the file", problem, "Export the time in seconds from the start of the record"
    separator = next((s for s in SEPARATORS if s in last), ",")
    cells = cells_of(last, separator)
    words = [i for i, cell in enumerate(cells) if cell and not is_row([cell, "0"])]
    if words == [0] and len(cells) > MIN_CELLS_OF_ROW:
        problem = f"its last line begins with {cells[0][:60]!r}, and {len(cells) - 1} numbers follow: channels are rows"
        return "the file", problem, "Transpose the table: a column for each channel, with its name above the numbers"
    if len(words) < len(cells) and words:
        i = words[0]
        same = [names for line in lines if len(names := cells_of(line, separator)) == len(cells)]
        name = next((names[i] for names in same if not any(map(is_number, names))), "") or str(i + 1)
        problem = f"{cells[i][:60]!r} is no number, and no row holds only numbers, dates and times"
        place = f"line {max(k for k, line in enumerate(lines, 1) if line == last)}, column {name!r}"
        return place, problem, WORDS_REMEDY
    remedy = "Export numbers as '-12.5' between semicolons, tabs, commas or blanks, the time in seconds"
    return "the file", f"no line of numbers; the last line reads {last[:60]!r}", remedy


MIN_CELLS_OF_ROW = 64  # numbers behind a name: so many are samples of a channel
WORDS_REMEDY = "Export this column as numbers, states such as TRUE and FALSE as 1 and 0, or leave it out"


def _states_scale(name: str, value: str) -> bool:
    """Whether a line states a scale: such a word, and a value that begins with a number or is a word for one.

    Words for each column, "Polarity;normal;inverted", are an entry of its own.
    """
    if not is_scale_name(name):
        return False
    is_word = not re.search(r"[;\t]", value) and value_of_word(scale_meaning(name), value) not in (None, 1.0)
    return is_word or re.match(r"[+-]?[.,]?\d", value) is not None


def _plain(name: str) -> str:
    """A name without case, accents, spaces and apostrophes.

    >>> _plain("Fréquence d’échantillonnage")
    'frequence_d_echantillonnage'
    """
    letters = unicodedata.normalize("NFKD", name.lower())
    return re.sub(r"[\s'’]", "_", "".join(c for c in letters if not unicodedata.combining(c)))


def _begins_with_number(value: str) -> bool:
    return bool(value) and is_number(value.split()[0])


def _value(text: str) -> float | str:
    """A number in Hz or s if the text begins with one ("51200 Hz", "12,8 kHz"), else the text."""
    first, *words = text.split() or [""]
    dated = "-" in first[1:].lower().replace("e-", "")
    if not first or not is_number(first) or dated:
        return text
    return float(first.replace(",", ".")) * UNIT_SCALES.get(words[0].strip("[]()") if words else "", 1.0)
