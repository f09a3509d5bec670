"""Channels of the layout assigned to rows of a file."""

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from turnout.counts import first_texts
from turnout.errors import ReadError
from turnout.readers.attached_units import name_and_unit, names_and_units_in
from turnout.readers.channel_descriptions import describing_entries, exchanged_channels
from turnout.readers.channel_units import CORRECT_SOURCE, checked_conversion
from turnout.readers.column_forms import HEAD_SIZE, counts_samples, rises_evenly
from turnout.readers.entries import Entry, UnreadObject
from turnout.readers.rate_units import rate_unit
from turnout.readers.rate_vocabulary import is_rate_name
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_quantities import quantity_entries
from turnout.readers.stated_sensitivities import states_sensitivity
from turnout.readers.stated_units import key_of_units
from turnout.readers.time_axes import is_axis_name, is_unit_of_no_time
from turnout.records import Channel, RawChannel
from turnout.units import IGNORED


@dataclass(frozen=True)
class ChannelMapping:
    """Row ``index`` of the file becomes ``channel``: SI = ``scale`` * number + ``offset``, sign included."""

    index: int
    channel: Channel
    scale: float
    offset: float


KINDS = {"b": "true or false", "c": "complex numbers", "O": "text or objects", "U": "text", "S": "text", "T": "text"}


def kind_of(dtype: Any) -> str:
    """What an array that holds no real numbers holds, for messages.

    Parameters
    ----------
    dtype : numpy.dtype
        Its data type.

    Returns
    -------
    str
        The name of the data type if nothing plainer is known.
    """
    return KINDS.get(dtype.kind, str(dtype))


def channel_mappings(
    record: RawRecord, channels: Sequence[RawChannel], where: str, source: Source, is_passage: bool = False
) -> tuple[ChannelMapping, ...]:
    """Assign the channels of the layout to rows of the file.

    ``RawChannel.limit`` and ``resolution`` are in SI already. Channels with the quantity "ignored" are not read and may
    be absent if the layout names them. A number that the file does not have shows that the layout counts otherwise.
    A file of a passage may lack channels that the layout names, as that of one of two loggers does, if the layout names
    all of its own: then none of them can be a missing one under another name.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    channels : sequence of RawChannel
        Channels of the layout.
    where : str
        The record, for the message.
    source : Source
        The raw file.
    is_passage : bool
        Whether the record is of a passage.

    Returns
    -------
    tuple of ChannelMapping
        One mapping per channel that is read, in the order of the layout.

    Raises
    ------
    ReadError
        If file and layout disagree about channels or units.
    """
    channels = [
        c
        for c in channels
        if c.quantity != IGNORED or isinstance(c.source, int) or _has_channel(record, c.source, where, source)
    ]
    sources = [channel.source for channel in channels]
    present = [c for c in channels if not _is_absent(record, c.source)] if is_passage else channels
    indices = [index_of(record, c.source, where, source, sources) for c in present]
    if len(set(indices)) < len(indices):
        twice = next(i for i in indices if indices.count(i) > 1)
        raise source.error(where, f"the layout names the channel {record.names[twice]!r} twice", "Name each once")
    unknown = [
        i
        for i in sorted(set(range(len(record.names))) - set(indices))
        if not is_axis_name(record.names[i], record.units[i])
        and not is_rate_name(record.names[i])
        and not _needs_no_name(record, i)
    ]
    if absent := [c.source for c in channels if c not in present]:
        if unknown or not any(c.quantity != IGNORED for c in present):
            index_of(record, absent[0], where, source, sources)
        channels = present
    if unknown:
        names = _name_list([record.names[i] or str(i) for i in unknown])
        problem = (
            f"the file has {'channel' if len(unknown) == 1 else 'channels'} {names}, which the layout does not name"
        )
        remedy = f"Add it to the layout, with 'quantity: {IGNORED}' if it is not wanted"
        used = [c for i, c in zip(indices, channels) if c.quantity != IGNORED and _is_axis_by_form(record, i)]
        if used:
            problem += f", and its channel {used[0].source!r} rises in equal steps: it is a time or counts the samples"
            remedy = f"Correct 'source' of {used[0].name!r} in the layout; numbers of channels count this one, too"
        raise source.error(where, problem, remedy, reason="channel_unknown")
    if problem := exchanged_channels(record, indices, channels):
        raise source.error(where, problem, EXCHANGED_REMEDY, reason="unit_unknown")
    return tuple(
        _channel_mapping(i, record, channel, where, source)
        for i, channel in zip(indices, channels)
        if channel.quantity != IGNORED
    )


EXCHANGED_REMEDY = (
    "Correct 'source' of these channels in the layout; if it is right, set their units with '!', as 'unit: N!'"
)
MAX_LISTED = 12  # channels that a message names


def _name_list(names: Sequence[str]) -> str:
    """Names for a message, the first ones of a long list."""
    return first_texts([*map(repr, names)], MAX_LISTED)


def index_of(
    record: RawRecord, wanted: str | int, where: str, source: Source, assigned: Sequence[str | int] = ()
) -> int:
    """Row of the channel that the layout calls ``wanted``: a number, a name with or without its unit, or an alias.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    wanted : str or int
        Number of the channel from 0, its name, or an alias of the format.
    where : str
        The record, for the message.
    source : Source
        The raw file.
    assigned : sequence of str or int
        Channels that the layout names; none of them is suggested in place of ``wanted``.

    Returns
    -------
    int
        Number of the row, from 0.

    Raises
    ------
    ReadError
        If there is no such channel, or more than one.
    """
    if isinstance(wanted, int):
        if 0 <= wanted < len(record.names):
            return wanted
        name_list = _name_list(record.names)
        in_brackets = f" ({name_list}; times and numbers of records are no channels)" if any(record.names) else ""
        problem = f"there is no channel {wanted}; the file has {len(record.names)}{in_brackets}, counted from 0"
        raise source.error(where, problem, f"{CORRECT_SOURCE}, or copy the file again", reason="channel_missing")
    if record.names.count(wanted) == 1:
        return record.names.index(wanted)
    key = _key_of_name(wanted)
    for names in (record.names, tuple(name for name, _ in names_and_units_in(record.names))):
        keys = [*map(_key_of_name, names)]
        if keys.count(key) == 1:
            return keys.index(key)
    if wanted in record.not_numbers:
        content = record.not_numbers[wanted]
        problem = f"the channel {wanted!r} holds {content}"
        remedy = "Export its samples as whole or floating-point numbers, at the rate of the other channels"
        if isinstance(content, UnreadObject):
            problem = f"the channel {wanted!r} is {content.with_article}, no array of real numbers"
            remedy = content.remedy(wanted)
        raise source.error(where, problem, remedy, reason="channel_missing")
    matches = [i for i, aliases in enumerate(record.aliases) if _key_of_name(wanted) in map(_key_of_name, aliases)]
    if len(matches) == 1:
        return matches[0]
    if (count := record.names.count(wanted) + len(matches)) > 1:
        remedy = "Give each channel of the file a name of its own, or name them by their numbers in the layout, from 0"
        raise source.error(where, f"{count} channels are called {wanted!r}", remedy, reason="channel_missing")
    similar_names = get_close_matches(wanted, [name for name in record.names if name not in assigned], n=1)
    hint = (
        f"Did you mean {similar_names[0]!r}? {CORRECT_SOURCE}"
        if similar_names
        else f"{CORRECT_SOURCE}, or find out why the logger did not record the channel"
    )
    problem = f"there is no channel {wanted!r}; there are {_name_list(record.names)}"
    if stated := _entry_with_name(record, key):
        is_value = isinstance(stated.value, str) and _key_of_name(stated.value) == key
        problem += f", and {wanted!r} {f'is the value of {stated.name!r}' if is_value else 'stands'} in {stated.place}"
        hint = "Name the channel by its number in the layout, from 0; nothing in the file gives this name to a channel"
    raise source.error(where, problem, hint, reason="channel_missing")


def _entry_with_name(record: RawRecord, key: str) -> Entry | None:
    """The entry whose name or value is the name of a channel, which no channel of the file has."""
    texts = [(e, text) for e in record.entries for text in (e.value, e.name) if isinstance(text, str)]
    return next((e for e, text in texts if key in (_key_of_name(text), _key_of_name(name_and_unit(text)[0]))), None)


def _is_absent(record: RawRecord, wanted: str | int) -> bool:
    """Whether nothing in the file has the name of a channel: no channel, no alias, no other content and no entry."""
    if isinstance(wanted, int) or wanted in record.not_numbers:
        return False
    key = _key_of_name(wanted)
    bare = [name for name, _ in names_and_units_in(record.names)]
    labels = (*record.names, *bare, *(alias for aliases in record.aliases for alias in aliases))
    return key not in map(_key_of_name, labels) and _entry_with_name(record, key) is None


def _needs_no_name(record: RawRecord, i: int) -> bool:
    """Whether the form of a column shows that it is no channel: no number in it, a count, or an even rise."""
    column = record.samples[i]
    is_empty = isinstance(column, np.ndarray) and column.dtype.kind == "f" and bool(np.isnan(column).all())
    return is_empty or (not is_unit_of_no_time(record.units[i]) and _is_axis_by_form(record, i))


def _is_axis_by_form(record: RawRecord, i: int) -> bool:
    """Whether a column counts the samples or rises evenly."""
    column = record.samples[i]
    return column.dtype.kind in "fiu" and (counts_samples(column) or rises_evenly(column[:HEAD_SIZE]))


def _key_of_name(name: str) -> str:
    """What two spellings of a name that look the same have in common: capitals, blanks and composed letters differ."""
    return " ".join(unicodedata.normalize("NFC", name).casefold().split())


def _has_channel(record: RawRecord, wanted: str | int, where: str, source: Source) -> bool:
    try:
        index_of(record, wanted, where, source)
    except ReadError:
        return False
    return True


def _has_other_unit(unit: str | None) -> bool:
    """Whether a unit is stated that is no unit of time."""
    known = rate_unit(unit) if unit else None
    return bool(unit) and (known is None or not known.is_step)


def _sensor_rows(record: RawRecord, channels: Sequence[RawChannel], where: str, source: Source) -> set[int]:
    """Rows that the layout assigns to a sensor or gives a unit that is none of time; absent ones are left out."""
    wanted = [c.source for c in channels if c.quantity != IGNORED or _has_other_unit(c.unit)]
    return {index_of(record, name, where, source) for name in wanted if _has_channel(record, name, where, source)}


def _channel_mapping(index: int, record: RawRecord, raw: RawChannel, where: str, source: Source) -> ChannelMapping:
    place = f"{where}, channel {raw.name!r}"
    if (dtype := record.samples[index].dtype).kind not in "fiu":
        problem = f"its samples are {kind_of(dtype)}, no real numbers"
        raise source.error(place, problem, "Export them as whole or floating-point numbers", reason="channel_missing")
    conversion_to_si = checked_conversion(record, index, raw, place, source)
    sign = -1 if raw.sign < 0 else 1
    channel = Channel(
        name=raw.name,
        quantity=raw.quantity,
        position=raw.position,
        mounting=raw.mounting,
        serial=raw.serial,
        limit=raw.limit,
        resolution=raw.resolution,
    )
    return ChannelMapping(index, channel, sign * conversion_to_si.scale, sign * conversion_to_si.offset)


class Assignments:
    """Channels of the layout assigned to rows of a file, computed once for all records with the same channels.

    Parameters
    ----------
    channels : sequence of RawChannel
        Channels of the layout.
    source : Source
        The raw file.
    is_passage : bool
        Whether its records are of passages.
    """

    def __init__(self, channels: Sequence[RawChannel], source: Source, is_passage: bool = False):
        self.channels, self.source, self.is_passage = channels, source, is_passage
        self._has_sensitivity = any(c.sensitivity is not None for c in channels)
        self._keyed: tuple[RawRecord, tuple] | None = None
        self._stated: tuple[Any, tuple] = (None, ())  # entries, which records may share, and what they state of units
        self._rows: dict[tuple, set[int]] = {}
        self._mappings: dict[tuple, tuple[ChannelMapping, ...]] = {}

    def sensor_rows(self, record: RawRecord, where: str) -> set[int]:
        """Rows that the layout assigns to a sensor.

        Parameters
        ----------
        record : RawRecord
            The record as it is in the file.
        where : str
            The record, for the message.

        Returns
        -------
        set of int
            Numbers of the rows, from 0.
        """
        key = self._key(record)
        if key not in self._rows:
            self._rows[key] = _sensor_rows(record, self.channels, where, self.source)
        return self._rows[key]

    def _key(self, record: RawRecord) -> tuple:
        """What the assignment depends on; aliases only if a channel of the layout is called by one.

        Only entries that state a unit, a sensitivity or a sensor count, with those that may name its channel.
        """
        if self._keyed is not None and self._keyed[0] is record:
            return self._keyed[1]
        self._keyed = record, self._key_of(record)
        return self._keyed[1]

    def _key_of(self, record: RawRecord) -> tuple:
        is_named = all(isinstance(c.source, int) or c.source in record.names for c in self.channels)
        aliases = () if is_named else record.aliases
        if self._stated[0] is not record.entries:
            self._stated = record.entries, self._stated_of(record)
        open_scales = tuple(record.undecided.items()), tuple(record.unit_conflicts.items())
        return record.names, record.units, aliases, open_scales, self._stated[1]

    def _stated_of(self, record: RawRecord) -> tuple:
        """What the entries of a record state about units, quantities, sensitivities and sensors."""
        sensitivities: tuple[str, ...] = ()
        if self._has_sensitivity and states_sensitivity(record.entries):
            sensitivities = tuple(f"{entry.place}: {entry.name}: {entry.value}" for entry in record.entries)
        quantities = tuple((e.place, e.name, str(e.value)) for e in quantity_entries(record.entries))
        sensors = tuple((e.place, e.name, str(e.value)) for e in describing_entries(record.entries, self.channels))
        return sensitivities, key_of_units(record.entries), quantities, sensors

    def mappings(self, record: RawRecord, where: str) -> tuple[ChannelMapping, ...]:
        """As ``channel_mappings``.

        Parameters
        ----------
        record : RawRecord
            The record as it is in the file.
        where : str
            The record, for the message.

        Returns
        -------
        tuple of ChannelMapping
            One mapping per channel that is read, in the order of the layout.

        Raises
        ------
        ReadError
            If file and layout disagree about channels or units.
        """
        key = self._key(record)
        if key not in self._mappings or record.audio:
            self._mappings[key] = channel_mappings(record, self.channels, where, self.source, self.is_passage)
        return self._mappings[key]
