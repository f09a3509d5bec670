"""Conversion of raw records to recordings in SI units, for all formats.

It assigns the channels of a file to those of the layout, converts units and checks what the layout states.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.array_axes import AXES_REMEDY
from turnout.readers.blocks import BlockReader, ChannelStatistics
from turnout.readers.channel_delays import DELAY_REMEDY, delay_problem
from turnout.readers.channel_maps import Assignments, ChannelMapping
from turnout.readers.channel_starts import different_starts
from turnout.readers.channel_units import undecided_error
from turnout.readers.constant_ends import measured_span, silent_ends
from turnout.readers.entry_check import EntryCheck
from turnout.readers.lost_entries import lost_entry_errors, usable_conditions
from turnout.readers.packing import fill_values
from turnout.readers.rate_agreement import ABSCISSA_REMEDY, check_unknown_step, rate_remark, resolve
from turnout.readers.rate_vocabulary import CERTAIN
from turnout.readers.record_borders import Measurement, border_errors
from turnout.readers.sample_faults import (
    absent_channels_error,
    count_missing,
    decisive_fault,
    faults_by_channel,
    repeat_error,
    repetition_errors,
)
from turnout.readers.simultaneous_records import simultaneous_errors
from turnout.readers.source import COPY_AGAIN, MIN_SAMPLES, RawFile, RawRecord, Source
from turnout.readers.start_times import check_order, is_plausible, start_errors, start_times, zone_errors
from turnout.readers.stated_counts import count_remarks, missing_samples, unfilled_buffer
from turnout.readers.stated_zones import with_zone_of_layout
from turnout.readers.thousands_marks import mark_errors
from turnout.readers.time_axes import all_statements
from turnout.readers.unread_starts import is_of_other_day
from turnout.readers.unused_copies import unused_copy_errors
from turnout.records import LongRecording, RawDescription, Recording

MAX_WORDS_SHOWN = 4  # of a column, in a message
REMARKS = ("rate_ambiguous", "entry_unknown")  # once for all records of a file
SHARED_START_REMEDY = "Start all channels by one trigger, or export them cut to the stretch that they share"
PADDING_REMEDY = "If the logger fills its blocks, export the measured samples alone; else check cables and power"
SILENCE_REMEDY = "Check the cable and the power of the sensor, and for how long the logger records this channel"
VALID_REMEDY = "Export the measured samples alone; if the entry means something else, name it in 'checked_entries'"


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
    of_layout = [with_zone_of_layout(r, description.time_zone) if isinstance(r, RawRecord) else r for r in raw.records]
    raw = replace(raw, records=tuple(of_layout))
    recordings: list[Recording | LongRecording] = []
    errors: list[ReadError] = []
    stamps = [(k, record.started_at) for k, record in enumerate(raw.records) if not isinstance(record, ReadError)]
    starts = start_times(stamps, description.time_zone)
    order_errors = check_order(starts, source)
    start_of = dict(starts)
    assignments = Assignments(description.channels, source, description.kind == "passage")
    entry_check = EntryCheck(description, source)
    n_total = sum(_lengths(raw))
    is_whole = all(isinstance(r, RawRecord) for r in raw.records)
    limit = max_duration if source.lazy and description.kind == "passage" else None
    conversion = _Conversion(len(raw.records), _lengths(raw), assignments, entry_check, description, source, limit)
    for k, record in enumerate(raw.records):
        try:
            if isinstance(record, ReadError):
                raise record
            if k in order_errors:
                raise order_errors[k]
            record = entry_check.without_checked(record)
            problem, name = missing_samples(record, n_total) if is_whole else ("", "")
            if problem:
                remedy = (
                    f"{COPY_AGAIN}; if a part of the memory was saved, write 'checked_entries: {name}' into the layout"
                )
                raise source.error(f"record {k + 1} of {len(raw.records)}", problem, remedy, reason="truncated")
            start = start_of[k]
            started_at = start if start and is_plausible(start) else None
            recording, channel_errors = conversion.recording(record, k, started_at)
            recordings.append(recording)
            remarked = {e.problem for e in errors if e.reason in REMARKS}
            new = [error for error in channel_errors if error.problem not in remarked]
            errors.extend(error if error.reason in REMARKS else error.in_record(k) for error in new)
        except ReadError as error:
            errors.append(error.in_record(k))
    simultaneous = simultaneous_errors(recordings, source)
    recordings = [r for r in recordings if r.record not in simultaneous]
    errors.extend(error.in_record(k) for k, error in simultaneous.items())
    errors.extend(_count_errors(raw, description, source))
    errors.extend(raw.remarks)
    stated = [entry_check.without_checked(r) if isinstance(r, RawRecord) else r for r in raw.records]
    errors.extend(lost_entry_errors(stated, source))
    unread = {k: r.unread_start for k, r in enumerate(raw.records) if isinstance(r, RawRecord) and r.unread_start}
    unread = {
        k: text
        for k, text in unread.items()
        if not entry_check.is_checked(text) and not is_of_other_day(text, source.name)
    }
    kept = [(k, stamp) for k, stamp in stamps if k not in order_errors]
    errors.extend(start_errors(kept, unread, description.time_zone, source))
    errors.extend(zone_errors(stated, description.time_zone, source))
    return tuple(recordings), tuple(errors)


def _lengths(raw: RawFile) -> list[int]:
    """Samples of each record that was read."""
    return [len(r.samples[0]) for r in raw.records if isinstance(r, RawRecord) and len(r.samples)]


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
    first = next((r for r in raw.records if isinstance(r, RawRecord)), None)
    yield from [] if first is None else _axes_remarks(first, (), f"record 1 of {len(raw.records)}", source)
    yield from (
        []
        if first is None
        else count_remarks(first, _lengths(raw), len(raw.records), f"record 1 of {len(raw.records)}", source)
    )
    yield from lost_entry_errors(raw.records, source)
    records = [(k, record) for k, record in enumerate(raw.records) if isinstance(record, RawRecord)]
    unread = {k: record.unread_start for k, record in records if record.unread_start}
    yield from start_errors([(k, record.started_at) for k, record in records], unread, "UTC", source)
    yield from zone_errors(raw.records, "UTC", source)
    yield from repetition_errors(records, source)
    reported: set[tuple[str, str]] = set()
    for k, record in records:
        fills = fill_values(record.entries, record.names)
        for i, (name, column) in enumerate(zip(record.names, record.samples)):
            where = f"record {k + 1} of {len(raw.records)}, channel {name!r}"
            if (error := undecided_error(record, i, where, source)) and (name, "scale") not in reported:
                reported.add((name, "scale"))
                yield error
            if (name, "samples") not in reported and (n := count_missing(column, fills[i])):
                reported.add((name, "samples"))
                problem = "1 sample is missing" if n == 1 else f"{n} samples are missing"
                yield source.error(where, problem, "Export the record again from the logger", reason="not_finite")


def _count_errors(raw: RawFile, description: RawDescription, source: Source) -> Iterator[ReadError]:
    """Errors where the number of records differs from that stated by the layout or by the file itself."""
    n_present = len(raw.records)
    layout_remedy = _copy_or_correct("records", description.n_records)
    promises = (("the layout", description.n_records, layout_remedy), ("its own header", raw.expected, COPY_AGAIN))
    for stated_by, promised, remedy in promises:
        if promised is not None and n_present < promised:
            problem = f"it holds {n_present} of the {promised} records that {stated_by} states"
            yield source.error(f"record {n_present + 1} of {promised}", problem, remedy, reason="truncated")
            return
    if description.n_records is not None and n_present > description.n_records:
        problem = f"it holds {n_present} records, {n_present - description.n_records} more than the layout states"
        remedy = "Correct records in the layout, or find out whether two tests share one file"
        yield source.error(f"record {description.n_records + 1}", problem, remedy, reason="wrong_length")


def _copy_or_correct(key: str, promised: int | None) -> str:
    """Remedy if a file holds less than the layout's ``key`` states: either may be wrong."""
    return f"{COPY_AGAIN}; if it is whole, correct '{key}: {promised}' in the layout (null: any number)"


@dataclass(frozen=True)
class _Conversion:
    """What the ``n_record`` records of a file have in common.

    Those that were read have ``lengths`` samples. A record that is longer than ``max_duration`` [s] stays in the file.
    """

    n_record: int
    lengths: list[int]
    assignments: Assignments
    entry_check: EntryCheck
    description: RawDescription
    source: Source
    max_duration: float | None

    def recording(
        self, record: RawRecord, k: int, started_at: datetime | None
    ) -> tuple[Recording | LongRecording, list[ReadError]]:
        """(recording, errors of channels left out) of raw record ``k``; ReadError if the record cannot be used."""
        description, source = self.description, self.source
        where = f"record {k + 1} of {self.n_record}"
        n_sample = _sample_count(record, where, description.n_samples, source)
        if problem := unfilled_buffer(record, n_sample, self.n_record):
            raise source.error(where, problem, VALID_REMEDY, reason="wrong_length")
        sensor_rows = self.assignments.sensor_rows(record, where)
        checked = self.entry_check.checked
        statements = all_statements(record, k, self.n_record, sensor_rows, where, source, description.rate, checked)
        check_unknown_step(record, statements, description.rate, where, source)
        rate = resolve(statements, description.rate, where, source)
        if problem := different_starts(record):
            raise source.error(where, problem, SHARED_START_REMEDY, reason="clock_drift")
        if problem := delay_problem(record, sorted(sensor_rows), rate):
            raise source.error(where, problem, DELAY_REMEDY, reason="clock_drift")
        channel_maps = self.assignments.mappings(record, where)
        for mapping in channel_maps:
            name = record.names[mapping.index]
            if problem := record.other_axes.get(name, ""):
                raise source.error(f"{where}, channel {name!r}", problem, ABSCISSA_REMEDY, reason="wrong_rate")
        of_marks = list(mark_errors(record, _units_in_use(record, channel_maps, description), where, source))
        measurement = _measurement(record, channel_maps, description.kind, rate)
        of_borders = list(border_errors(record, sensor_rows, checked, measurement, where, source))
        if not channel_maps:
            raise source.error(where, "the layout wants none of its channels", "Name channels in the layout")
        vibrations = [record.samples[m.index] for m in channel_maps if m.channel.quantity != "temperature"]
        first, stop = measured_span(vibrations) if vibrations else (0, n_sample)
        of_marks += _end_remarks(n_sample, first, stop, where, source)
        if description.kind != "passage":  # whose analysis reports a sensor that is lost
            of_marks += _silence_remarks(record, channel_maps, first, stop, where, source)
        n_sample = stop - first
        started_at = started_at + timedelta(seconds=first / rate) if started_at else None
        block_reader = BlockReader(record, channel_maps, where, source, source.state(), first)
        is_long = self.max_duration is not None and n_sample / rate > self.max_duration
        samples = np.empty((0, 0)) if is_long else block_reader(0, n_sample)
        from_record, from_samples = ChannelStatistics.from_record, ChannelStatistics.from_samples
        statistics = from_record(block_reader, n_sample) if is_long else from_samples(samples)
        copies = unused_copy_errors(record, channel_maps, description.channels, where, source)
        of_marks += [error for error in copies.values() if error.reason in REMARKS]
        faults = {i: error for i, error in copies.items() if error.reason not in REMARKS}
        faults |= faults_by_channel(record, channel_maps, statistics, n_sample, where, source)
        usable = [i for i in range(len(channel_maps)) if i not in faults]
        if fault := decisive_fault(description, channel_maps, faults):
            raise fault
        if repeat := None if is_long else repeat_error(samples, where, source):
            raise repeat
        fields: dict[str, Any] = {
            "rate": rate,
            "channels": tuple(channel_maps[i].channel for i in usable),
            "kind": description.kind,
            "source": source.name,
            "record": k,
            "started_at": started_at,
            "conditions": MappingProxyType(usable_conditions(record.conditions)),
        }
        of_rate = rate_remark(statements, rate, where, source)
        is_rate_stated = any(s.certainty == CERTAIN and s.intervals for s in statements)
        of_entries = self.entry_check.remarks(record, rate, self.n_record, where, is_rate_stated)
        of_marks += _axes_remarks(record, checked, where, source)
        if description.kind == "hammer":
            of_marks += _word_remarks(record, checked, [*of_borders, *of_entries], where, source)
        if not description.n_samples:
            of_marks += count_remarks(record, self.lengths, self.n_record, where, source)
        absent = absent_channels_error(channel_maps, description.channels, where, source)
        channel_errors = [
            *absent,
            *faults.values(),
            *([of_rate] if of_rate else []),
            *of_borders,
            *of_marks,
            *of_entries,
        ]
        if is_long:
            return LongRecording(block_reader.subset(usable), n_sample, **fields), channel_errors
        return Recording(samples=samples if not faults else samples[usable], **fields), channel_errors


def _end_remarks(n_row: int, first: int, stop: int, where: str, source: Source) -> Iterator[ReadError]:
    """Remarks on equal rows at the ends of a record, which were left out."""
    for n, end in ((first, "first"), (n_row - stop, "last")):
        if n:
            problem = f"its {end} {n} of {n_row} samples repeat one value on all channels, beside noise: no measurement"
            yield source.error(where, f"{problem}. They are left out", PADDING_REMEDY, reason="entry_unknown")


def _silence_remarks(
    record: RawRecord, channel_maps: Sequence[ChannelMapping], first: int, stop: int, where: str, source: Source
) -> Iterator[ReadError]:
    """Remarks on accelerations that repeat one value at an end; a force may be 0 there by the window of an analyser."""
    for mapping in channel_maps:
        if mapping.channel.quantity == "acceleration":
            for n, end in zip(silent_ends(record.samples[mapping.index], first, stop), ("first", "last")):
                problem = f"its {end} {n} of {stop - first} samples repeat one value, beside noise: it measured nothing"
                place = f"{where}, channel {mapping.channel.name!r}"
                yield from [source.error(place, problem, SILENCE_REMEDY, reason="entry_unknown")] if n else []


def _axes_remarks(record: RawRecord, checked: Collection[str], where: str, source: Source) -> Iterator[ReadError]:
    """Remarks on arrays of which nothing states the order of the axes."""
    for name, problem in record.undecided_axes.items():
        if name.strip().casefold() not in checked:
            remedy = f"{AXES_REMEDY}; if it is right, write 'checked_entries: {name}' into the layout"
            yield source.error(f"{where}, variable {name!r}", problem, remedy, reason="entry_unknown")


def _word_remarks(
    record: RawRecord, checked: Collection[str], remarks: Sequence[ReadError], where: str, source: Source
) -> Iterator[ReadError]:
    """Remarks on columns of words of which some rows have another one: it may say in any language that a sensor failed.

    No second one on a column that one of ``remarks`` quotes already.
    """
    for name, numbers in record.counters.items():
        words = record.states.get(name, ())
        is_quoted = any(repr(name) in str(remark) for remark in remarks)
        if not words or name.casefold() in checked or is_quoted or np.ptp(numbers) == 0:
            continue
        n_changed = len(numbers) - int(np.bincount(numbers).max())
        listed = ", ".join(map(repr, words[:MAX_WORDS_SHOWN]))
        problem = f"its words change: {n_changed} of {len(numbers)} rows have another one than most ({listed})"
        remedy = f"Find out whether they state a fault of a sensor; if not, write 'checked_entries: {name}'"
        yield source.error(f"{where}, column {name!r}", problem, f"{remedy} into the layout", reason="entry_unknown")


def _measurement(record: RawRecord, channel_maps: Sequence[ChannelMapping], kind: str, rate: float) -> Measurement:
    """The signals of a record, which tell numbers of records from states and counts."""
    used = [m for m in channel_maps if m.channel.quantity != "ignored"]
    forces = [record.samples[m.index] for m in used if m.channel.quantity == "force"]
    return Measurement(rate, kind, forces or [record.samples[m.index] for m in used], bool(forces))


def _units_in_use(
    record: RawRecord, channel_maps: Sequence[ChannelMapping], description: RawDescription
) -> dict[int, str]:
    """Units of the channels that are read, by their numbers: of the layout, else of the file."""
    stated = {channel.name: (channel.unit or "").removesuffix("!") for channel in description.channels}
    return {m.index: stated.get(m.channel.name) or record.units[m.index] for m in channel_maps}


def _sample_count(record: RawRecord, where: str, promised: int | None, source: Source) -> int:
    lengths = {name: len(x) for name, x in zip(record.names, record.samples)}
    shortest = min(lengths.values(), default=0)
    longest = max(lengths.values(), default=0)
    if shortest != longest:
        short = next(name for name, n in lengths.items() if n == shortest)
        problem = f"channel {short!r} ends after {shortest} samples, others after {longest}"
        raise source.error(where, problem, COPY_AGAIN, reason="truncated")
    if promised is not None and shortest < promised:
        problem = f"ends after {shortest} of the {promised} samples that the layout states"
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
