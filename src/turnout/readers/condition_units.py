"""Conditions with a quantity, as the rail temperature, converted from the unit that the file states beside them."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.metadata_names import CONDITION_QUANTITIES, TEMPERATURES
from turnout.readers.rate_statements import PLACEHOLDERS
from turnout.readers.rate_units import words_of
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.stated_numbers import number_and_unit
from turnout.readers.stated_units import known_unit
from turnout.readers.texts import decode_text
from turnout.readers.unit_names import conditions_of_unit

# Notations of units of temperature: "°C", "ºC", "oC", "deg. C", "degrees Celsius", "c".
TEMPERATURE_UNIT = re.compile(
    r"(?:[°º˚o]|deg(?:r(?:ees?)?)?\.?|grad(?:er|en|i)?)?[\s_]*(c|f|k)(?:elsius|ahrenheit|elvin)?", re.IGNORECASE
)
SCALES = {"c": "°C", "f": "°F", "k": "K"}
BESIDE_UNIT = re.compile(r"^(?:±|\+/-)\s*[\d.,]+\s*|(?<=[^\W\d_])\s*[(\[].*$")  # a tolerance and a note in brackets
SEPARATORS = "[]() \t;,|"  # between number and unit, and around it


def with_converted_conditions(record: RawRecord) -> RawRecord:
    """The record with its temperatures in °C and its speed in m/s.

    A number without a unit is in this unit already. A text without a number, or with another unit, is left as it is.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        The same record if nothing has to be converted.
    """
    of_entries = {name: e.value for e in record.entries if (name := _plain(e.name)) in TEMPERATURES}
    stated = {n: v for n, v in {**of_entries, **record.conditions}.items() if n in CONDITION_QUANTITIES}
    numbers = {name: _number_in_unit(name, value, record.entries) for name, value in stated.items()}
    converted = {name: number for name, number in numbers.items() if number is not None}
    converted |= {n: x for n, x in _temperatures_in_other_words(record.entries).items() if n not in stated}
    return replace(record, conditions={**record.conditions, **converted}) if converted else record


def _temperatures_in_other_words(entries: Sequence[Entry]) -> dict[str, float]:
    """Temperatures [°C] under names such as "Schienentemperatur", if all entries about one of them agree."""
    numbers: dict[str, set[float | None]] = {}
    for entry in entries:
        if name := read_temperature(entry):
            value = f"{entry.value} {_unit_in_name(entry.name)}" if _is_bare(entry.value) else entry.value
            numbers.setdefault(name, set()).add(_number_in_unit(name, value, ()))
    return {name: x for name, stated in numbers.items() if len(stated) == 1 and (x := next(iter(stated))) is not None}


def _is_bare(value: Any) -> bool:
    """Whether a value is a number without a unit."""
    stated = number_and_unit(str(value))
    return stated is not None and not stated[1]


def _unit_in_name(name: str) -> str:
    """The unit of a temperature in brackets or behind its name: "rail_temperature_f"; "" without one."""
    in_brackets = re.search(r"[\[(](.+)[\])]\s*$", name)
    unit = in_brackets[1] if in_brackets else re.split(r"[\s_]", name.strip())[-1]
    return unit if TEMPERATURE_UNIT.fullmatch(unit.strip()) else ""


def _number_in_unit(name: str, value: Any, entries: Sequence[Entry]) -> float | None:
    """A condition in the unit of its quantity; None where nothing has to be or can be converted."""
    text = (decode_text(value) if isinstance(value, bytes) else str(value)).replace("\u2212", "-")
    stated = number_and_unit(text) if isinstance(value, (str, bytes, int, float)) else None
    if stated is None:
        return None
    number, unit = stated
    beside = (str(e.value) for e in entries if name in conditions_of_unit(e.name))
    unit = (BESIDE_UNIT.sub("", unit).strip(SEPARATORS) or next(beside, "")).strip(SEPARATORS)
    if not unit:
        return number
    unit = unicodedata.normalize("NFKC", unit)  # "℃" is one character
    if match := TEMPERATURE_UNIT.fullmatch(unit):
        unit = SCALES[match[1].lower()]
    conversion = known_unit(unit)
    if conversion is None or conversion.dimension != CONDITION_QUANTITIES[name]:
        return None
    return number * conversion.scale + conversion.offset


@lru_cache(maxsize=4096)
def _plain(name: str) -> str:
    return re.sub(r"[ -]", "_", name.strip().lower())


def unread_conditions(conditions: Mapping[str, Any], entries: Sequence[Entry]) -> dict[str, str]:
    """Temperatures of which the file states no number in a known unit, and a speed in an unknown one.

    Parameters
    ----------
    conditions : mapping of str to any
        Conditions of a record.
    entries : sequence of Entry
        Its metadata, in which a condition may stand that the reader did not take for one.

    Returns
    -------
    dict of str to str
        Name -> text in the file.
    """
    of_entries = {_plain(e.name): e.value for e in entries}
    texts = {name: conditions.get(name, of_entries.get(name)) for name in TEMPERATURES}
    if isinstance(speed := conditions.get("speed"), str) and number_and_unit(speed):
        texts["speed"] = speed
    texts = {name: text.strip() for name, text in texts.items() if isinstance(text, str)}
    return {
        name: text for name, text in texts.items() if re.search(r"\w", text) and text.casefold() not in PLACEHOLDERS
    }


RANGES = {**dict.fromkeys(TEMPERATURES, (-60.0, 90.0)), "speed": (-200.0, 200.0)}  # °C of any climate; m/s of any train


def is_impossible(name: str, value: Any) -> bool:
    """Whether a condition can be no measured value: a code for a missing number, such as -999.

    Parameters
    ----------
    name : str
        Name of the condition.
    value : any
        Its value; a temperature in °C, a speed in m/s.

    Returns
    -------
    bool
        False for a text, and for conditions without a quantity.

    Examples
    --------
    >>> is_impossible("rail_temperature", -999.0), is_impossible("rail_temperature", 61.5), is_impossible("track", 999)
    (True, False, False)
    """
    if name not in RANGES or isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        return False
    low, high = RANGES[name]
    return bool(np.isfinite(value)) and not low <= value <= high


# Words for the conditions in other names, without case and accents: whole words, or these in one word.
TEMPERATURE_WORD = r"(?:temp|temperatur(?:e|en|a|y)?|temperaturen|teplot[ay]|lampotila|homerseklet)"
RAIL_OR_AIR = {
    "rail_temperature": r"(?:rails?|schienen?|skinnen?s?|skinner|voies?|kolejnice?|szyn[ay]?|spoor|spoorstaaf|carril"
    r"|rotai[ae]|kiskon?)",
    "air_temperature": r"(?:air|luft|lucht|vzduchu?|powietrza?|aria|aire|ilman?)",
}
# Words beside them that leave the meaning; with any other word it is the temperature of something else, or a limit.
BESIDE_TEMPERATURE = re.compile(
    r"measured|measurement|current|actual|mean|average|avg|value|reading|start|at|of|the|in|before|test"
    r"|deg|degc|degf|degrees?|grad|celsius|fahrenheit|kelvin|c|f|k|t|\d+|left|right|links|rechts"
    r"|gemessene?|aktuelle?|ist|mittel|mittlere|mittelwert|wert|messung|messwert|beginn|der|des|die|am|zu"
    r"|de|du|la|le|l|mesuree?|actuelle|moyenne|della?|dell|misurata|del|medida|malt|maalt|middel|zmerzona|namerena"
)
SPEED_WORD = r"speed|geschwind|vitesse|hastigh|rychlost|predkosc|velocidad|velocita|snelheid|nopeus"
OTHER_CONDITION = re.compile(
    r"neutral|verspann|stress|limit|max|min|alarm|sensor|unit|einheit|coef|koef|comp|komp|source|serial|date|channel|kanal"
    r"|line|strecke|wind(?!ig)|sound|schall|wave|welle|zulass|permit|design|disk|fan|motor|playback|sampl|tape"
)
# Words beside that of a speed that make it the one of a train.
TRAIN_WORD = re.compile(
    r"trains?|zug(?:es|s)?|zugs?geschwindigkeit|tog(?:et|ets)?|trein|vlaku?|pociagu?|tren[oi]?|junan?|vehicle|fahrzeug\w*"
    r"|fahrgeschwindigkeit|passage|vorbeifahrt\w*|locomotive|lok|wagon|wagen"
)


@lru_cache(maxsize=4096)
def _condition_in_other_words(name: str) -> tuple[str, bool]:
    """The condition of which a name speaks in other words, "Schienentemperatur", and whether it can mean no other.

    "" for none, and for the name that is read.
    """
    word, words = plain_word(name), words_of(name)
    if _plain(name) in CONDITION_QUANTITIES or re.search("[:=]", name) or OTHER_CONDITION.search(word):
        return "", False
    for condition, place in RAIL_OR_AIR.items():
        one_word = re.compile(f"{place}{TEMPERATURE_WORD}|{TEMPERATURE_WORD}{place}")
        is_named = any(map(one_word.fullmatch, words))
        apart = re.compile(f"{place}|{TEMPERATURE_WORD}")
        is_named |= any(re.fullmatch(place, w) for w in words) and any(re.fullmatch(TEMPERATURE_WORD, w) for w in words)
        if is_named:
            further = [w for w in words if not one_word.fullmatch(w) and not apart.fullmatch(w)]
            return condition, all(map(BESIDE_TEMPERATURE.fullmatch, further))
    if re.search(SPEED_WORD, word):
        further = [w for w in words if not re.fullmatch(SPEED_WORD + r"|geschwindigkeit|hastighed", w)]
        return "speed", not further or any(map(TRAIN_WORD.fullmatch, words))
    return "", False


def _is_speed(value: Any) -> bool:
    """Whether a value has a unit of speed."""
    stated = number_and_unit(value) if isinstance(value, str) else None
    unit = known_unit(stated[1]) if stated and stated[1] else None
    return unit is not None and unit.dimension == "velocity"


def read_temperature(entry: Entry) -> str:
    """The temperature that an entry states under another name that can mean nothing else.

    Parameters
    ----------
    entry : Entry
        Entry of the metadata.

    Returns
    -------
    str
        "" for that of something else, a limit, a correction and the like.

    Examples
    --------
    >>> names = "Schienentemperatur gemessen", "Rail laying temperature", "Trailer temperature"
    >>> [read_temperature(Entry("head", name, "23 °C")) for name in names]
    ['rail_temperature', '', '']
    """
    condition, is_certain = _condition_in_other_words(entry.name)
    return condition if is_certain and condition in TEMPERATURES and condition_of_entry(entry) else ""


def condition_of_entry(entry: Entry) -> str:
    """The condition that an entry may state under another name than the one that is read, perhaps something else.

    Parameters
    ----------
    entry : Entry
        Entry of the metadata.

    Returns
    -------
    str
        "" if its name speaks of none, or its value is no number in a unit of it.

    Examples
    --------
    >>> condition_of_entry(Entry("head", "Schienentemperatur", "12,5 °C"))
    'rail_temperature'
    """
    name, is_certain = ("", False) if entry.is_piece else _condition_in_other_words(entry.name)
    if not name or isinstance(entry.value, bool):
        return ""
    if name == "speed" and not is_certain and not _is_speed(entry.value):
        return ""  # of a disk, a line
    is_number = isinstance(entry.value, (int, float, np.number))
    is_stated = is_number or (isinstance(entry.value, str) and number_and_unit(entry.value) is not None)
    return name if is_stated else ""
