"""Conversion of raw records to recordings in SI units, for all formats.

It assigns the channels of a file to those of the layout, converts units and checks what the layout states.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.lazy import BlockReader, ChannelStatistics, Column, channel_error
from turnout.readers.lost_entries import is_single, lost_entry_errors
from turnout.readers.packing import fill_values
from turnout.readers.rate_agreement import rate_remark, resolve
from turnout.readers.rate_words import CERTAIN, is_rate_name, rate_unit
from turnout.readers.source import BLOCK_SIZE, COPY_AGAIN, MIN_SAMPLES, RawFile, RawRecord, Source
from turnout.readers.start_times import check_order, is_plausible, start_errors, start_times
from turnout.readers.stated_quantities import contradicting_quantity, quantity_entries
from turnout.readers.stated_scales import remedy as scale_remedy
from turnout.readers.stated_sensitivities import sensitivity_entries, sensitivity_problem
from turnout.readers.stated_units import contradicting_unit, is_meaningless, key_of_units
from turnout.readers.time_axes import all_statements, is_axis_name
from turnout.readers.unexplained_entries import EntryCheck
from turnout.records import Channel, LongRecording, RawChannel, RawDescription, Recording
from turnout.units import IGNORED, conversion, to_si

FULL_SCALE_UNIT = re.compile(r"\s*[+-]?[\d.]")  # a unit with a number, as in "10 V"


@dataclass(frozen=True)
class ChannelMapping:
    """Row ``index`` of the file becomes ``channel``: SI = ``scale`` * number + ``offset``, sign included."""

    index: int
    channel: Channel
    scale: float
    offset: float


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
    indices = [index_of(record, channel.source, where, source) for channel in channels]
    if len(set(indices)) < len(indices):
        twice = next(i for i in indices if indices.count(i) > 1)
        raise source.error(where, f"the layout names the channel {record.names[twice]!r} twice", "Name each once")
    unknown = sorted(set(range(len(record.names))) - set(indices))
    if unknown := [
        i for i in unknown if not is_axis_name(record.names[i], record.units[i]) and not is_rate_name(record.names[i])
    ]:
        names = ", ".join(repr(record.names[i]) for i in unknown)
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


def index_of(record: RawRecord, wanted: str | int, where: str, source: Source) -> int:
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
        raise source.error(where, problem, "Correct the channel map or copy the file again", reason="channel_missing")
    for names in (record.names, [n.strip().casefold() for n in record.names]):
        key = wanted if names is record.names else wanted.strip().casefold()
        if names.count(key) == 1:
            return names.index(key)
    matches = [i for i, aliases in enumerate(record.aliases) if wanted in aliases]
    if len(matches) == 1:
        return matches[0]
    available = ", ".join(repr(name) for name in record.names)
    similar_names = get_close_matches(wanted, record.names, n=1)
    hint = (
        f"Did you mean {similar_names[0]!r}? Correct the channel map"
        if similar_names
        else "Correct the channel map or the wiring"
    )
    count = record.names.count(wanted) + len(matches)
    problem = (
        f"{count} channels are called {wanted!r}"
        if count > 1
        else f"there is no channel {wanted!r}; there are {available}"
    )
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
    try:
        conversion_to_si = to_si(raw.quantity, resolve_unit(file_unit, raw.unit), raw.sensitivity, raw.sensitivity_unit)
    except ValueError as error:
        remedy = "Correct unit and sensitivity of this channel in the layout"
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
    is_fraction = record.is_floating_audio and not is_overruled and FULL_SCALE_UNIT.match(raw.unit or "")
    if is_fraction and (largest := _largest(record.samples[index])) > 1.0:
        problem = f"its numbers reach {largest:.4g}, so they are no fractions of the full scale {raw.unit!r}"
        remedy = "The logger wrote physical numbers: set the unit in the layout without a number, such as 'unit: V'"
        raise source.error(place, problem, remedy, reason="out_of_scale")
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


def _check_stated_units(record: RawRecord, index: int, raw: RawChannel, place: str, source: Source) -> None:
    """ReadError if the metadata or the name of a channel state another unit or quantity than the one in use."""
    unit_in_use = record.units[index] if not is_meaningless(record.units[index]) else raw.unit or ""
    if quantity := contradicting_quantity(record, index, raw.quantity, unit_in_use):
        problem = f"the file says that its quantity is {quantity}, the layout {raw.quantity} in {unit_in_use!r}"
        remedy = f"Correct the channel map; if the layout is right, set 'unit: {unit_in_use}!' for this channel"
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


def _check_fill_values(record: RawRecord, mappings: Sequence[ChannelMapping], where: str, source: Source) -> None:
    """ReadError if samples equal a number that the file states for missing samples."""
    fills = fill_values(record.entries, record.names)
    for mapping in mappings:
        column = record.samples[mapping.index]
        for fill in fills[mapping.index]:
            blocks = (column[start : start + BLOCK_SIZE] for start in range(0, len(column), BLOCK_SIZE))
            if n := sum(int(np.count_nonzero(block == fill)) for block in blocks):
                problem = f"{n} samples are {fill:g}, which the file states for missing ones"
                remedy = "Export the record again from the logger; if it is so there too, check the channel's cable"
                place = f"{where}, channel {mapping.channel.name!r}"
                raise source.error(place, problem, remedy, reason="not_finite")


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
        raise ValueError(_conflict_text(f"{file_unit!r}, which is not known", layout_unit)) from None
    of_a_count = stated.dimension == "voltage" or layout_unit.lstrip(" [+-.")[:1].isdigit()
    same = stated.dimension == written.dimension and abs(stated.scale - written.scale) <= 1e-9 * abs(stated.scale)
    if not same and not (written.dimension == "count" and of_a_count):
        raise ValueError(_conflict_text(repr(file_unit), layout_unit))
    return layout_unit


def _conflict_text(statement: str, layout_unit: str) -> str:
    return f"the file says {statement}, the layout {layout_unit!r} ({layout_unit + '!'!r} would overrule the file)"


def convert_records(
    raw: RawFile, description: RawDescription, source: Source, max_duration: float | None = None
) -> tuple[tuple[Recording | LongRecording, ...], tuple[ReadError, ...]]:
    """Convert the records of a raw file to recordings; a damaged record does not affect the others.

    In a passage a dead or non-finite channel is left out of the recording and adds an error. A hammer test needs all
    its channels.

    Parameters
    ----------
    raw : RawFile
        The records as they are in the file.
    description : RawDescription
        What the layout states about the file.
    source : Source
        The raw file.
    max_duration : float or None
        A longer record becomes a ``LongRecording`` if the source is lazy; None: all are read. [s]

    Returns
    -------
    tuple of (tuple of Recording or LongRecording, tuple of ReadError)
        Recordings of the intact records; errors of the others and of channels that were left out.

    Raises
    ------
    ReadError
        If the file holds no record.
    """
    if not raw.records and not raw.expected:
        raise source.error("the file", "it holds no record", COPY_AGAIN, reason="empty")
    recordings: list[Recording | LongRecording] = []
    errors: list[ReadError] = []
    stamps = [(k, record.started_at) for k, record in enumerate(raw.records) if not isinstance(record, ReadError)]
    starts = start_times(stamps, description.time_zone)
    order_errors = check_order(starts, source)
    start_of = dict(starts)
    assignments = Assignments(description.channels, source)
    entry_check = EntryCheck(description, source)
    for k, record in enumerate(raw.records):
        try:
            if isinstance(record, ReadError):
                raise record
            if k in order_errors:
                raise order_errors[k]
            record = entry_check.without_checked(record)
            limit = max_duration if source.lazy and description.kind == "passage" else None
            start = start_of[k]
            started_at = start if start and is_plausible(start) else None
            recording, channel_errors = _recording(
                record, k, len(raw.records), started_at, assignments, entry_check, description, source, limit
            )
            recordings.append(recording)
            remarked = {
                e.problem for e in errors if e.reason in ("rate_ambiguous", "entry_unknown")
            }  # once for all records
            errors.extend(error for error in channel_errors if error.problem not in remarked)
        except ReadError as error:
            errors.append(error)
    errors.extend(_count_errors(raw, description, source))
    errors.extend(raw.remarks)
    errors.extend(lost_entry_errors(raw.records, source))
    unread = {k: r.unread_start for k, r in enumerate(raw.records) if isinstance(r, RawRecord) and r.unread_start}
    kept = [(k, stamp) for k, stamp in stamps if k not in order_errors]
    errors.extend(start_errors(kept, unread, description.time_zone, source))
    return tuple(recordings), tuple(errors)


def errors_without_layout(raw: RawFile, source: Source) -> Iterator[ReadError]:
    """Errors about a raw file that need no layout: what ``convert_records`` would report or reject.

    Parameters
    ----------
    raw : RawFile
        The records as they are in the file.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        Remarks of the reader, lost entries and start times; for each channel the first record with a scale of which
        nothing says whether it is applied, and the first with missing samples.
    """
    yield from raw.remarks
    yield from lost_entry_errors(raw.records, source)
    records = [(k, record) for k, record in enumerate(raw.records) if isinstance(record, RawRecord)]
    unread = {k: record.unread_start for k, record in records if record.unread_start}
    yield from start_errors([(k, record.started_at) for k, record in records], unread, "UTC", source)
    reported: set[tuple[str, str]] = set()
    for k, record in records:
        fills = fill_values(record.entries, record.names)
        for i, (name, unit, column) in enumerate(zip(record.names, record.units, record.samples)):
            where = f"record {k + 1} of {len(raw.records)}, channel {name!r}"
            if (statement := record.undecided.get(i)) and (name, "scale") not in reported:
                reported.add((name, "scale"))
                yield source.error(where, statement, scale_remedy(unit), reason="scale_unknown")
            if (name, "samples") not in reported and (n := _missing_count(column, fills[i])):
                reported.add((name, "samples"))
                problem = "1 sample is missing" if n == 1 else f"{n} samples are missing"
                yield source.error(where, problem, "Export the record again from the logger", reason="not_finite")


def _missing_count(column: Column, fills: Sequence[float]) -> int:
    """Number of samples that are no finite numbers or equal a fill value."""
    if column.dtype.kind not in "fiu":
        return 0
    blocks = (np.asarray(column[start : start + BLOCK_SIZE]) for start in range(0, len(column), BLOCK_SIZE))
    return sum(int(np.count_nonzero(~np.isfinite(block) | np.isin(block, fills))) for block in blocks)


def _count_errors(raw: RawFile, description: RawDescription, source: Source) -> Iterator[ReadError]:
    """Errors where the number of records differs from that stated by the layout or by the file itself."""
    n_present = len(raw.records)
    layout_remedy = _copy_or_correct("records", description.n_records)
    promises = (("the layout", description.n_records, layout_remedy), ("its own header", raw.expected, COPY_AGAIN))
    for promiser, promised, remedy in promises:
        if promised is not None and n_present < promised:
            problem = f"it holds {n_present} of the {promised} records that {promiser} promises"
            yield source.error(f"record {n_present + 1} of {promised}", problem, remedy, reason="truncated")
            return
    if description.n_records is not None and n_present > description.n_records:
        problem = f"it holds {n_present} records, {n_present - description.n_records} more than the layout promises"
        remedy = "Correct records in the layout, or find out whether two tests share one file"
        yield source.error(f"record {description.n_records + 1}", problem, remedy, reason="wrong_length")


def _copy_or_correct(key: str, promised: int | None) -> str:
    """Remedy if a file holds less than the layout's ``key`` states: either may be wrong."""
    return f"{COPY_AGAIN}; if it is whole, correct '{key}: {promised}' in the layout (null: any number)"


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
        if key not in self._mappings or record.is_floating_audio:
            self._mappings[key] = channel_mappings(record, self.channels, where, self.source)
        return self._mappings[key]


def _recording(
    record: RawRecord,
    k: int,
    n_record: int,
    started_at: datetime | None,
    assignments: Assignments,
    entry_check: EntryCheck,
    description: RawDescription,
    source: Source,
    max_duration: float | None,
) -> tuple[Recording | LongRecording, list[ReadError]]:
    """(recording, errors of channels left out) of raw record ``k``; ReadError if the record cannot be used."""
    where = f"record {k + 1} of {n_record}"
    n_sample = _sample_count(record, where, description.n_samples, source)
    sensor_rows = assignments.sensor_rows(record, where)
    statements = all_statements(record, k, n_record, sensor_rows, where, source)
    rate = resolve(statements, description.rate, where, source)
    channel_maps = assignments.mappings(record, where)
    if not channel_maps:
        raise source.error(where, "the layout wants none of its channels", "Name channels in the layout")
    _check_fill_values(record, channel_maps, where, source)
    block_reader = BlockReader(record, channel_maps, where, source, source.state())
    is_long = max_duration is not None and n_sample / rate > max_duration
    samples = np.empty((0, 0)) if is_long else block_reader(0, n_sample)
    statistics = (
        ChannelStatistics.from_record(block_reader, n_sample) if is_long else ChannelStatistics.from_samples(samples)
    )
    faults = {
        i: e
        for i, channel_statistics in enumerate(statistics.by_channel())
        if (e := channel_error(n_sample, channel_statistics, channel_maps[i].channel, where, source))
    }
    if faults and (description.kind != "passage" or len(faults) == len(channel_maps)):
        raise next(iter(faults.values()))
    usable = [i for i in range(len(channel_maps)) if i not in faults]
    fields: dict[str, Any] = {
        "rate": rate,
        "channels": tuple(channel_maps[i].channel for i in usable),
        "kind": description.kind,
        "source": source.name,
        "record": k,
        "started_at": started_at,
        "conditions": MappingProxyType({n: v for n, v in record.conditions.items() if is_single(v)}),
    }
    of_rate = rate_remark(statements, rate, where, source)
    is_rate_stated = any(s.certainty == CERTAIN and s.intervals for s in statements)
    of_entries = entry_check.remark(record, rate, n_record, where, is_rate_stated)
    channel_errors = [*faults.values(), *(remark for remark in (of_rate, of_entries) if remark)]
    if is_long:
        return LongRecording(block_reader.subset(usable), n_sample, **fields), channel_errors
    return Recording(samples=samples if not faults else samples[usable], **fields), channel_errors


def _sample_count(record: RawRecord, where: str, promised: int | None, source: Source) -> int:
    lengths = {name: len(x) for name, x in zip(record.names, record.samples)}
    shortest = min(lengths.values(), default=0)
    longest = max(lengths.values(), default=0)
    if shortest != longest:
        short = next(name for name, n in lengths.items() if n == shortest)
        problem = f"channel {short!r} ends after {shortest} samples, others after {longest}"
        raise source.error(where, problem, COPY_AGAIN, reason="truncated")
    if promised is not None and shortest < promised:
        problem = f"ends after {shortest} of the {promised} samples that the layout promises"
        raise source.error(where, problem, _copy_or_correct("samples", promised), reason="truncated")
    if promised is not None and shortest > promised:
        problem = f"it has {shortest} samples instead of {promised}"
        remedy = "Correct samples in the layout, or find out why the logger was set differently"
        raise source.error(where, problem, remedy, reason="wrong_length")
    if shortest < MIN_SAMPLES:
        raise source.error(
            where, f"it has {shortest} samples", COPY_AGAIN, reason="empty" if not shortest else "truncated"
        )
    return shortest
