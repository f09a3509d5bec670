"""Reader of National Instruments TDMS: each group with samples is a record, or the groups of one record are joined.

npTDMS reads a truncated file without an error. Therefore the file size is compared with the lead-ins of the segments,
and the length of each channel with ``wf_samples``.
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from datetime import UTC, timedelta
from itertools import combinations, starmap
from typing import Any, BinaryIO

import nptdms
import numpy as np
from nptdms.reader import TdmsReader
from nptdms.timestamp import TdmsTimestamp

from turnout.errors import ReadError
from turnout.readers.array_metadata import Metadata
from turnout.readers.array_names import natural_sort_key, numbered_names
from turnout.readers.clock_texts import with_durations
from turnout.readers.entries import FREE_TEXT, MAX_ENTRIES, Entry, entries_of, entries_of_text
from turnout.readers.lazy import Column, LazyColumn
from turnout.readers.metadata_names import RECORD_COUNT_NAMES, START_NAMES
from turnout.readers.record_columns import missing_record
from turnout.readers.record_numbers import with_missing
from turnout.readers.recording_versions import check_groups
from turnout.readers.source import COPY_AGAIN, RawFile, RawRecord, Source
from turnout.readers.start_columns import start_in_columns
from turnout.readers.start_times import start_fields
from turnout.readers.tdms_abscissas import UNIT_NAME, check_steps, seconds_of_abscissa, unit_of_abscissa, unknown_unit
from turnout.readers.tdms_scales import SCALE_TYPE, stated_scale
from turnout.readers.time_texts import parse_time

nptdms.log.log_manager.console_handler.setLevel("ERROR")  # turnout.readers passes the warnings on
BIG_ENDIAN = 1 << 6  # bit of the mask in the lead-in
LEAD_IN = 28  # bytes: tag, mask, version, offset of the next segment, offset of the raw data
UNFINISHED_SEGMENT = 0xFFFFFFFFFFFFFFFF


ONE_WRITE_REMEDY = "Write each recording to a group of its own, or a file"
MAX_GAP = 0.1  # s: time stamps of a computer's clock are no more precise
DECIDING = ("wf_increment", "unit_string", "NI_Scale[", "NI_Scaling_Status", "NI_Number_Of_Scales")


class _FirstValues(TdmsReader):
    """Reads the metadata of all segments. npTDMS keeps the last value of a property, also for samples before it.

    ``starts`` are the first start times of the channels. ``problems`` (problem, reason) are channels of which a
    property that decides what the samples are has two values, or that pause between two writes.
    """

    def __init__(self, file: BinaryIO):
        super().__init__(file)
        self.starts: dict[str, np.datetime64] = {}
        self.problems: dict[str, tuple[str, str]] = {}
        self._counts: dict[str, int] = {}

    def _update_object_properties(self, segment_object_properties: Mapping[str, Any] | None) -> None:
        for path, properties in (segment_object_properties or {}).items():
            first = self.object_metadata[path].properties if path in self.object_metadata else {}
            n_before = self._counts.get(path, 0)
            for name, value in properties:
                if n_before and name.startswith(DECIDING) and first.get(name) and first[name] != value:
                    problem = (
                        f"its property {name!r} changes from {first[name]!r} to {value!r} after {n_before} samples"
                    )
                    self.problems.setdefault(path, (problem, "scale_unknown"))
                if name == "wf_start_time" and isinstance(value, TdmsTimestamp):
                    step = first.get("wf_increment", 0.0)
                    step = step * seconds_of_abscissa(first) if isinstance(step, float) else step
                    self._compare_start(path, value.as_datetime64(), n_before, step)
        super()._update_object_properties(segment_object_properties)
        self._counts = {path: metadata.num_values for path, metadata in self.object_metadata.items()}

    def _compare_start(self, path: str, start: np.datetime64, n_before: int, step: Any) -> None:
        first = self.starts.setdefault(path, start)
        elapsed = (start - first) / np.timedelta64(1, "s")
        if n_before and elapsed and isinstance(step, float) and abs(elapsed - n_before * step) > MAX_GAP:
            problem = (
                f"a write began {elapsed:.6g} s after the first one, and {n_before} samples of {step:.6g} s lie between"
            )
            self.problems.setdefault(path, (problem, "truncated"))


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
            first_values = _FirstValues(file)
            first_values.read_metadata()
            file.seek(0)
            tdms = nptdms.TdmsFile.open(file) if source.lazy else nptdms.TdmsFile.read(file)
    for channel in (c for group in tdms.groups() for c in group.channels() if c.path in first_values.starts):
        channel.properties["wf_start_time"] = first_values.starts[channel.path]
    groups = _with_lost_groups(_records_of_groups(tdms.groups(), source))
    names = {channel.name for channels in groups for channel in channels}
    damaged = _damaged_paths(tdms) if truncation else set()
    of_file = [
        Entry(f"property of the file: {entry.name}", entry.name, entry.value)
        for entry in entries_of({name: _in_utc(value) for name, value in tdms.properties.items()}, "")
    ]
    records = [
        _record(g, k, len(groups), names, damaged, first_values.problems, tdms, of_file, source)
        if g
        else missing_record(k, len(groups), source)
        for k, g in enumerate(groups)
    ]
    if truncation and not any(isinstance(r, ReadError) for r in records):
        records.append(source.error(f"record {len(records) + 1}", truncation, COPY_AGAIN, reason="truncated"))
    return RawFile(tuple(records), Metadata(tdms.properties, source).count(RECORD_COUNT_NAMES))


def _records_of_groups(groups: Sequence[nptdms.TdmsGroup], source: Source) -> list[list[nptdms.TdmsChannel]]:
    """The channels of each record, in the natural order of the groups' names.

    A group with samples is a record. A logger with one group per task writes the channels of one record into several
    groups, each with names of its own: these are joined if their time axes are equal, and the numbers in their names or
    their starts say which belong together. A group without a time axis and of another length beside groups that have
    one holds information, such as the voltage of a battery.
    """
    filled = sorted((g for g in groups if any(len(c) for c in g.channels())), key=lambda g: natural_sort_key(g.name))
    with_axis = [g for g in filled if any("wf_increment" in c.properties for c in g.channels())]
    axis_names = {c.name for g in with_axis for c in g.channels()}
    lengths = {len(c) for g in with_axis for c in g.channels()}
    filled = [
        g
        for g in filled
        if g in with_axis or not with_axis or any(c.name in axis_names or len(c) in lengths for c in g.channels())
    ]
    tasks: dict[frozenset[str], list[nptdms.TdmsGroup]] = {}
    for group in filled:
        tasks.setdefault(frozenset(c.name for c in group.channels()), []).append(group)
    for channels, of_task in tasks.items():
        check_groups([group.name for group in of_task], sorted(channels), source)
    counts = {len(of_task) for of_task in tasks.values()}
    is_disjoint = sum(map(len, tasks)) == len(frozenset().union(*tasks))
    if len(tasks) < 2 or not is_disjoint:
        return [g.channels() for g in filled]
    names = "; ".join(f"{of_task[0].name!r}: {', '.join(sorted(task))}" for task, of_task in tasks.items())
    problem = f"its channels lie in groups with different names ({names}), and "
    export = "Export all channels of a record into one group"
    if len(counts) > 1:
        listed = ", ".join(str(len(of_task)) for of_task in tasks.values())
        raise source.error("the groups", f"{problem}there are {listed} of them: they form no records", export)
    records = list(zip(*tasks.values()))
    starts = {_time_axis(g.channels()[0], source)[2] for g in next(iter(tasks.values()))}
    numbers = {_varying_numbers([g.name for g in of_task]) for of_task in tasks.values()}
    if len(starts) < len(records) and len(numbers) > 1:
        pair = " and ".join(repr(g.name) for g in records[0])
        raise source.error(
            "the groups", f"{problem}their numbers differ ({pair}): nothing says which belong together", export
        )
    for groups_of_record in records:
        axes = [_time_axis(g.channels()[0], source) for g in groups_of_record]
        if not all(starmap(_are_one_axis, combinations(axes, 2))):
            listed = "; ".join(f"{g.name!r}: {_axis_text(*axis)}" for g, axis in zip(groups_of_record, axes))
            remedy = f"Start all tasks by one trigger at one rate. {export}"
            raise source.error("the groups", f"{problem}their time axes differ ({listed})", remedy, "clock_drift")
    return [[c for g in groups_of_record for c in g.channels()] for groups_of_record in records]


def _with_lost_groups(groups: list[list[nptdms.TdmsChannel]]) -> list[list[nptdms.TdmsChannel]]:
    """The channels of each record, and none for one whose number is missing between those of "impact 1", "impact 3"."""
    numbers = [number for number, _ in numbered_names(channels[0].group_name for channels in groups)]
    if len(numbers) < len(groups) or len(set(numbers)) < len(numbers):
        return groups
    channels_of = dict(zip(numbers, groups))
    return [channels_of.get(number, []) for number in with_missing(numbers)]


def _varying_numbers(names: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """The numbers in each of several names, without those that all have.

    >>> _varying_numbers(["Mod1 hit 3", "Mod1 hit 4"])
    ((3,), (4,))
    """
    numbers = [[int(digits) for digits in re.findall(r"\d+", name)] for name in names]
    columns = [column for column in zip(*numbers) if len(set(column)) > 1]
    return tuple(zip(*columns))


def _time_axis(channel: nptdms.TdmsChannel, source: Source) -> tuple[int, float, Any]:
    """Number of samples, step [s] and start of a channel, 0 and None if not stated."""
    facts = Metadata(channel.properties, source)
    step = (facts.number(("wf_increment",)) or 0.0) * seconds_of_abscissa(channel.properties)
    return len(channel), step, facts.record_value(("wf_start_time",), 0, 1)


def _are_one_axis(first: tuple[int, float, Any], second: tuple[int, float, Any]) -> bool:
    """Whether two time axes have the same samples: starts that are stated differ by half a step at most."""
    (*size, start), (*other_size, other_start) = first, second
    if size != other_size or start is None or other_start is None:
        return size == other_size
    if not isinstance(start, np.datetime64) or not isinstance(other_start, np.datetime64):
        return bool(start == other_start)
    return bool(abs(start - other_start) / np.timedelta64(1, "s") <= 0.5 * first[1])


MAX_OFFSET = 1e5  # s: a day; what is more is no time from the time stamp to the first sample
NO_TIME = timedelta()


def _in_utc(value: Any, offset: timedelta = NO_TIME) -> Any:
    """A value of the file; its time stamps are in UTC, which npTDMS does not state, and moved by an offset."""
    time = parse_time(value) if isinstance(value, np.datetime64) else None
    return value if time is None else time.replace(tzinfo=UTC) + offset


def _offset_of(properties: Mapping[str, Any], facts: Metadata) -> timedelta:
    """Time from the time stamp of a waveform to its first sample."""
    seconds = (facts.number(("wf_start_offset",)) or 0.0) * seconds_of_abscissa(properties)
    return timedelta(seconds=seconds) if abs(seconds) < MAX_OFFSET else NO_TIME


def _axis_text(n_sample: int, step: float, start: Any) -> str:
    return f"{n_sample} samples of {step:.9g} s from {start or 'no time'}"


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
        byte_order = ">" if struct.unpack_from("<I", lead_in, 4)[0] & BIG_ENDIAN else "<"
        segment_size = struct.unpack_from(f"{byte_order}Q", lead_in, 12)[0]
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


def _record(channels: Sequence[nptdms.TdmsChannel], *context: Any) -> RawRecord | ReadError:
    """The channels of one record as such, or its error."""
    try:
        return _complete_record(channels, *context)
    except ReadError as error:
        return error


UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")


def _complete_record(
    channels: Sequence[nptdms.TdmsChannel],
    k: int,
    n: int,
    names: set[str],
    damaged: set[str],
    problems: Mapping[str, tuple[str, str]],
    tdms: nptdms.TdmsFile,
    of_file: Sequence[Entry],
    source: Source,
) -> RawRecord:
    groups = {c.group_name: tdms[c.group_name].properties for c in channels}
    where = f"record {k + 1} of {n} (group {' and '.join(map(repr, groups))})"
    if missing := names - {c.name for c in channels}:
        problem = f"it lacks the channel {min(missing)!r} that other groups have"
        remedy = f"{COPY_AGAIN}; if it is so there too, export all channels of a record into one group"
        raise source.error(where, problem, remedy, reason="truncated")
    remarks = [c for c in channels if _is_remark(c, channels)]
    channels = [c for c in channels if c not in remarks]
    texts = [(f"channel {c.name!r}", str(text)) for c in remarks for text in c[:MAX_ENTRIES]]
    of_remarks = [e for place, text in texts for e in (*entries_of_text(text, place), Entry(place, FREE_TEXT, text))]
    for channel in channels:
        promised = Metadata(channel.properties, source).number(("wf_samples",))
        # for a channel written in several segments it counts the samples of the last one
        if channel.path in damaged or (promised and len(channel) < promised):
            problem = f"ends after {len(channel)}{f' of {promised:g}' if promised else ''} samples"
            place = f"{where}, channel {channel.name!r}"
            raise source.error(place, problem, COPY_AGAIN, reason="truncated")
        if channel.path in problems:
            problem, reason = problems[channel.path]
            raise source.error(f"{where}, channel {channel.name!r}", problem, ONE_WRITE_REMEDY, reason)
    other_axes = check_steps(channels, where, source)
    samples = [_scaled_numbers(c, where, source) for c in channels]
    facts = Metadata({**tdms.properties, **groups[channels[0].group_name], **channels[0].properties}, source)
    undecided = {
        i: text for i, c in enumerate(channels) if (text := stated_scale(c, groups[c.group_name], tdms.properties))
    }
    return RawRecord(
        names=tuple(c.name for c in channels),
        samples=samples,
        entries=(*of_file, *of_remarks, *_entries(channels, groups, other_axes)),
        units=tuple(next((str(c.properties[n]) for n in UNIT_PROPERTIES if c.properties.get(n)), "") for c in channels),
        **start_fields(
            _in_utc(facts.record_value(("wf_start_time",), 0, 1), _offset_of(channels[0].properties, facts)),
            _in_utc(facts.record_value(START_NAMES, 0, 1)),
            declared=facts.label_of(START_NAMES),
        ),
        axis_starts=(
            *((_in_utc(c[0]), "") for c in channels if c.dtype.kind == "M" and len(c)),
            start_in_columns({c.name: x for c, x in zip(channels, samples) if x.dtype.kind in "OUSTm"}),
        ),
        conditions=facts.conditions(0, 1),
        aliases=tuple((f"{c.group_name}/{c.name}",) for c in channels),
        undecided=undecided,
        other_axes=other_axes,
        unknown_step=next((u for c in channels if c.name not in other_axes and (u := unknown_unit(c.properties))), ""),
    )


def _is_remark(channel: nptdms.TdmsChannel, channels: Sequence[nptdms.TdmsChannel]) -> bool:
    """Whether a channel holds text of another length than the channels with a time axis beside it."""
    lengths = {len(c) for c in channels if "wf_increment" in c.properties}
    return channel.data_type is nptdms.types.String and bool(lengths) and len(channel) not in lengths


def _entries(
    channels: Sequence[nptdms.TdmsChannel], groups: Mapping[str, Mapping[str, Any]], other_axes: Mapping[str, str]
) -> Iterator[Entry]:
    """Properties of the groups and of the channels, of those over another axis than the time without the axis."""
    places: list[tuple[str, Mapping[str, Any]]] = [
        (f"property of the group {name!r}", values) for name, values in groups.items()
    ]
    places += [
        (f"property of the channel {c.name!r}", _without_axis(c.properties) if c.name in other_axes else c.properties)
        for c in channels
    ]
    for place, values in places:
        for entry in entries_of({name: _in_utc(value) for name, value in values.items()}, ""):
            if entry.name == UNIT_NAME and unknown_unit(values):
                continue  # it is compared with the rate, and none of the samples
            is_step, unit = entry.name == "wf_increment", "s" if unknown_unit(values) else unit_of_abscissa(values)
            name = f"{entry.name} [{unit}]" if is_step and unit else entry.name
            yield Entry(f"{place}: {entry.name}", name, entry.value, is_defined=is_step)


def _without_axis(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in properties.items() if not name.startswith("wf_")}


def _scaled_numbers(channel: nptdms.TdmsChannel, where: str, source: Source) -> Column:
    """As ``_numbers``; ReadError if a property of a scale that it needs is missing or is no number."""
    try:
        with source.parsed_by("npTDMS", where):
            return _numbers(channel, source)
    except ReadError as error:
        if not any(name.startswith("NI_Scale[") for name in channel.properties):
            raise
        kinds = {str(v) for n, v in channel.properties.items() if SCALE_TYPE.fullmatch(n)}
        listed = ", ".join(map(repr, sorted(kinds))) or "without a type"
        place = f"{where}, channel {channel.name!r}"
        problem = f"its scale {listed} cannot be applied, npTDMS says {error.problem.partition('(')[2].rstrip(')')}"
        remedy = "Export the channel scaled, or with all properties of its scale"
        raise source.error(place, problem, remedy, reason="scale_unknown") from error


def _numbers(channel: nptdms.TdmsChannel, source: Source) -> Column:
    """All numbers of a channel, or a lazy column: npTDMS can skip what is not requested."""
    if not source.lazy or channel.dtype.kind not in "fiu":
        return with_durations(channel[:], "channel", channel.name, source)
    return LazyColumn(lambda start, stop: channel.read_data(start, stop - start), len(channel), channel.dtype)
