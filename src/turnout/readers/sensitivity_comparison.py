"""Sensitivities that a file states for its sensors, compared with those of the layout."""

import math
import re
from collections.abc import Iterable, Iterator, Sequence

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import named_channels, owners_of, spaced_words
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.stated_sensitivities import (
    SENSITIVITY,
    is_sensitivity_name,
    sensitivities_in_text,
    sensitivities_of_channel,
    states_sensitivity,
)
from turnout.records import RawChannel
from turnout.units import to_si

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
# What is said about a sensitivity beside its value.
ABOUT_SENSITIVITY = re.compile(r"check|valid|drift|calibrated|kalibriert|gepruft")
GAIN_OF_ONE = re.compile(r"(?:1(?:[.,]0+)?\s?V|1000(?:[.,]0+)?\s?mV)\s?/\s?(?:V|EU|units?)", re.IGNORECASE)


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
        for entry, owners, stated in sensitivities_of_channel(entries, names, index)
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
    for row, channel in _channels_with_sensitivity(record, channels):
        if channel.overrules_file:
            continue
        compared = _comparison(record.entries, *_sensitivity_of(channel), record.names, row)
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
    unclear: dict[int, Entry] = {}
    compared: set[int] = set()
    for i, channel in _channels_with_sensitivity(record, channels):
        for entry, owners, stated in sensitivities_of_channel(record.entries, record.names, i):
            is_overruled = channel.overrules_file or bool(sensitivities_in_text(entry.name))
            if is_overruled or any(_is_compared(x, unit, channel, bool(owners), entry) for x, unit in stated):
                compared.add(id(entry))
            elif owners or (is_sensitivity_name(entry.name) and _is_general(entry.name, channel.quantity)):
                if not _may_be_sensitivity(entry, stated):
                    continue
                is_other = any(_sensitivity_scale(quantity, x, unit) for x, unit in stated for quantity in SENSOR_WORDS)
                unclear |= {} if is_other and not owners else {id(entry): entry}
    yield from (entry for key, entry in unclear.items() if key not in compared)


def _may_be_sensitivity(entry: Entry, stated: Sequence[tuple[float, str]]) -> bool:
    """Whether the value of an entry under the name of a sensitivity may be one: it has a digit, and is no gain of 1."""
    if not re.search(r"\d", str(entry.value)):
        return False  # "see certificate"
    if ABOUT_SENSITIVITY.search(plain_word(entry.name)) and not any(unit for _, unit in stated):
        return False
    return not (GAIN_OF_ONE.fullmatch(str(entry.value).strip()))


def _is_compared(number: float, unit: str, channel: RawChannel, is_own: bool, entry: Entry) -> bool:
    """Whether a stated sensitivity can be compared with that of a channel of the layout."""
    return _agrees(number, unit, *_sensitivity_of(channel), is_own, entry) is not None


def _channels_with_sensitivity(record: RawRecord, channels: Sequence[RawChannel]) -> Iterator[tuple[int, RawChannel]]:
    """(row in the file, channel) of each sensitivity of the layout; none where no entry states one."""
    if states_sensitivity(record.entries):
        rows = ((record.row_of(c.source), c) for c in channels if c.sensitivity)
        yield from ((row, channel) for row, channel in rows if row is not None)


def _sensitivity_of(channel: RawChannel) -> tuple[float, str, str]:
    """Sensitivity, its unit and the quantity of a channel of the layout."""
    return channel.sensitivity or 1.0, channel.sensitivity_unit, channel.quantity


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


def agrees_with_layout(number: float, unit: str, channel: RawChannel) -> bool | None:
    """Whether a number with the unit of a sensitivity is the sensitivity of a channel of the layout.

    Parameters
    ----------
    number : float
        The number.
    unit : str
        Its unit, "mV/N" or "N/V".
    channel : RawChannel
        The channel, with a sensitivity.

    Returns
    -------
    bool or None
        None for a unit of another quantity, or that is not known.
    """
    return _agrees(number, unit, *_sensitivity_of(channel), False, Entry("", "", ""))


def is_of_other_sensor(number: float, unit: str, quantity: str) -> bool:
    """Whether a number with its unit is the sensitivity of a sensor of another quantity.

    Parameters
    ----------
    number : float
        The number.
    unit : str
        Its unit.
    quantity : str
        Quantity of the channel.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_of_other_sensor(0.23, unit, "acceleration") for unit in ("mV/N", "mV/g", "mV/EU")]
    [True, False, False]
    """
    is_own = _sensitivity_scale(quantity, number, unit) is not None
    return not is_own and any(_sensitivity_scale(other, number, unit) for other in SENSOR_WORDS)


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
