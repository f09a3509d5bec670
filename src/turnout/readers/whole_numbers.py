"""Whole numbers of a converter that a layout takes for a physical quantity, beside what converts them."""

import re
from collections.abc import Iterator, Sequence

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import owners_of
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.stated_numbers import finite_numbers, number_and_unit
from turnout.readers.stated_sensitivities import is_sensitivity_name
from turnout.records import RawChannel
from turnout.units import IGNORED

RANGE = re.compile(
    r"^(?:adc|input|measur\w*|channel|voltage|physical|mess|eingangs?|sensor)*(?:range|bereich|fullscale|gamme|fsr)"
    r"(?:min|max|high|low)?$|^(?:phys(?:ical)?|dig(?:ital)?)(?:min|max)(?:imum)?(?:value)?$"
)


def converting_entries(record: RawRecord, channels: Sequence[RawChannel]) -> Iterator[tuple[int, Entry]]:
    """Entries that may say how the whole numbers of a channel become the physical quantity of the layout.

    A sensitivity or a range beside floating-point numbers describes the sensor: they are converted. Whole numbers of a
    physical unit may be either, and nothing in them shows which.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    channels : sequence of RawChannel
        Channels of the layout.

    Yields
    ------
    tuple of (int, Entry)
        Index of the channel and an entry about its sensitivity or range that is not 1. None of a channel
        whose unit in the layout is electrical or has a number or an exclamation mark.
    """
    wanted = [
        i for i, column in enumerate(record.samples) if column.dtype.kind in "iu" and _is_physical(record, i, channels)
    ]
    if not wanted:
        return
    for entry in record.entries:
        is_scale = is_sensitivity_name(entry.name) or RANGE.search(plain_word(entry.name))
        if entry.is_defined or entry.is_piece or not is_scale:
            continue
        if not _is_number(entry.value):
            continue
        owners = owners_of(entry, record.entries, record.names)
        yield from ((i, entry) for i in wanted if not owners or i in owners)


def _is_physical(record: RawRecord, i: int, channels: Sequence[RawChannel]) -> bool:
    """Whether the layout takes the numbers of a channel for its quantity as they are."""
    channel = next((c for c in channels if c.source in (i, record.names[i])), None)
    if channel is None or channel.quantity == IGNORED or channel.sensitivity is not None:
        return False
    return not re.search(r"[\d.]+\s|!$", channel.unit or "")


def _is_number(value: object) -> bool:
    """Whether the value of an entry is a number other than 0 and 1, or several."""
    if isinstance(value, str):
        stated = number_and_unit(value)
        return stated is not None and stated[0] not in (0.0, 1.0)
    numbers = finite_numbers(value)
    return numbers is not None and any(number not in (0.0, 1.0) for number in numbers)
