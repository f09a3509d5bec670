"""Sensitivities that a file states for its sensors, compared with those of the layout."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import owners_of, spaced_words
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.stated_numbers import finite_numbers, number_and_unit
from turnout.readers.stated_units import SENSITIVITY_IN_NAME
from turnout.units import to_si

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
    entries = list(entries)
    compared: list[Entry] = []
    for entry in sensitivity_entries(entries):
        owners = owners_of(entry, entries, names)
        if isinstance(entry.value, list) and len(entry.value) == len(names) > 1:  # one for each channel
            entry, owners = replace(entry, value=entry.value[index]), frozenset((index,))
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
    parts = number_and_unit(entry.value) if isinstance(entry.value, str) else None
    if parts and re.match(r"[^\d\s.,;+-]", parts[1]):
        return [(parts[0], parts[1].replace(" per ", "/"))] if parts[0] else []
    numbers = finite_numbers(entry.value)
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
    words = [plain_word(word) for word in spaced_words(re.sub(r"[\[(].*?[\])]", "", name)).split()]
    specific = [w for w in words if w not in GENERAL_WORDS and not SENSITIVITY.search(w) and not w.isdigit()]
    return not specific or any(SENSOR_WORDS[quantity].search(w) for w in specific if quantity in SENSOR_WORDS)
