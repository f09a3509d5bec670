"""Physical quantity that a file states for a channel: a channel of another quantity in the layout is an error."""

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import owners_of
from turnout.readers.rate_units import words_of
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.texts import decode_text
from turnout.units import conversion

# Names of entries that state the quantity of the numbers, and of the sensor or channel, whose numbers may be volts.
QUANTITY_OF_NUMBERS = re.compile(r"quantit(?:y|at|e|a)|measurand|messgro|grandeur|grandezza|storrelse|magnitud")
QUANTITY_OF_SENSOR = re.compile(
    r"(?:measurement|channel|sensor|signal|transducer|kanal|aufnehmer)(?:type|typ|kind|art)|messart"
)
DEFINED_NAME = "quantity of the numbers"  # under which a reader states what its format defines
# Beginnings of words for the quantities of sensors.
QUANTITY_WORDS = {
    "force": ("force", "kraft", "kracht", "fuerza", "forza", "loadcell"),
    "acceleration": ("acc", "beschl", "acel", "versnelling"),
    "velocity": ("velocity", "geschw", "vitesse", "hastighed", "velocid", "velocita", "snelheid", "geophon"),
    "displacement": ("displac", "verschieb", "wegauf", "deplac", "forskydning", "desplaz", "spostam", "deflection"),
    "strain": ("strain", "dehnung", "tojning"),
    "voltage": ("volt", "spannung", "spaending", "tensione", "electricpot"),
}
MAX_TEXT = 40  # characters: a longer text is a description


@lru_cache(maxsize=4096)
def is_quantity_name(name: str) -> bool:
    """Whether an entry of this name states a physical quantity.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
        False for a count, as in "sample quantity".

    Examples
    --------
    >>> [is_quantity_name(n) for n in ("Physical quantity", "Messgröße", "sensor_type", "Samples")]
    [True, True, True, False]
    """
    word = plain_word(name)
    return bool(QUANTITY_OF_NUMBERS.search(word) or QUANTITY_OF_SENSOR.search(word))


@lru_cache(maxsize=4096)
def quantity_of_text(text: str) -> str:
    """The only physical quantity of which a short text speaks, "" for none or several.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    str
        A quantity of ``QUANTITY_WORDS``.

    Examples
    --------
    >>> [quantity_of_text(text) for text in ("IEPE accelerometer", "Wegaufnehmer", "force / acceleration")]
    ['acceleration', 'displacement', '']
    """
    words = words_of(text) if len(text) <= MAX_TEXT else ()
    found = {q for q, starts in QUANTITY_WORDS.items() if any(w.startswith(starts) for w in (*words, "".join(words)))}
    return found.pop() if len(found) == 1 else ""


def quantity_entries(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Entries of the metadata that state physical quantities.

    Parameters
    ----------
    entries : sequence of Entry
        Metadata of a record.

    Returns
    -------
    tuple of Entry
        Those under a name of a quantity.
    """
    return tuple(e for e in entries if is_quantity_name(e.name))


def contradicting_quantity(record: RawRecord, index: int, quantity: str, unit: str) -> str:
    """The quantity that the file states for a channel, if it contradicts the layout.

    Parameters
    ----------
    record : RawRecord
        The record.
    index : int
        The channel.
    quantity : str
        Quantity of the channel in the layout.
    unit : str
        Unit in use, "" if not known.

    Returns
    -------
    str
        The quantity; "" if none is stated for this channel, or it agrees.
    """
    if quantity not in QUANTITY_WORDS:
        return ""
    for entry in quantity_entries(record.entries):
        stated = _quantity_of_channel(entry, record, index)
        if stated == "voltage":
            if QUANTITY_OF_NUMBERS.search(plain_word(entry.name)) and _dimension(unit) == quantity:
                return stated
        elif stated and stated != quantity:
            return stated
        elif stated and entry.name == DEFINED_NAME and _dimension(unit) in ("voltage", "count"):
            return stated
    return ""


def _quantity_of_channel(entry: Entry, record: RawRecord, index: int) -> str:
    """The quantity that an entry states for a channel; "" if it belongs to another one or to none."""
    values = texts_of_value(entry.value)
    if len(values) == len(record.names) > 1:
        return quantity_of_text(values[index])
    owners = owners_of(entry, record.entries, record.names)
    return quantity_of_text(values[0]) if len(values) == 1 and owners == {index} else ""


def texts_of_value(value: Any) -> list[str]:
    """The texts of a value.

    Parameters
    ----------
    value : any
        Value of an entry: a text, or a list or an array with texts.

    Returns
    -------
    list of str
        Without what is no text.
    """
    values = value.ravel().tolist() if hasattr(value, "ravel") else value
    values = values if isinstance(values, (list, tuple)) else [values]
    return [decode_text(v) if isinstance(v, bytes) else str(v) for v in values if isinstance(v, (str, bytes))]


def _dimension(unit: str) -> str:
    try:
        return conversion(unit).dimension
    except ValueError:
        return ""
