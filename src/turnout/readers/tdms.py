"""Reader of National Instruments TDMS: each group with samples is a record.

npTDMS reads a truncated file without an error. Therefore the file size is compared with the lead-ins of the segments,
and the length of each channel with ``wf_samples``.
"""

import struct
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any, BinaryIO

import nptdms

from turnout.errors import ReadError
from turnout.readers.lazy import Column, LazyColumn
from turnout.readers.named_arrays import RECORD_COUNT_NAMES, START_NAMES, Metadata, natural_sort_key
from turnout.readers.source import COPY_AGAIN, RawFile, RawRecord, Source
from turnout.readers.timing import check_simultaneous, parse_time, start_offsets, step_precision

nptdms.log.log_manager.set_level("ERROR")  # find_truncation turns what it would warn of into an error
LEAD_IN = 28  # bytes: tag, mask, version, offset of the next segment, offset of the raw data
UNFINISHED_SEGMENT = 0xFFFFFFFFFFFFFFFF


def read_raw(source: Source) -> RawFile:
    """Records of a TDMS file, in the natural order of the groups' names.

    Parameters
    ----------
    source : Source
        The TDMS file.

    Returns
    -------
    RawFile
        One record per group with samples; an incomplete one is an error.

    Raises
    ------
    ReadError
        If npTDMS cannot read the file.
    """
    file = source.path.open("rb")  # not the path: npTDMS would use an index file in the same folder
    with nullcontext() if source.lazy else file:
        truncation = find_truncation(file, source.size)
        with source.parsed_by("npTDMS", reason="truncated" if truncation else "unreadable"):
            file.seek(0)
            tdms = nptdms.TdmsFile.open(file) if source.lazy else nptdms.TdmsFile.read(file)
    groups = sorted(
        (g for g in tdms.groups() if any(len(c) for c in g.channels())), key=lambda g: natural_sort_key(g.name)
    )
    names = {channel.name for group in groups for channel in group.channels()}
    damaged = _damaged_paths(tdms) if truncation else set()
    records = [_record(g, k, len(groups), names, damaged, tdms.properties, source) for k, g in enumerate(groups)]
    if truncation and not any(isinstance(r, ReadError) for r in records):
        records.append(source.error(f"record {len(records) + 1}", truncation, COPY_AGAIN, reason="truncated"))
    return RawFile(tuple(records), Metadata(tdms.properties, source).count(RECORD_COUNT_NAMES))


def find_truncation(file: BinaryIO, size: int) -> str:
    """Follow the lead-ins of the segments to the end of the file.

    Parameters
    ----------
    file : BinaryIO
        The open file.
    size : int
        Its size. [bytes]

    Returns
    -------
    str
        Where it is truncated; "" for a complete file.
    """
    position = 0
    while position < size:
        file.seek(position)
        lead_in = file.read(LEAD_IN)
        if len(lead_in) < LEAD_IN:
            return f"it ends within the lead-in of a segment, at byte {size}"
        segment_size = struct.unpack_from("<Q", lead_in, 12)[0]
        if lead_in[:4] != b"TDSm":
            return f"there is no segment at byte {position}"
        if segment_size == UNFINISHED_SEGMENT:
            return f"the segment at byte {position} was never finished by the logger"
        position += LEAD_IN + segment_size
    return "" if position == size else f"it ends at byte {size} of {position}"


def _damaged_paths(tdms: nptdms.TdmsFile) -> set[str]:
    """Paths of the channels of the last, incomplete segment."""
    statuses = tdms.file_status.channel_statuses or {}
    return {path for path, status in statuses.items() if status.read_length < status.expected_length}


def _record(group: nptdms.TdmsGroup, *context: Any) -> RawRecord | ReadError:
    """One group as a record, or its error."""
    try:
        return _complete_record(group, *context)
    except ReadError as error:
        return error


def _complete_record(
    group: nptdms.TdmsGroup,
    k: int,
    n: int,
    names: set[str],
    damaged: set[str],
    properties: Mapping[str, Any],
    source: Source,
) -> RawRecord:
    where = f"record {k + 1} of {n} (group {group.name!r})"
    channels = group.channels()
    if missing := names - {c.name for c in channels}:
        problem = f"it lacks the channel {min(missing)!r} that other groups have"
        raise source.error(where, problem, COPY_AGAIN, reason="truncated")
    for channel in channels:
        promised = Metadata(channel.properties, source).number(("wf_samples",))
        # for a channel written in several segments it counts the samples of the last one
        if channel.path in damaged or (promised and len(channel) < promised):
            problem = f"ends after {len(channel)}{f' of {promised:g}' if promised else ''} samples"
            place = f"{where}, channel {channel.name!r}"
            raise source.error(place, problem, COPY_AGAIN, reason="truncated")
    step = _common_step(channels, where, source)
    rate_fields = {"rate": 1.0 / step, "rate_tolerance": step_precision(step)} if step else None
    with source.parsed_by("npTDMS", where):
        samples = [_numbers(c, source.lazy) for c in channels]
    facts = Metadata({**properties, **group.properties, **channels[0].properties}, source)
    return RawRecord(
        names=tuple(c.name for c in channels),
        samples=samples,
        **(rate_fields or facts.rate_fields()),
        units=tuple(str(c.properties.get("unit_string", "") or "") for c in channels),
        started_at=parse_time(facts.record_value(("wf_start_time", *START_NAMES), 0, 1)),
        conditions=facts.conditions(0, 1),
        aliases=tuple((f"{group.name}/{c.name}",) for c in channels),
    )


def _common_step(channels: list[nptdms.TdmsChannel], where: str, source: Source) -> float:
    """Step [s] of all channels, 0 if not stated; a channel begins at its time stamp plus ``wf_start_offset``."""
    facts = [Metadata(c.properties, source) for c in channels]
    steps = [f.number(("wf_increment",)) or 0.0 for f in facts]
    stamps = start_offsets([parse_time(f.record_value(("wf_start_time",), 0, 1)) for f in facts])
    starts = [stamp + (f.number(("wf_start_offset",)) or 0.0) for stamp, f in zip(stamps, facts)]
    check_simultaneous([c.name for c in channels], steps, starts, where, source)
    return steps[0]


def _numbers(channel: nptdms.TdmsChannel, lazy: bool) -> Column:
    """All numbers of a channel, or a lazy column: npTDMS can skip what is not requested."""
    if not lazy or channel.dtype.kind not in "fiu":
        return channel[:]
    return LazyColumn(lambda start, stop: channel.read_data(start, stop - start), len(channel), channel.dtype)
