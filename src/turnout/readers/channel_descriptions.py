"""What a file says about the sensors of its channels: a layout that exchanges two of them is an error."""

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import owners_of
from turnout.readers.rate_units import words_of
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.stated_quantities import MAX_TEXT, quantity_of_text, texts_of_value
from turnout.records import RawChannel

DESCRIPTION_NAME = re.compile(
    r"name|label|descri|beschreib|bezeich|titel|title|sensor|transducer|aufnehmer|signal|comment|remark|kommentar"
    r"|bemerk|messstelle|messpunkt|type|typ"
)
HAMMER_WORDS = ("hammer", "marteau", "martillo", "martello", "impulshamm", "kladivo")


def is_description_name(name: str) -> bool:
    """Whether an entry of this name may describe a channel.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool

    Examples
    --------
    >>> is_description_name("NI_ChannelName"), is_description_name("Sensor"), is_description_name("gain")
    (True, True, False)
    """
    return bool(DESCRIPTION_NAME.search(plain_word(name)))


def exchanged_channels(record: RawRecord, indices: Sequence[int], channels: Sequence[RawChannel]) -> str:
    """Two channels of the layout that the file describes the other way round, by their names or its metadata.

    A single description may speak of something beside the sensor, so it is no contradiction.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    indices : sequence of int
        Rows of the channels of the layout.
    channels : sequence of RawChannel
        These channels.

    Returns
    -------
    str
        The problem, for a message; "" without such a pair.
    """
    quantities = {c.name.strip().casefold(): c.quantity for c in channels}
    described: dict[int, dict[str, str]] = {  # row -> quantity -> text
        i: {quantity: record.names[i]}
        for i in indices
        if (quantity := _quantity_of_description(record.names[i], quantities))
    }
    for entry in record.entries:
        for i, text in _descriptions(entry, record).items():
            if i in indices and (quantity := _quantity_of_description(text, quantities)):
                described.setdefault(i, {})[quantity] = text
    wanted = [(i, c) for i, c in zip(indices, channels) if len(described.get(i, ())) == 1 and not c.overrules_file]
    for (i, a), (k, b) in combinations(wanted, 2):
        if a.quantity != b.quantity and b.quantity in described[i] and a.quantity in described[k]:
            texts = f"{described[i][b.quantity]!r} and {described[k][a.quantity]!r}"
            names = f"{record.names[i]!r} for {a.name!r} and {record.names[k]!r} for {b.name!r}"
            return f"the layout takes {names}, and the file describes them as {texts}"
    return ""


def describing_entries(entries: Sequence[Entry], channels: Sequence[RawChannel]) -> tuple[Entry, ...]:
    """Entries on which ``exchanged_channels`` may depend: those with a text that speaks of a sensor.

    Parameters
    ----------
    entries : sequence of Entry
        Metadata of a record.
    channels : sequence of RawChannel
        Channels of the layout.

    Returns
    -------
    tuple of Entry
        Under any name, because a channel may have it.
    """
    quantities = {c.name.strip().casefold(): c.quantity for c in channels}
    return tuple(
        entry
        for entry in entries
        if any(_quantity_of_description(t, quantities) for t in texts_of_value(entry.value) if len(t) <= MAX_TEXT)
    )


def _descriptions(entry: Entry, record: RawRecord) -> dict[int, str]:
    """Texts of an entry by the channel that each describes."""
    if isinstance(entry.value, str):
        if len(entry.value) > MAX_TEXT:
            return {}
        name = entry.name.strip().casefold()
        if (named := [i for i, other in enumerate(record.names) if other.strip().casefold() == name]) and name:
            return dict.fromkeys(named, entry.value)
        owners = owners_of(entry, record.entries, record.names) if is_description_name(entry.name) else ()
        return dict.fromkeys(owners, entry.value) if len(owners) == 1 else {}
    texts = texts_of_value(entry.value) if is_description_name(entry.name) else []
    is_of_channels = len(texts) == len(record.names) > 1
    return {i: text for i, text in enumerate(texts) if len(text) <= MAX_TEXT} if is_of_channels else {}


def _quantity_of_description(text: str, quantities: dict[str, str]) -> str:
    """The quantity of the sensor that a text describes, or of the channel of the layout that it names; "" for none."""
    return quantities.get(text.strip().casefold(), "") or quantity_of_sensor(text)


@lru_cache(maxsize=4096)
def quantity_of_sensor(text: str) -> str:
    """The quantity of the sensor that a text describes.

    Parameters
    ----------
    text : str
        Name or description of a channel.

    Returns
    -------
    str
        "" without a word for a sensor.

    Examples
    --------
    >>> quantity_of_sensor("impulse hammer"), quantity_of_sensor("accelerometer"), quantity_of_sensor("impact_1")
    ('force', 'acceleration', '')
    """
    is_of_hammer = any(word.startswith(HAMMER_WORDS) for word in words_of(text))
    quantity = quantity_of_text(text)
    if is_of_hammer:
        return "force" if quantity in ("", "force") else ""
    return quantity if quantity != "voltage" else ""
