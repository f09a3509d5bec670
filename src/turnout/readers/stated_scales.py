"""Scales that a file states beside its numbers: they are applied where a standard defines them, else rejected by name.

A gain or an offset may already be in the numbers or not. Where nothing defines which, the numbers are used only if the
unit in the layout ends with "!".
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence, Set
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.entries import Entry, entries_of_text
from turnout.readers.scale_words import (
    FACTOR,
    NEUTRAL,
    OFFSET,
    POLYNOMIAL,
    POSSIBLY_FACTOR,
    POSSIBLY_OFFSET,
    is_fill_name,
    is_of_drawing,
    is_ratio_of_drawing,
    is_scale_name,
    plain_word,
    says_no_scale,
    scale_meaning,
    value_of_word,
)
from turnout.readers.source import MEANINGLESS_UNITS
from turnout.readers.statements import PLACEHOLDERS
from turnout.units import conversion, to_si

ROUND_YEARS = (2000.0, 2048.0, 2050.0)  # which are factors as well
YEARS = (1990.0, 2060.0)  # a whole number between them behind a word of calibration is a year


def without_drawings(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Metadata that stand at no channel, without the scale of a drawing.

    Parameters
    ----------
    facts : mapping of str to any
        Names and values.

    Returns
    -------
    dict of str to any
        The others.
    """
    return {name: value for name, value in facts.items() if not is_ratio_of_drawing(str(name), value)}


def scale_statements(facts: Mapping[str, Any], n_channel: int = 1) -> tuple[str, ...]:
    """What the metadata state about the scale of each channel, where it is not neutral.

    Parameters
    ----------
    facts : mapping of str to any
        Names and values of the metadata.
    n_channel : int
        Number of channels. A list with one value per channel applies to each, any other value to all.

    Returns
    -------
    tuple of str
        Text for each channel, as in "gain = 0.4"; "" where nothing or a neutral scale is stated. A value that is not
        understood is not neutral.

    Examples
    --------
    >>> scale_statements({"gain": [0.4, 1.0], "Offset": 0.0, "speed": 30.0}, 2)
    ('gain = 0.4', '')
    >>> scale_statements({"gain": "0dB", "Slope": "1:10"})
    ("Slope = '1:10'",)
    """
    texts: list[list[str]] = [[] for _ in range(n_channel)]
    names = {str(name).casefold() for name in facts}
    for name, value in facts.items():
        meaning = _meaning_among(str(name), names)
        if not meaning and isinstance(value, str):
            if is_of_drawing(str(name)):
                continue
            for inner, number in scales_in_text(value):
                for text, stated in zip(texts, _stated_by_channel(inner, scale_meaning(inner), number, n_channel)):
                    text.extend(stated)
            continue
        for text, stated in zip(texts, _stated_by_channel(str(name), meaning, value, n_channel)):
            text.extend(stated)
    return tuple(", ".join(text) for text in texts)


@lru_cache(maxsize=4096)
def scales_in_text(text: str) -> tuple[tuple[str, str], ...]:
    """Names and values of the scales in a free text, as in "gain 10, tip: steel"."""
    if len(text) > MAX_SCALE_TEXT or not re.search(r"[^\W\d]{3}.*\d", text):
        return ()
    entries = [e for e in entries_of_text(text, "") if scale_meaning(e.name)]
    return tuple((e.name, e.value) for e in entries if not is_ratio_of_drawing(e.name, e.value))


MAX_SCALE_TEXT = 400  # characters: a longer text is no note about an amplifier


def _meaning_among(name: str, names: Set[str]) -> str:
    """Kind of scale of a name beside others in lower case: "a0" beside "a1" are the coefficients of a polynomial."""
    if meaning := scale_meaning(name):
        return meaning
    plain = name.strip().casefold()
    if not POLYNOMIAL.fullmatch(plain) or not {f"{plain[0]}0", f"{plain[0]}1"} <= names:
        return ""
    return POSSIBLY_FACTOR if plain[1] == "1" else POSSIBLY_OFFSET


def _stated_by_channel(label: str, meaning: str, value: Any, n_channel: int) -> list[list[str]]:
    """Texts of the scales that one entry states for each channel, without neutral ones."""
    if not meaning:
        return [[] for _ in range(n_channel)]
    neutral = NEUTRAL[meaning]
    if (words := _words(value, meaning)) is not None:
        stated = [f"{label} = {_value_text(v)}" if number != neutral else "" for v, number in words]
    else:
        values = _scale_values(value)
        if meaning not in (FACTOR, OFFSET):
            values = [x if isinstance(x, float) and not _is_year(x) else _ratio(x, neutral) for x in values]
        stated = [_scale_text(label, x, neutral) for x in values]
    if len(stated) == n_channel:
        return [[text] if text else [] for text in stated]
    return [list(filter(None, dict.fromkeys(stated))) for _ in range(n_channel)]


def _words(value: Any, meaning: str) -> list[tuple[Any, float]] | None:
    """(value, factor) of each value under a name of an inversion, a prefix or an exponent; else None."""
    values = value.ravel().tolist() if isinstance(value, np.ndarray) else value
    values = values if isinstance(values, (list, tuple)) else [values]
    pairs = [(v, value_of_word(meaning, v)) for v in values[:MAX_CHANNELS]]
    return [(v, number) for v, number in pairs if number is not None] if pairs and pairs[0][1] is not None else None


def _value_text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else repr(str(value)[:40])


def _is_year(number: float) -> bool:
    return number.is_integer() and YEARS[0] < number < YEARS[1] and number not in ROUND_YEARS


def _ratio(value: float | str, neutral: float) -> float:
    """The number of a text such as "x10", "1:10" and "10 mV/pC"; ``neutral`` for any other text."""
    match = re.fullmatch(
        r"(?:[x×]|1 ?[:/] ?)?(\d+(?:[.,]\d+)?)(?: ?[:/] ?1| ?[^\s\d/]{1,5}/[^\s\d]{1,8})?",
        str(value).strip().casefold(),
    )
    return float(match[1].replace(",", ".")) if match and isinstance(value, str) else neutral


def _scale_text(label: str, value: float | str, neutral: float) -> str:
    """Text of one scale, as in "gain = 0.4"; "" for a neutral one."""
    if isinstance(value, str):
        return f"{label} = {value[:40]!r}"
    return "" if value == neutral or math.isnan(value) else f"{label} = {value:g}"


def _scale_values(value: Any) -> list[float | str]:
    """Numbers of a stated scale; a text that is not understood stays a text. Empty for an array of samples."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, (bool, np.bool_)):
        return ["true"] if value else []
    if isinstance(value, str):
        return _scales_of_text(value)
    numbers = _numbers(value)
    if numbers is not None:
        return [float(x) for x in numbers]
    if isinstance(value, np.ndarray):
        value = value.ravel().tolist() if value.dtype.kind in "SUOf" else []
    if isinstance(value, (list, tuple)) and len(value) <= MAX_CHANNELS:
        return [cells[0] if len(cells) == 1 else str(x) for x in value if (cells := _scale_values(x) or [math.nan])]
    return [str(value)] if isinstance(value, (float, np.floating)) and not np.isnan(value) else []


NO_SCALE = PLACEHOLDERS | {"unity", "linear", "off", "1:1", "1/1"}
NUMBER_AND_UNIT = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)")


def _number_and_unit(text: str) -> tuple[float, str] | None:
    """The number at the beginning of a text and what follows; None without one. A comma is a decimal mark."""
    match = NUMBER_AND_UNIT.fullmatch(text.strip())
    return (float(match[1].replace(",", ".")), match[2].strip()) if match else None


def _scales_of_text(text: str) -> list[float | str]:
    """Scales of a text: one number with its unit, or a list of these; pieces that are not understood stay texts."""
    pieces = text.strip().strip(";").split(";")
    if len(pieces) == 1 and (numbers := _numbers(text)) is not None and not re.search(r"[^\d\s.,;eE+-]", text):
        return [float(x) for x in numbers]
    return [_scale_of_piece(piece.strip()) for piece in pieces if len(pieces) > 1 or piece.strip()]


def _scale_of_piece(text: str) -> float | str:
    """The number of a scale; the text itself if it is not understood, nan if it says that there is none."""
    if text.casefold() in NO_SCALE or says_no_scale(text):
        return math.nan
    parts = _number_and_unit(text)
    if parts is None:
        return text
    number, unit = parts
    if unit.casefold() == "db":
        return 10 ** (number / 20)
    if unit.casefold() in ("x", "\u00d7", *MEANINGLESS_UNITS) or (not number and re.match(r"[^\W\d]|[%°(\[]", unit)):
        return number
    try:
        factors = [conversion(part.strip(" ()")).scale for part in unit.strip("[]").split("/", 1)]
    except ValueError:
        try:
            factors = [conversion(unit).scale]
        except ValueError:
            return text
    return number * factors[0] / (factors[1] if len(factors) > 1 else factors[0])


def entry_statements(entries: Iterable[Entry], names: Sequence[str]) -> dict[int, str]:
    """Problems of a message about the scales that entries of the metadata state, nested ones too.

    Each entry is judged by itself. An entry concerns the channel that its place or an entry beside it names, else all;
    it overrules one of the same name in a group above only for a channel that it names.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata that concern the channels.
    names : sequence of str
        Names of the channels.

    Returns
    -------
    dict of int to str
        Index of the channel -> problem; without channels of which nothing or a neutral scale is stated.
    """
    entries = list(entries)
    texts_beside = [
        Entry(entry.place, name, value)
        for entry in entries
        if isinstance(entry.value, str) and not is_scale_name(entry.name) and not is_of_drawing(entry.name)
        for name, value in scales_in_text(entry.value)
    ]
    entries = [*entries, *texts_beside]
    scales = [(entry, _scale_name(entry, names)) for entry in entries]
    scales = [(entry, name) for entry, name in scales if name]
    if not scales:
        return {}
    plain_names = {name.strip().casefold() for _, name in scales}
    texts: list[list[str]] = [[] for _ in names]
    named = [(entry, name, container_of(entry), owners_of(entry, entries, names)) for entry, name in scales]
    named = [n for n in named if n[3] or not is_ratio_of_drawing(n[1], n[0].value)]
    for entry, name, container, owners in named:
        label = entry.name if entry.name == name else f"{name} of {entry.name}"
        meaning = _meaning_among(name, plain_names)
        stated = _stated_by_channel(label, meaning, entry.value, 1 if owners else len(names))
        for i, text in enumerate(texts):
            if owners and i not in owners:
                continue
            is_overruled = any(
                i in inner and plain_word(inner_name) == plain_word(name) and _is_inside(inner_container, container)
                for _, inner_name, inner_container, inner in named
            )
            if not is_overruled:
                text.extend(stated[0 if owners else i])
    return {i: scale_problem(", ".join(dict.fromkeys(text))) for i, text in enumerate(texts) if text}


def _scale_name(entry: Entry, names: Sequence[str]) -> str:
    """The name of a scale under which an entry is: its own, or that of its group if the entry is called as a channel.

    "" if it states no scale.
    """
    if is_scale_name(entry.name) or POLYNOMIAL.fullmatch(plain := entry.name.strip().casefold()):
        return entry.name
    if not any(plain == name.strip().casefold() for name in names):
        return ""
    group = container_of(entry).rpartition("/")[2]
    return group if is_scale_name(group) else ""


def container_of(entry: Entry) -> str:
    """The place of an entry without its own name."""
    return entry.place.removesuffix(entry.name).rstrip("/: ")


def _is_inside(inner: str, outer: str) -> bool:
    """Whether a place lies in a group of another place."""
    return inner != outer and inner.startswith(f"{outer}/" if outer else "")


def owners_of(entry: Entry, entries: Sequence[Entry], names: Sequence[str]) -> frozenset[int]:
    """Indices of the channels that the place of an entry, its name or a text beside it name; empty without any."""
    if owners := named_channels(f"{entry.place} {entry.name}", names):
        return owners
    container = container_of(entry)
    if not container:
        return frozenset()
    beside = {
        other.value.strip().casefold()
        for other in entries
        if isinstance(other.value, str) and container_of(other) == container
    }
    return frozenset(i for i, name in enumerate(names) if name.strip().casefold() in beside)


def named_channels(text: str, names: Sequence[str]) -> frozenset[int]:
    """Channels whose name is in a text, word by word; of "rail" and "rail 2" the longer one counts.

    Parameters
    ----------
    text : str
        Place and name of an entry.
    names : sequence of str
        Names of the channels; those of digits only are not searched.

    Returns
    -------
    frozenset of int
        Indices of the channels.

    Examples
    --------
    >>> sorted(named_channels("sensors/rail 2/gain", ["rail", "rail 2", "force"]))
    [1]
    """
    return _named_channels(text, tuple(names))


@lru_cache(maxsize=4096)
def _named_channels(text: str, names: tuple[str, ...]) -> frozenset[int]:
    words = f" {_words_of(text)} "
    spaced = {i: name for i, name in enumerate(map(_words_of, names)) if name and not name.isdigit()}
    found = {i: name for i, name in spaced.items() if f" {name} " in words}
    return frozenset(
        i
        for i, name in found.items()
        if not any(f" {name} " in f" {other} " and name != other for other in found.values())
    )


@lru_cache(maxsize=4096)
def _words_of(text: str) -> str:
    """Words of a text in lower case with one blank between them."""
    return " ".join(re.split(r"[\W_]+", text.casefold())).strip()


def scale_text(facts: Mapping[str, Any]) -> str:
    """``scale_statements`` of one channel as the problem of a message.

    Parameters
    ----------
    facts : mapping of str to any
        Names and values of the metadata of the channel.

    Returns
    -------
    str
        The problem; "" where nothing or a neutral scale is stated.
    """
    (text,) = scale_statements(facts)
    return scale_problem(text)


def scale_problem(statement: str) -> str:
    """The problem of a message about a stated scale.

    Parameters
    ----------
    statement : str
        As ``scale_statements`` returns it.

    Returns
    -------
    str
        The problem; "" for "".
    """
    return f"the file states {statement}, and nothing says whether its numbers already contain it" if statement else ""


def _numbers(value: Any) -> np.ndarray | None:
    """The finite numbers of a value, (n,); None if it holds none or is an array of samples."""
    if isinstance(value, str):
        cells = re.split(r"[;\s]+", value.strip())
        listed = len(cells) == 1 and (value.count(",") > 1 or "." in value)  # else a comma is the decimal mark
        value = cells[0].split(",") if listed else [cell.replace(",", ".") for cell in cells]
        if len(value) > 1 and not re.match(r"[+-]?\.?\d", value[1]):  # a number with its unit
            number = _numbers(value[0])
            is_level = number is not None and value[1].casefold() == "db"
            return 10 ** (number / 20) if is_level and number is not None else number
    if not isinstance(value, (int, float, list, tuple, np.ndarray, np.generic)) or isinstance(value, bool):
        return None
    try:
        numbers = np.ravel(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        return None
    return numbers if 0 < numbers.size <= MAX_CHANNELS and np.isfinite(numbers).all() else None


MAX_CHANNELS = 64  # a longer array is no list of scales but one of samples


SENSITIVITY = re.compile(r"sensitiv|empfindlich|sensibi|folsom|gevoelig")
# What is beside a sensitivity: the frequency and the day at which it was measured, its tolerance, that of the trigger.
BESIDE_SENSITIVITY = re.compile(r"trigger|seuil|freq|toler|temp|date|datum|uncertain|unsicher|deviation|abweich")
# Words beside that of the sensitivity that speak of no sensor in particular, without case and accents.
GENERAL_WORDS = frozenset(
    "sensor sensors transducer channel channels kanal kanale capteur aufnehmer sensitivity nominal calibrated "
    "calibration kalibriert nenn value wert of the der des du de".split()
)
# Words for the sensors of a quantity.
SENSOR_WORDS = {
    "force": re.compile(r"hammer|force|kraft|load"),
    "acceleration": re.compile(r"acc|beschl"),
    "velocity": re.compile(r"velocity|geophon|geschw|vitesse"),
    "displacement": re.compile(r"displ|deflection|weg"),
    "strain": re.compile(r"strain|dehnung"),
}
MAX_SENSITIVITY_DEVIATION = 0.1  # relative: a certificate and a logger's nominal sensitivity differ by less
PREFIX_RATIOS = tuple(10.0**p for p in (-6, -3, 0, 3, 6))  # of units of one sensitivity


def fill_values(entries: Iterable[Entry], names: Sequence[str]) -> tuple[tuple[float, ...], ...]:
    """Numbers that stand for a missing sample of each channel, as the metadata state.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.
    names : sequence of str
        Names of the channels.

    Returns
    -------
    tuple of tuple of float
        For each channel the values of the entries that are named like a fill value and concern it.

    Examples
    --------
    >>> fill_values([Entry("head", "_FillValue", -999), Entry("rail/NoData", "NoData", -1)], ["force", "rail"])
    ((-999.0,), (-999.0, -1.0))
    """
    entries = list(entries)
    fills: list[list[float]] = [[] for _ in names]
    for entry in entries:
        if not is_fill_name(entry.name) or (numbers := _numbers(entry.value)) is None:
            continue
        owners = owners_of(entry, entries, names)
        for i, fill in enumerate(fills):
            if not owners and numbers.size == len(names):
                fill.append(float(numbers[i]))
            elif not owners or i in owners:
                fill.extend(map(float, numbers))
    return tuple(map(tuple, fills))


def sensitivity_entries(entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """Entries of the metadata that state the sensitivity of a sensor.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.

    Returns
    -------
    tuple of Entry
        Without those about a trigger, a frequency, a tolerance, a temperature or a date.
    """
    words = ((entry, plain_word(entry.name)) for entry in entries)
    return tuple(e for e, word in words if SENSITIVITY.search(word) and not BESIDE_SENSITIVITY.search(word))


def sensitivity_problem(
    entries: Iterable[Entry], sensitivity: float, unit: str, quantity: str, names: Sequence[str] = ("",), index: int = 0
) -> str:
    """The problem of a message if the metadata state sensitivities of a channel and none is that of the layout.

    Only entries count whose unit can be that of the quantity, or that belong to the channel.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.
    sensitivity : float
        Sensitivity of the channel in the layout.
    unit : str
        Its unit.
    quantity : str
        Quantity of the channel in the layout.
    names : sequence of str
        Names of the channels of the file.
    index : int
        The channel among them.

    Returns
    -------
    str
        "" if the file states none, or one that agrees within a tenth; without a unit, up to a prefix such as "m".

    Examples
    --------
    >>> stated = [Entry("head", "Sensitivity", "10.2 mV/(m/s²)")]
    >>> sensitivity_problem(stated, 100.0, "mV/g", "acceleration")
    ''
    >>> bool(sensitivity_problem(stated, 35.3, "mV/g", "acceleration"))
    True
    """
    entries = list(entries)
    compared: list[Entry] = []
    for entry in sensitivity_entries(entries):
        owners = owners_of(entry, entries, names)
        if owners and index not in owners:
            continue
        for number, own_unit in _sensitivities(entry):
            agrees = _agrees(number, own_unit, sensitivity, unit, quantity, bool(owners), entry)
            if agrees:
                return ""
            if agrees is False:
                compared.append(entry)
    if not compared:
        return ""
    listed = "; ".join(dict.fromkeys(f"{entry.name}: {entry.value}" for entry in compared[:3]))
    return f"the file states {listed[:100]!r}, and the layout's sensitivity of {sensitivity:g} {unit} is none of these"


def _sensitivities(entry: Entry) -> list[tuple[float, str]]:
    """Numbers of an entry with their unit: behind the number, else in brackets behind the name, else ""."""
    in_name = re.search(r"[\[(](.+)[\])]\s*$", entry.name)
    unit = in_name[1] if in_name else ""
    parts = _number_and_unit(entry.value) if isinstance(entry.value, str) else None
    if parts and re.match(r"[^\d\s.,;+-]", parts[1]):
        return [(parts[0], parts[1].replace(" per ", "/"))] if parts[0] else []
    numbers = _numbers(entry.value)
    return [] if numbers is None else [(float(x), unit) for x in numbers if x]


def _agrees(
    number: float, own_unit: str, sensitivity: float, unit: str, quantity: str, is_own: bool, entry: Entry
) -> bool | None:
    """Whether a stated sensitivity is that of the layout; None if it cannot be compared or is of another sensor."""
    if not own_unit:
        if not is_own and not _is_general(entry.name, quantity):
            return None
        ratio = abs(number) / sensitivity
        is_tenfold = abs(ratio / 10.0 ** round(math.log10(ratio)) - 1.0) <= MAX_SENSITIVITY_DEVIATION
        # Where the ratio is a power of ten, the reciprocal would make a factor of ten look like another unit.
        ratios = (ratio,) if is_tenfold else (ratio, 1.0 / (abs(number) * sensitivity))
        return any(abs(r / prefix - 1.0) <= MAX_SENSITIVITY_DEVIATION for r in ratios for prefix in PREFIX_RATIOS)
    stated, in_layout = _sensitivity_scale(quantity, number, own_unit), _sensitivity_scale(quantity, sensitivity, unit)
    if stated and in_layout:
        same_kind = stated[0] == in_layout[0]
        return abs(stated[1] / in_layout[1] - 1.0) <= MAX_SENSITIVITY_DEVIATION if same_kind else None
    is_of_other_quantity = any(_sensitivity_scale(other, number, own_unit) for other in SENSOR_WORDS)
    return False if is_own and is_of_other_quantity else None


def _sensitivity_scale(quantity: str, number: float, unit: str) -> tuple[str, float] | None:
    """(electrical unit, SI per electrical unit) of a sensitivity; None if the unit is none of the quantity."""
    for electrical in ("V", "count"):
        try:
            return electrical, to_si(quantity, electrical, abs(number), unit).scale
        except ValueError:
            continue
    return None


def _is_general(name: str, quantity: str) -> bool:
    """Whether the name of a sensitivity speaks of no other sensor than one of the quantity."""
    words = [plain_word(word) for word in _words_of(re.sub(r"[\[(].*?[\])]", "", name)).split()]
    specific = [w for w in words if w not in GENERAL_WORDS and not SENSITIVITY.search(w) and not w.isdigit()]
    return not specific or any(SENSOR_WORDS[quantity].search(w) for w in specific if quantity in SENSOR_WORDS)


def remedy(unit: str) -> str:
    """What to do about a scale of which nothing says whether it was applied.

    Parameters
    ----------
    unit : str
        Unit that the file states, "" without one.

    Returns
    -------
    str
        The advice, without its full stop.
    """
    label = unit.strip() or "N"
    return (
        f"Find out in the logger's manual whether its numbers already contain it; if they do, set unit: '{label}!' for "
        f"this channel in the layout, else the value of one step, such as unit: '0.4 {label}!'"
    )


def apply_packing(numbers: Sequence | np.ndarray, factor: float, offset: float, fills: Sequence[float]) -> np.ndarray:
    r"""Unpack numbers by the climate and forecast (CF) conventions of netCDF, section 8.1.

    .. math:: x = s p + o, \qquad x = \mathrm{nan} \quad \mathrm{where}\ p\ \mathrm{is\ a\ fill\ value}

    Parameters
    ----------
    numbers : (n,) array
        Packed numbers p.
    factor, offset : float
        ``scale_factor`` s and ``add_offset`` o. [unit of the file]
    fills : sequence of float
        Values that stand for a missing sample.

    Returns
    -------
    (n,) array of float
        x. [unit of the file]

    Examples
    --------
    >>> apply_packing(np.array([10, -99], dtype="int16"), 0.5, 1.0, [-99])
    array([ 6., nan])
    """
    packed = np.asarray(numbers)
    unpacked = packed * float(factor) + float(offset)
    for fill in fills:
        unpacked[packed == fill] = np.nan
    return unpacked
