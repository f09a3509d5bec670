"""The head of a text file: notes by name, names and units of the columns, and where the numbers begin."""

import re
import unicodedata

from turnout.readers.csv_cells import MARK, stands_for_a_number
from turnout.readers.csv_names import NAME_WITH_UNIT, names_among
from turnout.readers.head_words import SAMPLES, START, START_DATE
from turnout.readers.raw import COPY_AGAIN
from turnout.readers.variables import COUNT, RATE, STEP

NOTE = re.compile(r"^#?\s*([^\W\d][\w .'’-]*?)\s*([\[(][^\])]*[\])])?\s*[:=,;\t]\s*(.*)$")
SCALES = {"kHz": 1e3, "khz": 1e3, "MHz": 1e6, "ms": 1e-3, "µs": 1e-6, "\u03bcs": 1e-6, "us": 1e-6}
TEMPERATURES = {"rail_temperature", "air_temperature"}
NOTES = {*RATE, *STEP, *START, *START_DATE, *COUNT, "n_samples"}
NUMBERS = TEMPERATURES | {*SAMPLES}  # a note only where a number follows, else a column of that name
GROUPED = re.compile(rf"\d{{1,3}}(?:{MARK}\d{{3}})+(?!\d)")
# A line that says one frequency and nothing else: "Vzorkovani: 10000 Hz", "taktning [kHz];10".
FREQUENCY = re.compile(r"^#?[^\d\[(]+[\[(]?([kM]?Hz)?[\])]?[\s:=,;]*([\d.,]+)\s*([kM]?Hz)?\W*$", re.IGNORECASE)
NO_RATE = re.compile(r"filt|pass|paß|cut|grenz|band|coup|cort|tagli|græns|eigen|reson|netz|mains", re.IGNORECASE)


def _line_of(data):
    """One line as text: UTF-8, or what older loggers of the west write."""
    try:
        return data.decode("utf-8-sig").strip("\r\n")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace").strip("\r\n")


def head_of(data, source):
    """(notes, names, units, offset of the first number, separator, lines that name a frequency nobody understood)."""
    notes: dict[str, float | str] = {}
    before: list[str] = []
    unclear: list[tuple[str, float]] = []
    position = 0
    while position < len(data):
        end = data.find(b"\n", position)
        end = len(data) if end < 0 else end
        line = _line_of(data[position:end])
        # a comma is the decimal mark where another separator stands
        separator = next((s for s in ("\t", ";") if s in line), ",")
        cells = _cells(line, separator)
        if any(cells) and all(_is_number(cell) or stands_for_a_number(cell) or cell == "" for cell in cells):
            names, units = _names([_cells(text, separator) for text in before], cells)
            return notes, names, units, position, separator, tuple(unclear)
        match = NOTE.match(line.strip())
        name = match[1].strip() if match else ""
        plain = _plain(name)
        if plain not in NOTES and (frequency := _frequency(line)) is not None:
            unclear.append((line.strip(), frequency))
        value = match[3].strip(separator + " ") if match else ""
        known = plain in NOTES or (plain in NUMBERS and _is_number(value.split()[0] if value else ""))
        if plain in SAMPLES and (grouped := GROUPED.match(value)):
            value = re.sub(r"\D", "", grouped[0])
        if match and (line.startswith("#") or known):
            notes[plain if known else name] = _value(f"{value} {match[2]}" if match[2] else value)
        elif line.strip():
            before.append(line)
        position = end + 1
    if len(before) < 2:
        raise source.error("line 1", "no line of numbers follows", COPY_AGAIN, reason="empty")
    said = f"no line of numbers; the last line reads {before[-1][:60]!r}"
    raise source.error("the file", said, "Export numbers between semicolons, tabs or commas, the time in seconds")


def _plain(name):
    """A name without case, accents, spaces and apostrophes.

    >>> _plain("Fréquence d’échantillonnage")
    'frequence_d_echantillonnage'
    """
    letters = unicodedata.normalize("NFKD", name.lower())
    return re.sub(r"[\s'’]", "_", "".join(c for c in letters if not unicodedata.combining(c)))


def _frequency(line):
    """The one frequency [Hz] that a line says, None where it says none, more, or that of a filter.

    >>> _frequency("# Vzorkovací kmitočet: 10 kHz"), _frequency("Tiefpass: 4000 Hz"), _frequency("0.5-10000 Hz")
    (10000.0, None, None)
    """
    match = FREQUENCY.match(line.strip())
    if not match or NO_RATE.search(line) or not (match[1] or match[3]):
        return None
    value = _value(f"{match[2]} {match[3] or match[1]}")
    return value if isinstance(value, float) else None


def _cells(line, separator):
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _is_number(cell):
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _value(text):
    """A number where the text begins with one ("51200 Hz", "12,8 kHz"), in Hz or s, else the text."""
    first, *rest = text.split() or [""]
    dated = "-" in first[1:].lower().replace("e-", "")
    if not first or not _is_number(first) or dated:
        return text
    return float(first.replace(",", ".")) * SCALES.get(rest[0].strip("[]()") if rest else "", 1.0)


def _names(lines, cells):
    """(names, units) out of the lines between head and the first numbers ``cells``: names, and perhaps units.

    A separator behind the last number, as in "1;2;", makes a column without a name.
    """
    count, open_end = len(cells), not cells[-1]
    lines = [(line + [""] * open_end)[:count] for line in lines if any(line) and len(line) >= count - open_end]
    if not lines:
        names = [str(i) for i in range(count)]
        return [*names[:-1], ""] if open_end and count > 1 else names, [""] * count
    at, below = names_among(lines)
    names = lines[at]
    units = [""] * count if below is None else [cell.strip("[]() ") for cell in lines[below]]
    for i, name in enumerate(names):
        if match := NAME_WITH_UNIT.match(name):
            names[i], units[i] = match[1], match[2]
    return names, units
