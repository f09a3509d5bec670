"""Scales of a file in volts that are the sensitivities of the layout in another form: "Scale: 4347.8 N/V"."""

from dataclasses import replace

from turnout.readers.entries import Entry
from turnout.readers.scale_vocabulary import (
    FACTOR,
    POSSIBLY_FACTOR,
    STRONG_FACTOR,
    is_other_sign,
    plain_word,
    scale_meaning,
)
from turnout.readers.sensitivity_comparison import agrees_with_layout, is_of_other_sensor
from turnout.readers.source import RawRecord
from turnout.readers.stated_scales import entry_statements
from turnout.readers.stated_sensitivities import sensitivities_of_entry
from turnout.records import RawChannel
from turnout.units import to_si

MAX_DEVIATION = 0.01  # relative: a number without a unit that is as near to a sensitivity is that sensitivity


def is_scale_of_sensor(record: RawRecord, index: int, channel: RawChannel) -> bool:
    """Whether all that the entries of a file state about the scale of a channel is the sensitivity of the layout.

    The layout converts the numbers of the channel, which are volts, so they do not contain it.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    index : int
        Number of the row, from 0.
    channel : RawChannel
        The channel in the layout.

    Returns
    -------
    bool
        False as well if the scale is not stated in the entries alone.
    """
    if not record.undecided.get(index) or channel.sensitivity is None:
        return False
    entries = list(record.entries)
    further = [entry for entry in entries if not _is_sensitivity(entry, entries, record, index, channel)]
    stated, remaining = entry_statements(entries, record.names), entry_statements(further, record.names)
    return stated.get(index) == record.undecided[index] and index not in remaining


def _is_sensitivity(entry: Entry, entries: list[Entry], record: RawRecord, index: int, channel: RawChannel) -> bool:
    """Whether a factor, which is no gain of an amplifier, is the sensitivity of a channel, or of another quantity."""
    is_factor = scale_meaning(entry.name) in (FACTOR, POSSIBLY_FACTOR) and not is_other_sign(entry.name)
    if not is_factor or STRONG_FACTOR.search(plain_word(entry.name)):
        return False
    if isinstance(entry.value, list) and len(entry.value) == len(record.names):
        entry = replace(entry, value=entry.value[index])
    stated = sensitivities_of_entry(entry, entries)
    return bool(stated) and all(_agrees(number, unit, channel) for number, unit in stated)


def _agrees(number: float, unit: str, channel: RawChannel) -> bool:
    """Whether a number is the sensitivity of the layout: with a unit within a tenth, else as V per unit or reverse.

    One with the unit of a sensor of another quantity is not of this channel.
    """
    sensitivity = channel.sensitivity or 1.0
    if unit:
        return agrees_with_layout(number, unit, channel) is True or is_of_other_sensor(number, unit, channel.quantity)
    in_si = to_si(channel.quantity, "V", sensitivity, channel.sensitivity_unit).scale
    forms = (sensitivity, in_si, 1.0 / in_si)
    return any(abs(abs(number) / form - 1.0) <= MAX_DEVIATION for form in map(abs, forms))
