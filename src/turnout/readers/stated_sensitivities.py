"""Sensitivities that a file states for its sensors, in entries of its metadata and in names of channels."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import container_of, named_channels, owners_of, spaced_words
from turnout.readers.metadata_subjects import SENSITIVITY_STEMS
from turnout.readers.rate_statements import PLACEHOLDERS
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.stated_numbers import finite_numbers, number_and_unit
from turnout.readers.stated_units import SENSITIVITY_IN_NAME

SENSITIVITY = re.compile(SENSITIVITY_STEMS)
# What is beside a sensitivity: the frequency and the day at which it was measured, its tolerance, that of the trigger,
# its origin, that across the axis.
BESIDE_SENSITIVITY = re.compile(
    r"trigger|seuil|freq|toler|temp|date|datum|uncertain|unsicher|deviation|abweich|unit|einheit|source|certif|zertif"
    r"|directi|richtung|axis|achse|type|transvers|cross|quer|class"
)
NUMBER = r"[+-]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:[eE][+-]?\d+)?"
ELECTRICAL = r"(?:[mnµ\u03bcu]?V|[pn]?C|counts?)(?![^\W\d_])"
MECHANICAL = r"(?:\([^()]*\)|[^\W\d_](?:[\w²³⁻¹·*^/-]|\.(?=\w))*)"
PER = r"\s?(?:/|\b(?:per|pro|par|je|pr\.?|por|na)\b)\s?"
BESIDE_VOLTS = r"(?:\s?(?:rms|pk|peak))?"
RATIO = rf"(?:{ELECTRICAL}{BESIDE_VOLTS}{PER}{MECHANICAL}|{MECHANICAL}{PER}{ELECTRICAL})"
# A number with the unit of a sensitivity anywhere in a text: "ca. 100 mV/g @ 160 Hz", "mV/g 100", "100 (mV/g)".
NUMBER_AND_RATIO = re.compile(rf"(?<![\w.,])({NUMBER})\s?[\[(]?\s?({RATIO})")
RATIO_AND_NUMBER = re.compile(rf"(?<![\w/])({RATIO})[\])]?[\s:=]+({NUMBER})(?![\w/])")
ENGINEERING_UNIT = re.compile(r"^(?:EU|units?)\s?/|/\s?(?:EU|units?)$", re.IGNORECASE)  # that of the channel
MAX_TEXT = 1000  # characters of a text that are searched


def is_sensitivity_name(name: str) -> bool:
    """Whether an entry of this name may state the sensitivity of a sensor.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
        False for that of a trigger, or for the frequency at which it was measured.
    """
    word = plain_word(name)
    return bool(SENSITIVITY.search(word)) and not BESIDE_SENSITIVITY.search(word)


def with_named_sensitivities(record: RawRecord) -> RawRecord:
    """The record with an entry for each sensitivity in the name of a channel, or in the place of its unit.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        A sensitivity is no unit of the samples.
    """
    labels = list(zip(record.names, record.units))
    matches = [SENSITIVITY_IN_NAME.search(f"{name} | {unit}") for name, unit in labels]
    entries = tuple(
        Entry(f"the name of channel {name!r}", "sensitivity", match[1])
        for (name, _), match in zip(labels, matches) if match
    )  # fmt: skip
    units = tuple("" if SENSITIVITY_IN_NAME.fullmatch(unit.strip()) else unit for unit in record.units)
    return replace(record, entries=(*record.entries, *entries), units=units) if entries else record


def states_sensitivity(entries: Iterable[Entry]) -> bool:
    """Whether an entry of the metadata states the sensitivity of a sensor, by its name or in its text.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.

    Returns
    -------
    bool
    """
    return any(is_sensitivity_name(entry.name) or _ratios_beside(entry) for entry in entries)


def sensitivities_of_channel(
    entries: Sequence[Entry], names: Sequence[str], index: int
) -> Iterator[tuple[Entry, frozenset[int], list[tuple[float, str]]]]:
    """Entries about a sensitivity that may be that of a channel.

    Parameters
    ----------
    entries : sequence of Entry
        Metadata of a record.
    names : sequence of str
        Names of the channels of the file.
    index : int
        The channel among them.

    Yields
    ------
    tuple of (Entry, frozenset of int, list of (float, str))
        The entry, the channels that it names, and its numbers with their units.
    """
    for entry in entries:
        is_named = is_sensitivity_name(entry.name)
        if not is_named and not _ratios_beside(entry):
            continue
        if is_named and isinstance(entry.value, str) and entry.value.strip().casefold() in PLACEHOLDERS:
            continue
        owners = owners_of(entry, entries, names)
        if not owners and not is_named:
            owners = named_channels(entry.value, names)
        is_list = isinstance(entry.value, list) and len(entry.value) == len(names) > 1
        unit = _unit_in_list(entry, entries, index) if is_list else ""
        if is_list:  # one for each channel
            entry, owners = replace(entry, value=entry.value[index]), frozenset((index,))
        if not owners and _is_of_other_sensor(entry, is_named):
            continue
        if not owners or index in owners:
            yield entry, owners, [(number, own or unit) for number, own in sensitivities_of_entry(entry, entries)]


def _ratios_beside(entry: Entry) -> tuple[tuple[float, str], ...]:
    """Sensitivities in the text of an entry under another name, as "Sensor: IEPE, 100 mV/g"; none in counts."""
    if entry.is_piece or not isinstance(entry.value, str) or BESIDE_SENSITIVITY.search(plain_word(entry.name)):
        return ()
    return tuple((x, unit) for x, unit in sensitivities_in_text(entry.value) if not COUNTED.search(unit))


COUNTED = re.compile(r"counts?\b|lsb|bit|digit|div|pixel", re.IGNORECASE)


@lru_cache(maxsize=4096)
def sensitivities_in_text(text: str) -> tuple[tuple[float, str], ...]:
    """Numbers with the unit of a sensitivity anywhere in a text.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    tuple of (float, str)
        Each number other than 0 and its unit, which need not be known.

    Examples
    --------
    >>> [sensitivities_in_text(text) for text in ("ca. 100 mV/g @ 160 Hz", "mV/g: 98,7", "5 V")]
    [((100.0, 'mV/g'),), ((98.7, 'mV/g'),), ()]
    """
    if "V" not in text and "C" not in text and "count" not in text:
        return ()
    pairs = NUMBER_AND_RATIO.findall(text[:MAX_TEXT])
    pairs = pairs or [(number, ratio) for ratio, number in RATIO_AND_NUMBER.findall(text[:MAX_TEXT])]
    numbers = [(float(number.replace(",", ".")), _plain_ratio(ratio)) for number, ratio in pairs]
    return tuple((number, ratio) for number, ratio in numbers if number)


def _plain_ratio(ratio: str) -> str:
    """The unit of a sensitivity with a slash: "mV/g" of "mV per g" and "mV rms/g"."""
    return re.sub(rf"{BESIDE_VOLTS}{PER}", "/", ratio, count=1).strip()


def sensitivities_of_entry(entry: Entry, entries: Sequence[Entry]) -> list[tuple[float, str]]:
    """Numbers of an entry with their unit: beside the number, else in or behind the name.

    Parameters
    ----------
    entry : Entry
        An entry that may state a sensitivity.
    entries : sequence of Entry
        All entries of the record; one of them may be the unit.

    Returns
    -------
    list of (float, str)
        The unit is "" where none is stated, or that of the channel ("EU").
    """
    if isinstance(entry.value, str) and (pairs := sensitivities_in_text(entry.value)):
        return list(pairs)
    in_name = re.search(r"[\[(](.+)[\])]\s*$", entry.name)
    if ratio := re.search(RATIO, entry.name.replace("_", " ")):  # "sensitivity_mV_per_g"
        unit = _plain_ratio(ratio[0])
    else:
        unit = in_name[1] if in_name else _unit_beside(entry, entries)
    unit = "" if ENGINEERING_UNIT.search(unit) else unit
    parts = number_and_unit(entry.value) if isinstance(entry.value, str) else None
    if parts and re.match(r"[^\d\s.,;+-]", parts[1]):
        return [(parts[0], parts[1])] if parts[0] else []
    numbers = finite_numbers(entry.value)
    return [] if numbers is None else [(float(x), unit) for x in numbers if x]


# A sensor that does not measure here, and, in a free text, a sensitivity that is none of a certificate.
UNUSED = re.compile(
    r"\b(?:spare|former(?:ly)?|old|not (?:used|connected)|unused|reserve|ersatz|nicht (?:benutzt|verwendet))\b"
)
NOMINAL = re.compile(r"\b(?:nominal|alt|alter|altes|nenn|available)\b")


def _is_of_other_sensor(entry: Entry, is_named: bool) -> bool:
    """Whether the words of an entry of no channel say that its sensitivity is of a sensor that is not in use."""
    words = spaced_words(f"{entry.name} {entry.value}")
    return UNUSED.search(words) is not None or (not is_named and NOMINAL.search(words) is not None)


def _unit_in_list(entry: Entry, entries: Sequence[Entry], index: int) -> str:
    """The unit of a channel in a row "Sensitivity unit" beside the row of the sensitivities; "" without one."""
    wanted = set(spaced_words(entry.name).split())
    for other in entries:
        words = spaced_words(other.name)
        is_of_unit = wanted < set(words.split()) and re.search(r"unit|einheit", words) is not None
        if is_of_unit and isinstance(other.value, list) and len(other.value) == len(entry.value):
            return str(other.value[index]).strip()
    return ""


def _unit_beside(entry: Entry, entries: Sequence[Entry]) -> str:
    """The unit that another entry states for a sensitivity: "sensitivity_unit" beside "sensitivity"."""
    for other in entries:
        words = spaced_words(other.name)
        is_of_unit = words.startswith(spaced_words(entry.name)) and re.search(r"unit|einheit", words) is not None
        if is_of_unit and isinstance(other.value, str) and container_of(other) == container_of(entry):
            return other.value.strip()
    return ""
