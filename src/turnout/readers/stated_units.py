"""Units that a file states in its metadata or in the names of its channels, by general rules for all formats.

A unit stands where the format defines it, under a word for a unit ("Einheit", "y_unit", "EU"), alone under the name or
the number of a channel ("CH1 [kN]", "rail: g"), in brackets in the name of a channel, or as a word of that name
("rail_g", "rail_g_2"). A unit of the layout must agree with it.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from turnout.readers.entries import FREE_TEXT, MAX_ENTRIES, Entry
from turnout.readers.entry_owners import CHANNEL, container_of, numbered_channels, owners_of, spaced_words
from turnout.readers.rate_units import RateUnit, rate_unit, words_of
from turnout.readers.source import MEANINGLESS_UNITS, RawRecord
from turnout.readers.texts import readings_together
from turnout.readers.unit_names import conditions_of_unit, is_unit_name
from turnout.unit_spellings import BRACKETS_IN_ASCII
from turnout.units import Conversion, conversion, is_of_a_stretch

# Units of the same channel at another place of its measuring chain.
CHAIN_WORDS = frozenset("raw sensor input electrical signal native adc hardware transducer description roh".split())
# In brackets anywhere in a name, of which the last one may be cut off.
UNIT_IN_NAME = re.compile(r"[\[({<|]\s*([^\[\](){}<>|]+?)\s*(?:[\])}>|]|$)")
SEPARATORS = re.compile(r"[\s_./:;,=|@*\"'-]+")  # of the words of a name
# A range, a distance or a sensitivity: "5 kN hammer", "rail 50g 2", "mV/g rail". The 2 of "rail_2_g_raw" is a number.
AMOUNT = re.compile(r"(?:^|(?<=\s))(?:[±+-]?\d+(?:[.,]\d+)?\s?[^\W\d_][^\s_]*|[mµu]?V/[^\s_]+)")
MAX_UNIT_TEXT = 60  # characters of a text that may be the name of a channel and a unit
LEVEL = re.compile(r"dB")
# The sensitivity of a sensor in a name, "rail 100 mV/g": its unit is none of the samples.
SENSITIVITY_IN_NAME = re.compile(
    r"(?<![^\W_])(?<!\d[.,])(\d+(?:[.,]\d+)?\s?(?:[mµ\u03bcu]?V|p?C)\s?(?:/|per)\s?"
    r"(?!count|lsb|bit|digit|div)(?:\([^()]*\)|[^\W\d_][^\s\[\](){}<>|_;,]*))"
)

# Its unit alone, "rail mV/(m/s²)".
SENSITIVITY_UNIT_IN_NAME = re.compile(r"(?<![^\W_])(?:[mµ\u03bcu]?V|p?C)\s?/\s?\([^()]*\)")


@lru_cache(maxsize=4096)
def _words(name: str) -> frozenset[str]:
    return frozenset(words_of(name))


@lru_cache(maxsize=4096)
def known_unit(unit: str) -> Conversion | None:
    """Conversion of a unit.

    Parameters
    ----------
    unit : str
        Unit as it is written.

    Returns
    -------
    Conversion or None
        None for a unit that is not known.
    """
    try:
        return conversion(unit)
    except ValueError:
        return None


def decoded_units(units: Sequence[str]) -> tuple[str, ...]:
    """Units of which some were decoded wrongly, in the encoding of an older program in which all are known.

    Parameters
    ----------
    units : sequence of str
        Units of a file as they were decoded.

    Returns
    -------
    tuple of str
        Unchanged if all are known or in ASCII, or if no encoding or several give other known units.

    Examples
    --------
    >>> decoded_units(["N", "m/sý", "øC"]), decoded_units(["Í"])  # of DOS; "Í" may be "Н" or "м"
    (('N', 'm/s²', '°C'), ('Í',))
    """
    unknown = [unit for unit in units if not (unit.isascii() or _meaning(unit))]
    known_readings = [reading for reading in readings_together(unknown) if all(map(_meaning, reading))]
    if len({tuple(map(_meaning, reading)) for reading in known_readings}) != 1:
        return tuple(units)
    right = dict(zip(unknown, known_readings[0]))
    return tuple(right.get(unit, unit) for unit in units)


def _meaning(unit: str) -> Conversion | RateUnit | None:
    """Conversion of a unit of samples, or a unit of time or rate; None for one that is not known."""
    return known_unit(unit) or rate_unit(unit)


@lru_cache(maxsize=4096)
def is_meaningless(unit: str) -> bool:
    """Whether a label is no unit: a placeholder, or a number that some loggers write there.

    Parameters
    ----------
    unit : str
        Label of a unit.

    Returns
    -------
    bool
        True for "", "EU", "none", "1.0" and the like.
    """
    plain = unit.strip().strip("[]").strip()
    return plain.casefold() in MEANINGLESS_UNITS or plain.replace(".", "", 1).isdigit()


@lru_cache(maxsize=4096)
def same_unit(first: str, second: str) -> bool:
    """Whether two units are equal; the value of one count, as in "0.3 mV", counts as its unit.

    Parameters
    ----------
    first, second : str
        Units as they are written.

    Returns
    -------
    bool
        False if one of them is not known.

    Examples
    --------
    >>> same_unit("m/s^2", "m/s²"), same_unit("g", "m/s²"), same_unit("0.3 mV", "mV")
    (True, False, True)
    """
    a, b = (known_unit(re.sub(r"^[\d.eE+-]+ *(?=[^\W\d]|[°%])", "", unit.strip())) for unit in (first, second))
    return a is not None and b is not None and a.dimension == b.dimension and abs(a.scale / b.scale - 1.0) < 1e-9


def with_decoded_units(record: RawRecord) -> RawRecord:
    """The record with the units of its channels in the encoding in which they are known.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        The same record if all units are known, or unknown in every encoding.
    """
    units = decoded_units(record.units)
    return replace(record, units=units) if units != record.units else record


def with_stated_units(record: RawRecord) -> RawRecord:
    """The record with the units of its metadata and names for the channels whose format states none.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        With each known unit that belongs to a single channel.
    """
    if not any(is_meaningless(unit) for unit in record.units):
        return record
    entries = unit_entries(record.entries)
    units = tuple(
        next((u for u in own_units(record, i, entries)[0] if known_unit(u)), unit) if is_meaningless(unit) else unit
        for i, unit in enumerate(record.units)
    )
    return record if units == record.units else replace(record, units=units)


def unit_entries(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Entries of the metadata that state units.

    Parameters
    ----------
    entries : sequence of Entry
        Metadata of a record.

    Returns
    -------
    tuple of Entry
        Those under a name of a unit, in a group of that name, or with a unit alone as their value.
    """
    return tuple(e for e in entries if _states_unit(e.place, e.name) or _unit_alone(e))


def _unit_alone(entry: Entry) -> tuple[str, str] | None:
    """Name and unit of an entry whose value is a unit alone, as "CH1: kN", or of a text like "CH1 [kN]"."""
    is_text = isinstance(entry.value, str) and len(entry.value) <= MAX_UNIT_TEXT
    return _name_and_unit(entry.name, entry.value) if is_text and not entry.is_piece else None


@lru_cache(maxsize=4096)
def _name_and_unit(name: str, text: str) -> tuple[str, str] | None:
    if name == FREE_TEXT:
        name, _, text = text.replace("(", "[", 1).partition("[")
    unit = text.strip("[]() ")
    return (name, unit) if known_unit(unit) else None


def _owners_by_name(name: str, record: RawRecord) -> frozenset[int]:
    """The channels whose name or number is a name, without other words."""
    words = spaced_words(name)
    if owners := frozenset(i for i, other in enumerate(record.names) if other and spaced_words(other) == words):
        return owners
    is_number = bool(CHANNEL.fullmatch(name.strip()))
    return numbered_channels(name, record.entries, len(record.names)) if is_number else frozenset()


@lru_cache(maxsize=4096)
def _states_unit(place: str, name: str) -> bool:
    return is_unit_name(name) or is_unit_name(container_of(Entry(place, name, None)).rpartition("/")[2])


def own_units(record: RawRecord, index: int, entries: Sequence[Entry]) -> tuple[list[str], list[str]]:
    """Units that are stated for a channel, and those that may be.

    Parameters
    ----------
    record : RawRecord
        The record.
    index : int
        The channel.
    entries : sequence of Entry
        As ``unit_entries`` returns them.

    Returns
    -------
    tuple of (list of str, list of str)
        Units of the channel: of its entries and in brackets in its name. Then those of its measuring chain, of no
        channel in particular, and the words of its name.
    """
    name, n = record.names[index], len(record.names)
    certain: list[str] = []
    possible: list[str] = []
    for entry in entries:
        if not _states_unit(entry.place, entry.name):
            of_channel, unit = _unit_alone(entry) or ("", "")
            certain.extend([unit] if index in _owners_by_name(of_channel, record) else [])
            continue
        texts = _texts(entry.value)
        owners = owners_of(entry, record.entries, record.names)
        owners = owners or numbered_channels(entry.name, record.entries, n)
        if of_conditions := {text.rpartition("_")[2] for text in conditions_of_unit(entry.name)}:
            owners = frozenset(i for i in owners if not of_conditions.isdisjoint(words_of(record.names[i])))
            if not owners:
                continue
        in_chain = bool(_words(entry.name) & CHAIN_WORDS)
        if owners and len(texts) == 1:
            if index in owners:
                (possible if in_chain or len(owners) > 1 else certain).extend(texts)
        elif len(texts) == n:  # in the order of the channels, unless the format has assigned them
            (certain if not in_chain and is_meaningless(record.units[index]) else possible).append(texts[index])
        else:
            possible.extend(texts)
    name, *all_names = (_without_sensitivity(of_channel) for of_channel in (name, *record.names))
    in_brackets = [u for u in UNIT_IN_NAME.findall(name.translate(BRACKETS_IN_ASCII)) if not re.match(r"[+-]?[\d.]", u)]
    in_brackets = [u for u in in_brackets if known_unit(u) or LEVEL.match(u) or is_of_a_stretch(u)]
    certain.extend(in_brackets)
    if not in_brackets:
        bare, *names = (UNIT_IN_NAME.sub("", of_channel).strip() for of_channel in (name, *all_names))
        possible.extend(_units_in_words(bare, names))
    return [u for u in certain if not is_meaningless(u)], [u for u in possible if not is_meaningless(u)]


def _without_sensitivity(name: str) -> str:
    """A name without the sensitivity of a sensor in it, and without what separates it."""
    plain = SENSITIVITY_UNIT_IN_NAME.sub("", SENSITIVITY_IN_NAME.sub("", name))
    return name if plain == name else plain.rstrip(" _@,;-")


def _texts(value: Any) -> list[str]:
    """The units in a value, without those of a time axis."""
    if isinstance(value, Mapping) or getattr(value, "size", 1) > MAX_ENTRIES:
        return []
    values = value.ravel().tolist() if hasattr(value, "ravel") else value
    values = values if isinstance(values, (list, tuple)) else [values]
    texts = [v.decode("utf-8", "replace") if isinstance(v, bytes) else v for v in values]
    texts = [text.strip() for text in texts if isinstance(text, str)]
    return [text for text in texts if (unit := rate_unit(text)) is None or not unit.is_step]


def _units_in_words(name: str, names: Sequence[str]) -> list[str]:
    """Units that words of a name may be: of its last words, as in "rail_mV" or "rail_mm_s2", of others and of all."""
    last = _last_word(name, names)
    return [last] if last else [u for u in _other_words(name, names) if known_unit(u)]


def _last_word(name: str, names: Sequence[str]) -> str:
    """The last words of a name if they are a unit, as in "rail_mV" or "rail_mm_s2".

    "" where they number the channels, as in "rail_f", "rail_g".
    """
    stem, *words = _split_name(name)
    if not words or any(other != name and _split_name(other)[0] == stem for other in names):
        return ""
    units = ["/".join((stem.rpartition("_")[2], words[0])), words[0]]
    return next((u for u in units if re.match(r"[^\W\d]", u) and (known_unit(u) or LEVEL.match(u))), "")


def _other_words(name: str, names: Sequence[str]) -> list[str]:
    """Words that may be a unit beside others, as in "F_kN_raw" and "kN 2", and a name that is nothing else.

    None where they number the channels, as in "f", "g", or belong to an amount; of single letters only usual units.
    """
    plain = name.strip()
    if len(plain) == 1 and any(len(other.strip()) == 1 and not known_unit(other) for other in names):
        return []
    words, *neighbours = (
        SEPARATORS.split(AMOUNT.sub("", other.strip())) for other in (name, *(n for n in names if n != name))
    )
    inner = [
        word
        for k, word in enumerate(words)
        if (len(word) > 1 or word in ("g", "N"))
        and not any(other[:k] + other[k + 1 :] == words[:k] + words[k + 1 :] for other in neighbours)
    ]
    return [*inner, *([plain] if re.match(r"[^\W\d]", plain) else [])]


def _split_name(name: str) -> list[str]:
    """A name without its last word, and that word if there is one.

    Words are separated by blanks or underscores, a unit of letters alone also by a dot, slash, hyphen or colon.
    """
    plain = re.sub(r"\s+|\s*[./:-]\s*(?=[^\W\d_]+$)", "_", name.strip())
    return plain.rsplit("_", 1)


def contradicting_unit(
    record: RawRecord, index: int, wanted: str | None, quantity: str, is_usable: Callable[[str], bool]
) -> str:
    """A unit in the metadata or the name of a channel that contradicts the one in use.

    Where only one of two units can be that of the channel, it holds.

    Parameters
    ----------
    record : RawRecord
        The record.
    index : int
        The channel.
    wanted : str or None
        Unit of the layout.
    quantity : str
        Quantity of the channel in the layout.
    is_usable : callable
        Whether numbers in a unit can become the quantity.

    Returns
    -------
    str
        The unit; "" if all agree, or none is stated.
    """
    file_unit = record.units[index]
    certain, possible = own_units(record, index, unit_entries(record.entries))
    if not is_meaningless(file_unit):
        rivals = [u for u in certain if is_usable(u) or (known_unit(u) and not is_usable(file_unit))]
        return next((u for u in rivals if known_unit(file_unit) and not same_unit(u, file_unit)), "")
    if wanted is None or certain:  # none of its own units is known
        return certain[0] if certain else ""
    dimensions = {quantity, getattr(known_unit(wanted), "dimension", quantity)}
    in_name = _last_word(record.names[index], record.names)
    candidates = [
        u
        for u in possible
        if LEVEL.match(u)
        or getattr(known_unit(u), "dimension", "")
        in (dimensions | {"voltage", "count"} if u == in_name else dimensions)
    ]
    return "" if any(same_unit(u, wanted) for u in candidates) else next(iter(candidates), "")


def key_of_units(entries: Sequence[Entry]) -> tuple[tuple[str, str, tuple[str, ...]], ...]:
    """What the units of the channels depend on.

    Parameters
    ----------
    entries : sequence of Entry
        Metadata of a record.

    Returns
    -------
    tuple of tuple of (str, str, tuple of str)
        Place, name and units of each entry that states a unit.
    """
    return tuple((e.place, e.name, tuple(_texts(e.value))) for e in unit_entries(entries))
