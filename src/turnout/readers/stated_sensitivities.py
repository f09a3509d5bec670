"""Sensitivities that a file states for its sensors, compared with those of the layout."""

import math
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
from turnout.records import RawChannel
from turnout.units import to_si

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
ENGINEERING_UNIT = re.compile(r"/\s?(?:EU|units?)$", re.IGNORECASE)  # that of the channel
MAX_TEXT = 1000  # characters of a text that are searched
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
    return tuple(entry for entry in entries if is_sensitivity_name(entry.name))


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
    of_channel = _comparison(list(entries), sensitivity, unit, quantity, names, index)
    if any(agrees for agrees, _ in of_channel):
        return ""
    certain = [entry for _, entry in of_channel if _is_certain(entry, entries, names)]
    if not certain:
        return ""
    listed = "; ".join(dict.fromkeys(f"{entry.name}: {entry.value}" for entry in certain[:3]))
    return f"the file states {listed[:100]!r}, and the layout's sensitivity of {sensitivity:g} {unit} is none of these"


def _comparison(
    entries: Sequence[Entry], sensitivity: float, unit: str, quantity: str, names: Sequence[str], index: int
) -> list[tuple[bool, Entry]]:
    """(whether it agrees, entry) of each sensitivity that can be compared: those of the channel, else all others."""
    compared = [
        (bool(owners), agrees, entry)
        for entry, owners, stated in _stated_of_channel(entries, names, index)
        for number, own_unit in stated
        if (agrees := _agrees(number, own_unit, sensitivity, unit, quantity, bool(owners), entry)) is not None
    ]
    of_channel = [statement for statement in compared if statement[0]] or compared
    return [(agrees, entry) for _, agrees, entry in of_channel]


def _is_certain(entry: Entry, entries: Iterable[Entry], names: Sequence[str]) -> bool:
    """Whether a sensitivity stands under such a name or at a channel, and not in a free text of no channel."""
    if is_sensitivity_name(entry.name) or named_channels(str(entry.value), names):
        return True
    return bool(owners_of(entry, list(entries), names))


def other_sensitivities(record: RawRecord, channels: Sequence[RawChannel]) -> Iterator[Entry]:
    """Entries of free text that state another sensitivity than the layout and name no channel.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    channels : sequence of RawChannel
        Channels of the layout; only those with a sensitivity count, and whose unit does not end with "!".

    Yields
    ------
    Entry
        None if another entry states the sensitivity of the layout.
    """
    if not states_sensitivity(record.entries):
        return
    for channel in channels:
        row = None if (channel.unit or "").endswith("!") or not channel.sensitivity else _row_of(record, channel)
        if row is None:
            continue
        in_layout = channel.sensitivity or 1.0, channel.sensitivity_unit or "", channel.quantity
        compared = _comparison(record.entries, *in_layout, record.names, row)
        if compared and not any(agrees for agrees, _ in compared):
            yield from (e for _, e in compared if not _is_certain(e, record.entries, record.names))


def uncompared_sensitivities(record: RawRecord, channels: Sequence[RawChannel]) -> Iterator[Entry]:
    """Entries about the sensitivity of a sensor that cannot be compared with that of any channel of the layout.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    channels : sequence of RawChannel
        Channels of the layout; only those with a sensitivity count, and whose unit does not end with "!".

    Yields
    ------
    Entry
        None that speaks of another sensor, or that has no value.
    """
    wanted = [(i, c) for c in channels if c.sensitivity and (i := _row_of(record, c)) is not None]
    if not wanted or not states_sensitivity(record.entries):
        return
    unclear: dict[int, Entry] = {}
    compared: set[int] = set()
    for i, channel in wanted:
        for entry, owners, stated in _stated_of_channel(record.entries, record.names, i):
            is_overruled = (channel.unit or "").endswith("!") or bool(sensitivities_in_text(entry.name))
            if is_overruled or any(_is_compared(x, unit, channel, bool(owners), entry) for x, unit in stated):
                compared.add(id(entry))
            elif owners or (is_sensitivity_name(entry.name) and _is_general(entry.name, channel.quantity)):
                if not _may_be_sensitivity(entry, stated):
                    continue
                is_other = any(_sensitivity_scale(quantity, x, unit) for x, unit in stated for quantity in SENSOR_WORDS)
                unclear |= {} if is_other and not owners else {id(entry): entry}
    yield from (entry for key, entry in unclear.items() if key not in compared)


# What is said about a sensitivity beside its value.
ABOUT_SENSITIVITY = re.compile(r"check|valid|drift|calibrated|kalibriert|gepruft")


def _may_be_sensitivity(entry: Entry, stated: Sequence[tuple[float, str]]) -> bool:
    """Whether the value of an entry under the name of a sensitivity may be one: it has a digit, and is no gain of 1."""
    if not re.search(r"\d", str(entry.value)):
        return False  # "see certificate"
    if ABOUT_SENSITIVITY.search(plain_word(entry.name)) and not any(unit for _, unit in stated):
        return False
    return not (GAIN_OF_ONE.fullmatch(str(entry.value).strip()))


GAIN_OF_ONE = re.compile(r"(?:1(?:[.,]0+)?\s?V|1000(?:[.,]0+)?\s?mV)\s?/\s?(?:V|EU|units?)", re.IGNORECASE)


def _is_compared(number: float, unit: str, channel: RawChannel, is_own: bool, entry: Entry) -> bool:
    """Whether a stated sensitivity can be compared with that of a channel of the layout."""
    in_layout = channel.sensitivity or 1.0, channel.sensitivity_unit, channel.quantity
    return _agrees(number, unit, *in_layout, is_own, entry) is not None


def _row_of(record: RawRecord, channel: RawChannel) -> int | None:
    """Row of a channel of the layout among those of the file."""
    rows = (i for i, name in enumerate(record.names) if channel.source in (i, name, *_aliases(record, i)))
    return next(rows, None)


def _aliases(record: RawRecord, i: int) -> tuple[str, ...]:
    return record.aliases[i] if i < len(record.aliases) else ()


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


def _stated_of_channel(
    entries: Sequence[Entry], names: Sequence[str], index: int
) -> Iterator[tuple[Entry, frozenset[int], list[tuple[float, str]]]]:
    """Each entry about a sensitivity that may be of a channel, with its owners and its numbers with their units."""
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
            yield entry, owners, [(number, own or unit) for number, own in _sensitivities(entry, entries)]


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


def _sensitivities(entry: Entry, entries: Sequence[Entry]) -> list[tuple[float, str]]:
    """Numbers of an entry with their unit: beside the number, else in or behind the name, else ""."""
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
    words = [plain_word(word) for word in spaced_words(re.sub(r"[\[(].*?[\])]", "", name)).split()]
    specific = [w for w in words if w not in GENERAL_WORDS and not SENSITIVITY.search(w) and not w.isdigit()]
    return not specific or any(SENSOR_WORDS[quantity].search(w) for w in specific if quantity in SENSOR_WORDS)
