"""Entries of the lines of a text file above and below its numbers."""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from turnout.readers.channel_delays import is_delay_name
from turnout.readers.channel_descriptions import is_description_name
from turnout.readers.csv_cells import cells_of, is_number
from turnout.readers.csv_columns import is_line_of_names
from turnout.readers.directions import is_direction_name
from turnout.readers.entries import (
    COLON,
    FREE_TEXT,
    Entry,
    decoded_json,
    entries_of,
    entries_of_text,
    paired_statements,
)
from turnout.readers.entry_owners import CHANNEL, container_of
from turnout.readers.exponential_windows import is_window_name
from turnout.readers.inversions import is_phase_name
from turnout.readers.measured_entries import is_statistic_name
from turnout.readers.metadata_names import SAMPLE_COUNT_NAMES
from turnout.readers.metadata_subjects import STRONG, subject_of
from turnout.readers.overload_flags import is_of_overload
from turnout.readers.rate_units import rate_unit, words_of
from turnout.readers.rate_vocabulary import is_rate_name
from turnout.readers.scale_vocabulary import is_of_drawing, is_scale_name, plain_word
from turnout.readers.source import CONDITIONS
from turnout.readers.split_starts import CLOCK_ALONE, may_state_start
from turnout.readers.stated_counts import PROMISING_NAMES
from turnout.readers.stated_quantities import is_quantity_name
from turnout.readers.stated_sensitivities import SENSITIVITY, is_sensitivity_name
from turnout.readers.stated_units import known_unit
from turnout.readers.time_texts import is_day, looks_dated, parse_time
from turnout.readers.unit_names import UNIT_WORD, is_unit_name

NOT_BEHIND_NUMBER = "".join(rf"(?<!\s\d{{{n}}})" for n in range(1, 7))  # a digit in a word, as in "CH1", is none
# Behind a name; a comma within a number is a decimal mark.
MARK = rf"(?:{COLON}|[=;\t]|{NOT_BEHIND_NUMBER},|,(?!\d))"
HEAD_LINE = re.compile(rf"^#?\s*([^\W\d](?:[\w.'’-]| ++(?=[\w.'’-]))*+)(?:\s*+([\[(][^\])]*[\])]))?\s*{MARK}\s*(.*)$")
LINE_OF_PAIRS = re.compile(r"([^:=;\t\d]+[/|&][^:=;\t\d]+?)\s*[:=;\t]\s*(.+)")  # names and numbers
UNIT_BEHIND_COMMA = re.compile(r"^([^,:=;\t]+),\s*([^\W\d][^\s,:=;\t]*)(?=\s*[:=;\t]\s*[+-]?[.,]?\d)")


def with_unit_in_brackets(line: str) -> str:
    """A line of a head with the unit of its name in brackets.

    Parameters
    ----------
    line : str
        The line.

    Returns
    -------
    str
        Unchanged if no known unit stands between a comma and the mark before a number.

    Examples
    --------
    >>> [with_unit_in_brackets(line) for line in ("Sampling rate, kHz: 20", "Date, time: 13.05.2026", "t, s;F, kN")]
    ['Sampling rate [kHz]: 20', 'Date, time: 13.05.2026', 't, s;F, kN']
    """
    match = UNIT_BEHIND_COMMA.match(line)
    is_unit = match and (rate_unit(match[2]) or known_unit(match[2]))
    return f"{match[1]} [{match[2]}]{line[match.end() :]}" if match and is_unit else line


def entries_of_lines(
    lines: Sequence[str], separator: str, names: Sequence[str], first_line: int = 1
) -> Iterator[Entry]:
    """Entries of lines of text: "name: value" lines, pairs of cells, names above values, and free text.

    Parameters
    ----------
    lines : sequence of str
        Lines above or below the numbers.
    separator : str
        Separator of the cells.
    names : sequence of str
        Names of the columns; their line is no entry.
    first_line : int
        Number of the first of the lines in the file, from 1.

    Yields
    ------
    Entry
        Each with its line.
    """
    table = [cells_of(line, separator) for line in lines]
    for i, (line, cells) in enumerate(zip(lines, table)):
        place = f"line {first_line + i}"
        text = line.strip().lstrip("#%*/!'\" ").strip()
        if not text or is_line_of_names(cells, names):
            continue
        if isinstance(mapping := decoded_json(text), Mapping):  # '# {"units": {"force": "kN"}}'
            yield from (e for e in entries_of(mapping, place) if not _is_of_condition(e))
            continue
        if (named := LINE_OF_PAIRS.match(text)) and (several := paired_statements(named[1], named[2].strip(separator))):
            yield from (Entry(place, *pair) for pair in several)
            continue
        if labelled := _labelled_values(cells, names):
            yield from (Entry(place, *pair) for pair in labelled)
            continue
        filled = cells if cells[0] else cells[1:]
        statements = [HEAD_LINE.match(cell) for cell in filled if re.search("[:=]", cell)]
        if len(matches := [match for match in statements if match]) == len(filled) > 1:
            is_list = len(cells) == len(names) and len({match.group(1, 2) for match in matches}) == 1
            if is_list and not any(re.search("[=:;]", match[3]) for match in matches):  # one for each column
                yield Entry(place, f"{matches[0][1]} {matches[0][2] or ''}".strip(), [match[3] for match in matches])
            else:
                for cell in filled:
                    yield from entries_of_lines([cell], separator, names, first_line + i)
            continue
        pairs = [(a, b) for a, b in pairwise(cells) if a and b and not is_number(a)]
        if len(cells) > 2:  # "CH1;force;DC;10V" has a coupling and a range
            pairs = [(a, b) for a, b in pairs if a not in COUPLINGS or is_number(b)]
        for name, second, third in zip(cells, cells[1:], cells[2:]):  # "Abtastrate;25,6;kHz", "Abtastrate;kHz;25,6"
            if name and is_number(second) and rate_unit(third):
                pairs = [(name, f"{second} {third}"), *(pair for pair in pairs if pair != (name, second))]
            elif name and rate_unit(second) and is_number(third):
                pairs = [(name, f"{third} {second}"), *(p for p in pairs if p not in ((name, second), (second, third)))]
            elif (
                name and is_day(second) and not is_day(third) and re.match(r"\d{1,2}[:.]\d{2}", third)
            ):  # "Start;13.05.2026;10:20:30"
                pairs = [(name, f"{second} {third}"), *(p for p in pairs if p not in ((name, second), (second, third)))]
        if len(filled) == 2 and rate_unit(filled[1]) and (match := HEAD_LINE.match(filled[0])) and is_number(match[3]):
            yield Entry(place, match[1], f"{match[3]} {filled[1]}")  # "fs: 20;kHz"
            continue
        if len([cell for cell in cells if cell]) > 2 and i + 1 < len(table) and len(table[i + 1]) == len(cells):
            pairs += [(a, b) for a, b in zip(cells, table[i + 1]) if a and not is_number(a) and is_number(b)]
        is_drawn = len(cells) == 2 and is_of_drawing(cells[0])  # "Plan;scale 1:500" is about the plan as a whole
        if len(cells) == 1 and (dated := _dated_line(text)):
            pairs.append(dated)
        elif (match := HEAD_LINE.match(text)) and len(cells) < 3 and not is_drawn and not _is_statement(match[1], text):
            name = f"{match[1]} {match[2]}" if match[2] else match[1]
            pairs.append((name, match[3].strip(separator + ' "')))
        entries = [
            Entry(place, name.strip('"# ').rstrip(":= "), value.lstrip(":= ").strip('"')) for name, value in pairs
        ]
        is_of_columns = is_unit_name(cells[0]) or is_quantity_name(cells[0])
        if len(cells) > 2 and (is_of_columns or _describes_columns(cells, names)):
            entries = [Entry(place, cells[0].rstrip(": "), cells[1:])]  # one for each column
        elif len(cells) > 2 and _has_time_for_each(cells, names):
            entries = [
                Entry(place, cells[0].strip(":= "), DECIMAL_COMMA.sub(r"\1.", cell)) for cell in cells[1:] if cell
            ]
        elif len(cells) > 2 and _has_value_for_each(cells, names):
            entries = [Entry(place, cells[0].rstrip(": "), [DECIMAL_COMMA.sub(r"\1.", cell) for cell in cells[1:]])]
        elif len(cells) > 2 and any(of(cells[0]) for of in OF_EACH):
            entries = [Entry(place, cells[0].rstrip(": "), [cell.replace(",", ".") for cell in cells[1:]])]
        yield from entries or (*entries_of_text(text, place), Entry(place, FREE_TEXT, text))
        is_list = any(isinstance(entry.value, list) for entry in entries)
        is_settled = is_list or any(is_rate_name(e.name) or subject_of(e.name) == STRONG for e in entries)
        if pairs and not is_drawn and not is_settled:
            yield from entries_of_text(text, place)


OF_EACH = (is_delay_name, is_of_overload, is_window_name, is_phase_name)  # names of lines with a value for each column


def _is_of_condition(entry: Entry) -> bool:
    """Whether an entry is the value of a condition or the unit beside it, '"speed": {"value": 80, "unit": "km/h"}'."""
    group = "_".join(words_of(container_of(entry).rpartition("/")[2])) if "/" in entry.place else ""
    is_part = is_unit_name(entry.name) or entry.name.casefold() == "value"
    return is_part and (group in CONDITIONS or group in OTHER_CONDITIONS)


OTHER_CONDITIONS = frozenset("temperature temperatur geschwindigkeit vitesse hastighed humidity".split())


def _is_statement(name: str, text: str) -> bool:
    """Whether the beginning of a text is no name: "Record length 0.5 s", and "Wed May 13 10" of "... 10:20:30 2026"."""
    if name[-1].isdigit() and len(text) <= MAX_STAMP and parse_time(text):
        return True
    match = re.search(r" \d+(?:[.,]\d+)? ?([^\W\d]+)$", name)
    unit = rate_unit(match[1]) if match else None
    return unit is not None and unit.is_step


MAX_WORDS_OF_START = 5
MAX_STAMP = 60  # characters of a line that is a time stamp


def _dated_line(text: str) -> tuple[str, str] | None:
    """Name and value of a line that states a start without a mark between them, "start 2026-05-13 10:20:30"."""
    words = text.split()
    for n in range(1, min(len(words), MAX_WORDS_OF_START + 1)):
        name, value = " ".join(words[:n]), " ".join(words[n:])
        if re.search("[:=,;]", f"{name}{value[:1]}"):  # the mark itself
            return None
        if may_state_start(name) and (looks_dated(value) or is_day(value) or CLOCK_ALONE.fullmatch(value)):
            return name, value
    return None


LABELLED_VALUE = re.compile(r"([^\W\d]\w*):\s*([^:\s][^:]*)")


def _labelled_values(cells: Sequence[str], names: Sequence[str]) -> list[tuple[str, str]]:
    """Names and values of a line of which each value has the label of a channel, "Vertical Scale,CH1:0.5,CH2:0.1".

    A rate and a number of samples are those of all channels: "Sample Interval,Analog:5E-05". Empty for other lines.
    """
    matches = [LABELLED_VALUE.fullmatch(cell) for cell in cells[1:] if cell]
    name = cells[0]
    if not name or not matches or re.search("[:=]", name) or not all(matches):
        return []
    pairs = [(match[1], match[2].strip()) for match in matches if match]
    is_of_all = is_rate_name(name) or "_".join(words_of(name)) in PROMISING_NAMES
    if not is_of_all and not all(CHANNEL.fullmatch(label) or label in names for label, _ in pairs):
        return []
    return [(name if is_of_all else f"{name} {label}", value) for label, value in pairs]


def _describes_columns(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a line has texts of columns behind a word for such texts, as "Sensor;hammer;accelerometer".

    There is one for each column, or for each but the first, which is often that of the time.
    """
    texts, is_description = cells[1:], is_description_name(cells[0]) or is_direction_name(cells[0])
    return len(texts) in (len(names), len(names) - 1) and is_description and not any(map(is_number, texts))


COUPLINGS = ("DC", "AC")
NO_VALUE = re.compile(r"[-–—]*|n\.?/?a\.?|none|keine?", re.IGNORECASE)  # a cell of a channel without one
DECIMAL_COMMA = re.compile(r"^([+-]?\d+),(?=\d)")


DURATION = re.compile("durat|dauer|duree|durac|varighed|looptijd|record_length")


def _has_time_for_each(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a line has a rate, step, duration or number of samples for each column, or for each but the first."""
    name, values = cells[0].strip(":= "), [cell for cell in cells[1:] if cell]
    words = "_".join(words_of(name))
    is_of_time = is_rate_name(name) or DURATION.search(words) or words in SAMPLE_COUNT_NAMES
    is_for_each = len(cells) - 1 in (len(names), len(names) - 1) and len(values) > 1
    return bool(is_of_time and is_for_each and all(re.match(r"[+-]?[.,]?\d", value) for value in values))


def _has_value_for_each(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a line has a sensitivity or a scale for each column, or for each but the first: all begin alike."""
    begin_with_number = {
        re.match(r"[+-]?[.,]?\d", text) is not None for text in cells[1:] if not NO_VALUE.fullmatch(text)
    }
    is_unit = any(map(UNIT_WORD.fullmatch, words_of(cells[0]))) and SENSITIVITY.search(plain_word(cells[0])) is not None
    is_scale = is_sensitivity_name(cells[0]) or is_scale_name(cells[0]) or is_unit or is_statistic_name(cells[0])
    return len(cells) - 1 in (len(names), len(names) - 1) and is_scale and len(begin_with_number) == 1
