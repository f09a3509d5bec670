"""Faults of a record: absent channels, missing samples, blocks that occur twice, channels without a signal."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from turnout.counts import count_of, first_texts
from turnout.errors import ReadError
from turnout.readers.blocks import LARGEST_NUMBER, ChannelStatistics, channel_error
from turnout.readers.channel_maps import MAX_LISTED, ChannelMapping
from turnout.readers.column_forms import is_count_or_time, rises_in_steps
from turnout.readers.lazy import Column
from turnout.readers.missing_codes import count_alone, missing_code
from turnout.readers.packing import fill_values
from turnout.readers.repeated_blocks import repeated_block
from turnout.readers.scaled_copies import N_COMPARED, scaled_copies
from turnout.readers.simultaneous_records import MAX_ROUNDING, add_shared, shared_channels
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source
from turnout.records import RawChannel, RawDescription
from turnout.units import IGNORED

MISSING_REMEDY = "Export the record again from the logger; if it is so there too, check the channel's cable and range"
REPEAT_REMEDY = (
    "Export the record again; if its rows were appended twice, delete the second ones. If the logger's own file has "
    "them, a buffer was written twice and the samples in its place are lost"
)
AXIS_PROBLEM = "its samples rise in equal steps: they are times or count the samples, and no sensor measured them"
AXIS_REMEDY = "Correct 'source' of this channel in the layout; export each channel without a time of its own beside it"


def _missing_sample_errors(
    record: RawRecord, mappings: Sequence[ChannelMapping], statistics: ChannelStatistics, where: str, source: Source
) -> dict[int, ReadError]:
    """Errors by index of the channels with samples that the file states to be missing, or that are a code for it."""
    errors: dict[int, ReadError] = {}
    fills = fill_values(record.entries, record.names)
    for i, mapping in enumerate(mappings):
        column = record.samples[mapping.index]
        counts = [(_count_equal(column, x), x, "which the file states for missing ones") for x in fills[mapping.index]]
        for extreme in (statistics.lowest[i], statistics.highest[i]):
            code = missing_code((extreme - mapping.offset) / mapping.scale)
            if code is not None:
                counts.append((count_alone(column, code), code, "a usual code for a missing one"))
        if problems := [f"{n} of {len(column)} samples are {x:.7g}, {meaning}" for n, x, meaning in counts if n]:
            place = f"{where}, channel {mapping.channel.name!r}"
            errors[i] = source.error(place, problems[0], MISSING_REMEDY, reason="not_finite")
    return errors


COPY_REMEDY = "Name one of them 'ignored' in the layout, or correct 'source' if they are two sensors"


def _copy_errors(
    record: RawRecord, mappings: Sequence[ChannelMapping], where: str, source: Source
) -> dict[int, ReadError]:
    """Errors by index of the channels that are an earlier one of the record, in the same or in other units."""
    errors: dict[int, ReadError] = {}
    measured = [i for i, m in enumerate(mappings) if m.channel.quantity != "temperature"]
    heads = [np.asarray(record.samples[mappings[i].index][:N_COMPARED]) for i in measured]
    for first, second, factor in scaled_copies(heads):
        i, j = measured[first], measured[second]
        if mappings[i].channel.quantity != mappings[j].channel.quantity:
            continue
        factor *= mappings[j].scale / mappings[i].scale
        times = "" if abs(factor - 1.0) <= MAX_ROUNDING else f" times {factor:.4g}"
        problem = f"its samples are those of channel {mappings[i].channel.name!r}{times}: one signal is there twice"
        place = f"{where}, channel {mappings[j].channel.name!r}"
        errors.setdefault(j, source.error(place, problem, COPY_REMEDY, reason="duplicate"))
    return errors


def _count_equal(column: Column, value: float) -> int:
    """Number of samples that equal a value."""
    blocks = (column[start : start + BLOCK_SIZE] for start in range(0, len(column), BLOCK_SIZE))
    return sum(int(np.count_nonzero(block == value)) for block in blocks)


def repetition_errors(records: Sequence[tuple[int, RawRecord]], source: Source) -> Iterator[ReadError]:
    """Errors of blocks of samples, channels and records that a file holds twice.

    Parameters
    ----------
    records : sequence of tuple of (int, RawRecord)
        Number of each record, from 0, and the record as it is in the file.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        One for each record and each pair of records.
    """
    in_memory = {
        k: [x.astype(float) for x in record.samples if isinstance(x, np.ndarray) and x.dtype.kind in "fiu"]
        for k, record in records
    }
    for k, samples in in_memory.items():
        repeat = (
            repeat_error(np.array(samples), f"record {k + 1}", source) if len(set(map(len, samples))) == 1 else None
        )
        yield from [repeat] if repeat else []
    errors: dict[int, ReadError] = {}
    names = {k: record.names for k, record in records}
    for first, second, row, is_whole in shared_channels(list(in_memory.items())):
        add_shared(errors, (first, second), "" if is_whole else names[first][row], source)
    yield from errors.values()


def count_missing(column: Column, fills: Sequence[float]) -> int:
    """Number of samples that are no finite numbers, equal a fill value or are a code for a missing sample.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        Samples of a channel.
    fills : sequence of float
        Numbers that the file states for missing samples.

    Returns
    -------
    int
        0 for a column of no numbers.
    """
    if column.dtype.kind not in "fiu":
        return 0
    count = 0
    extremes: list[float] = []
    for start in range(0, len(column), BLOCK_SIZE):
        block = np.asarray(column[start : start + BLOCK_SIZE])
        is_measured = (np.abs(block) < LARGEST_NUMBER) & ~np.isin(block, fills)
        count += int(np.count_nonzero(~is_measured))
        if is_measured.any():
            extremes += [float(block[is_measured].min()), float(block[is_measured].max())]
    codes = {missing_code(x) for x in (min(extremes), max(extremes))} - {None} if extremes else set()
    return count + sum(count_alone(column, code) for code in codes if code is not None)


def repeat_error(samples: np.ndarray, where: str, source: Source) -> ReadError | None:
    """The error of a record that holds a block of samples twice.

    Parameters
    ----------
    samples : (n_channel, n_sample) array of float
        Samples of its channels.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    ReadError or None
        None without a repeated block.
    """
    block = repeated_block(samples)
    if block is None:
        return None
    start, copy, n = block
    problem = f"its samples {copy} to {copy + n - 1} repeat the samples {start} to {start + n - 1} to the last digit"
    return source.error(where, problem, REPEAT_REMEDY, reason="duplicate")


def absent_channels_error(
    mappings: Sequence[ChannelMapping], channels: Sequence[RawChannel], where: str, source: Source
) -> list[ReadError]:
    """One error about all channels of the layout that the file does not have and that were left out; none without one.

    Parameters
    ----------
    mappings : sequence of ChannelMapping
        Channels that are read.
    channels : sequence of RawChannel
        Channels of the layout.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    list of ReadError
    """
    names = {mapping.channel.name for mapping in mappings}
    absent = [str(c.source) for c in channels if c.quantity != IGNORED and c.name not in names]
    if not absent:
        return []
    listed = first_texts([*map(repr, absent)], MAX_LISTED)
    noun, verb = "channel" if len(absent) == 1 else "channels", "is" if len(mappings) == 1 else "are"
    problem = f"the file does not have the {noun} {listed}; its {count_of(len(mappings), 'other channel')} {verb} used"
    return [source.error(where, problem, ABSENT_REMEDY, reason="channel_missing")]


ABSENT_REMEDY = "Nothing is to be done if another logger records them; else find out why this one did not"


def decisive_fault(
    description: RawDescription, channel_maps: Sequence[ChannelMapping], faults: Mapping[int, ReadError]
) -> ReadError | None:
    """The fault that makes a record useless: of a channel that is needed, or where no response is left.

    Parameters
    ----------
    description : RawDescription
        What the layout states about the file.
    channel_maps : sequence of ChannelMapping
        Channels of the record.
    faults : mapping of int to ReadError
        Error of each channel that cannot be used, by its index.

    Returns
    -------
    ReadError or None
        None if the other channels can be used.
    """
    channels = [c.channel for c in channel_maps]
    is_hammer = description.kind == "hammer"
    needed = {c.name for c in channels if is_hammer and c.quantity == "force"} | set(description.required)
    decisive = [e for i, e in faults.items() if channels[i].name in needed]
    auxiliary = ("force", "temperature") if is_hammer else ()
    has_response = any(c.quantity not in auxiliary for i, c in enumerate(channels) if i not in faults)
    return next(iter(decisive if has_response else [*decisive, *faults.values()]), None)


def faults_by_channel(
    record: RawRecord,
    channel_maps: Sequence[ChannelMapping],
    statistics: ChannelStatistics,
    n_sample: int,
    where: str,
    source: Source,
) -> dict[int, ReadError]:
    """Error of each channel that cannot be used, by its index: those with missing samples first.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    channel_maps : sequence of ChannelMapping
        Its channels.
    statistics : ChannelStatistics
        Of these channels.
    n_sample : int
        Number of samples of each.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    dict of int to ReadError
        By the index of the channel.
    """
    of_statistics = {
        i: e
        for i, channel_statistics in enumerate(statistics.by_channel())
        if (e := channel_error(n_sample, channel_statistics, channel_maps[i].channel, where, source))
    }
    of_axes = {
        i: source.error(f"{where}, channel {mapping.channel.name!r}", AXIS_PROBLEM, AXIS_REMEDY, "channel_missing")
        for i, mapping in enumerate(channel_maps)
        if mapping.channel.quantity in ("force", "acceleration")
        and (is_count_or_time(column := record.samples[mapping.index]) or rises_in_steps(column))
    }
    of_copies = _copy_errors(record, channel_maps, where, source)
    return of_copies | _missing_sample_errors(record, channel_maps, statistics, where, source) | of_axes | of_statistics
