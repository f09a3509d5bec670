"""Conditions with a quantity, as the rail temperature, converted from the unit that the file states beside them."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from turnout.readers.entries import Entry
from turnout.readers.metadata_names import CONDITION_QUANTITIES, TEMPERATURES
from turnout.readers.rate_statements import PLACEHOLDERS
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
    return replace(record, conditions={**record.conditions, **converted}) if converted else record


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
