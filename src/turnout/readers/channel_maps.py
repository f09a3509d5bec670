"""Channels of the layout assigned to rows of a file, with their units."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from turnout.counts import first_texts
from turnout.errors import ReadError
from turnout.readers.entries import UnreadObject
from turnout.readers.lazy import Column
from turnout.readers.rate_units import rate_unit
from turnout.readers.rate_words import is_rate_name
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source
from turnout.readers.stated_quantities import contradicting_quantity, quantity_entries
from turnout.readers.stated_scales import remedy as scale_remedy
from turnout.readers.stated_sensitivities import sensitivity_entries, sensitivity_problem
from turnout.readers.stated_units import contradicting_unit, is_meaningless, key_of_units
from turnout.readers.time_axes import is_axis_name
from turnout.records import Channel, RawChannel
from turnout.units import IGNORED, conversion, to_si

FULL_SCALE_UNIT = re.compile(r"\s*[+-]?[\d.]")  # a unit with a number, as in "10 V"


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
    record: RawRecord, channels: Sequence[RawChannel], where: str, source: Source
) -> tuple[ChannelMapping, ...]:
    """Assign the channels of the layout to rows of the file.

    ``RawChannel.limit`` and ``resolution`` are in SI already. Channels with the quantity "ignored" are not read and may
    be absent.

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

    Returns
    -------
    tuple of ChannelMapping
        One mapping per channel that is read, in the order of the layout.

    Raises
    ------
    ReadError
        If file and layout disagree about channels or units.
    """
    channels = [c for c in channels if c.quantity != IGNORED or _has_channel(record, c.source, where, source)]
    sources = [channel.source for channel in channels]
    indices = [index_of(record, wanted, where, source, sources) for wanted in sources]
    if len(set(indices)) < len(indices):
        twice = next(i for i in indices if indices.count(i) > 1)
        raise source.error(where, f"the layout names the channel {record.names[twice]!r} twice", "Name each once")
    unknown = sorted(set(range(len(record.names))) - set(indices))
    if unknown := [
        i for i in unknown if not is_axis_name(record.names[i], record.units[i]) and not is_rate_name(record.names[i])
    ]:
        names = _name_list([record.names[i] for i in unknown])
        raise source.error(
            where,
            f"the file has {'channel' if len(unknown) == 1 else 'channels'} {names}, which the layout does not name",
            f"Add it to the layout, with 'quantity: {IGNORED}' if it is not wanted",
            reason="channel_unknown",
        )
    return tuple(
        _channel_mapping(i, record, channel, where, source)
        for i, channel in zip(indices, channels)
        if channel.quantity != IGNORED
    )


MAX_LISTED = 12  # channels that a message names
CORRECT_SOURCE = "Correct 'source' of this channel in the layout"


def _name_list(names: Sequence[str]) -> str:
    """Names for a message, the first ones of a long list."""
    return first_texts([*map(repr, names)], MAX_LISTED)


def index_of(
    record: RawRecord, wanted: str | int, where: str, source: Source, assigned: Sequence[str | int] = ()
) -> int:
    """Row of the channel that the layout calls ``wanted``: a number, a name, or an alias of the format.

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
        problem = f"there is no channel {wanted}; the file has {len(record.names)}, counted from 0"
        raise source.error(where, problem, f"{CORRECT_SOURCE}, or copy the file again", reason="channel_missing")
    for names in (record.names, [n.strip().casefold() for n in record.names]):
        key = wanted if names is record.names else wanted.strip().casefold()
        if names.count(key) == 1:
            return names.index(key)
    if wanted in record.not_numbers:
        content = record.not_numbers[wanted]
        problem = f"the channel {wanted!r} holds {content}, no real numbers"
        remedy = "Export its samples as whole or floating-point numbers"
        if isinstance(content, UnreadObject):
            problem = f"the channel {wanted!r} is {content.with_article}, no array of real numbers"
            remedy = content.remedy(wanted)
        raise source.error(where, problem, remedy, reason="channel_missing")
    matches = [i for i, aliases in enumerate(record.aliases) if wanted in aliases]
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
    raise source.error(where, problem, hint, reason="channel_missing")


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
    place, file_unit = f"{where}, channel {raw.name!r}", record.units[index]
    if (dtype := record.samples[index].dtype).kind not in "fiu":
        problem = f"its samples are {kind_of(dtype)}, no real numbers"
        raise source.error(place, problem, "Export them as whole or floating-point numbers", reason="channel_missing")
    try:
        conversion_to_si = to_si(raw.quantity, resolve_unit(file_unit, raw.unit), raw.sensitivity, raw.sensitivity_unit)
    except ValueError as error:
        remedy = "Correct 'unit' or 'sensitivity' of this channel in the layout"
        raise source.error(place, str(error), remedy, reason="unit_unknown") from error
    if (statement := record.undecided.get(index)) and not (raw.unit or "").endswith("!"):
        raise source.error(place, statement, scale_remedy(file_unit), reason="scale_unknown")
    is_overruled = (raw.unit or "").endswith("!")
    if not is_overruled:
        _check_stated_units(record, index, raw, place, source)
    if raw.sensitivity is not None and not is_overruled:
        stated = record.entries, raw.sensitivity, raw.sensitivity_unit, raw.quantity, record.names, index
        if problem := sensitivity_problem(*stated):
            remedy = f"Correct the layout; if it is right, set 'unit: {raw.unit or file_unit}!' for this channel"
            raise source.error(place, problem, remedy, reason="scale_unknown")
    if record.audio and not is_overruled:
        _check_full_scale(record, index, raw.unit or "", place, source)
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


def _check_full_scale(record: RawRecord, index: int, unit: str, place: str, source: Source) -> None:
    """ReadError if the numbers of an audio file are fractions of a full scale that nothing states, or are none."""
    is_stated = bool(FULL_SCALE_UNIT.match(unit))
    if record.audio == "whole" and not is_stated and is_meaningless(record.units[index]):
        problem = f"its whole numbers are fractions of full scale, and nothing says what full scale is in {unit!r}"
        remedy = f"Set it in the layout, such as 'unit: 10 {unit}'; 'unit: 1 {unit}' if full scale is one"
        raise source.error(place, problem, remedy, reason="scale_unknown")
    if record.audio == "floating" and is_stated and (largest := _largest(record.samples[index])) > 1.0:
        problem = f"its numbers reach {largest:.4g}, so they are no fractions of the full scale {unit!r}"
        remedy = "The logger wrote physical numbers: set the unit in the layout without a number, such as 'unit: V'"
        raise source.error(place, problem, remedy, reason="out_of_scale")


def _check_stated_units(record: RawRecord, index: int, raw: RawChannel, place: str, source: Source) -> None:
    """ReadError if the metadata or the name of a channel state another unit or quantity than the one in use."""
    unit_in_use = record.units[index] if not is_meaningless(record.units[index]) else raw.unit or ""
    if quantity := contradicting_quantity(record, index, raw.quantity, unit_in_use):
        problem = f"the file says that its quantity is {quantity}, the layout {raw.quantity} in {unit_in_use!r}"
        remedy = f"{CORRECT_SOURCE}; if the layout is right, set 'unit: {unit_in_use}!' for this channel"
        raise source.error(place, problem, remedy, reason="unit_unknown")
    rival = contradicting_unit(record, index, raw.unit, raw.quantity, lambda unit: _is_usable(unit, raw))
    if not rival:
        return
    holder = "the layout" if is_meaningless(record.units[index]) else "its unit"
    problem = f"its metadata or its name {record.names[index]!r} say {rival!r}, {holder} {unit_in_use!r}"
    choices = " or ".join(f"'unit: {unit}!'" for unit in (rival, unit_in_use) if _is_usable(unit, raw))
    remedy = f"Find out which is right; then set it in the layout as {choices or 'a unit with !'}"
    raise source.error(place, problem, remedy, reason="unit_unknown")


def _is_usable(unit: str, raw: RawChannel) -> bool:
    """Whether numbers in a unit can become the quantity of the channel, by its sensitivity if it has one."""
    try:
        to_si(raw.quantity, unit, raw.sensitivity, raw.sensitivity_unit)
    except ValueError:
        return False
    return True


def _largest(column: Column) -> float:
    """Largest absolute number of a column that is finite."""
    blocks = (column[start : start + BLOCK_SIZE] for start in range(0, len(column), BLOCK_SIZE))
    return max((float(np.fmax(np.nanmax(block), -np.nanmin(block))) for block in blocks), default=0.0)


def resolve_unit(file_unit: str, layout_unit: str | None) -> str:
    """Unit of the raw numbers, from the file and the layout.

    Both must agree if both state one; "V!" in a layout overrules the file. If the file states counts, the layout gives
    the value of one count: a voltage, or a unit with a factor. The layout overrules meaningless labels.

    Parameters
    ----------
    file_unit : str
        Unit that the file states, "" without one.
    layout_unit : str or None
        Unit that the layout states, or None.

    Returns
    -------
    str
        The unit that holds, which may have a factor.

    Raises
    ------
    ValueError
        If no unit is stated, the units differ, or the file's unit is not known.

    Examples
    --------
    >>> resolve_unit("Newtons", None), resolve_unit("EU", "mV"), resolve_unit("g", "V!"), resolve_unit("count", "0.5 N")
    ('Newtons', 'mV', 'V', '0.5 N')
    """
    if layout_unit is None:
        if not file_unit:
            raise ValueError("neither the file nor the layout says the unit")
        return file_unit
    if layout_unit.endswith("!"):
        return layout_unit[:-1]
    stated = conversion(layout_unit)
    if is_meaningless(file_unit):
        return layout_unit
    try:
        written = conversion(file_unit)
    except ValueError:
        raise ValueError(
            f"the file says {file_unit!r}, which is not known, the layout {layout_unit!r} "
            f"('unit: {layout_unit}!' if the layout is right)"
        ) from None
    of_a_count = stated.dimension == "voltage" or layout_unit.lstrip(" [+-.")[:1].isdigit()
    same = stated.dimension == written.dimension and abs(stated.scale - written.scale) <= 1e-9 * abs(stated.scale)
    if not same and not (written.dimension == "count" and of_a_count):
        raise ValueError(
            f"the file says {file_unit!r}, the layout {layout_unit!r} "
            f"('unit: {file_unit}' if the file is right, 'unit: {layout_unit}!' if the layout is)"
        )
    return layout_unit


class Assignments:
    """Channels of the layout assigned to rows of a file, computed once for all records with the same channels.

    Parameters
    ----------
    channels : sequence of RawChannel
        Channels of the layout.
    source : Source
        The raw file.
    """

    def __init__(self, channels: Sequence[RawChannel], source: Source):
        self.channels, self.source = channels, source
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

        Only entries that state a unit or a sensitivity count, with those that may name its channel.
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
        return record.names, record.units, aliases, tuple(record.undecided.items()), self._stated[1]

    def _stated_of(self, record: RawRecord) -> tuple:
        """What the entries of a record state about units, quantities and sensitivities."""
        sensitivities: tuple[str, ...] = ()
        if self._has_sensitivity and sensitivity_entries(record.entries):
            sensitivities = tuple(f"{entry.place}: {entry.name}: {entry.value}" for entry in record.entries)
        quantities = tuple((e.place, e.name, str(e.value)) for e in quantity_entries(record.entries))
        return sensitivities, key_of_units(record.entries), quantities

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
            self._mappings[key] = channel_mappings(record, self.channels, where, self.source)
        return self._mappings[key]
