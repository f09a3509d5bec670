"""What a raw file contains, before any layout exists: records, channels, rate, times, impacts and trains."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

import numpy as np

from turnout.config.settings.passage import PassageSettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.constants import MAD_TO_SD
from turnout.errors import ReadError
from turnout.hammer_test.segmentation import find_triggers
from turnout.passage.segmentation import BAND, cut_passages
from turnout.readers import FORMATS, MAX_WHOLE_FILE_SIZE, read_unconverted
from turnout.readers.frequency_responses import FrequencyResponses, find_responses
from turnout.readers.interpret import errors_without_layout
from turnout.readers.source import BLOCK_SIZE, RawFile, RawRecord, Source
from turnout.readers.stated_units import with_stated_units
from turnout.readers.unexplained_entries import RecordFacts, shown_text, unexplained_entries
from turnout.stages.channel_roles import ChannelRole, channel_roles
from turnout.stages.stated_rate import NO_RATE, StatedRate, stated_rate

MAX_EXAMINED = 2**24  # samples per channel of a record that are searched for impacts and trains
MIN_TRAIN_TIME = 2.0  # s, shortest record that is searched for trains


@dataclass(frozen=True)
class ChannelContents:
    """A channel of a file: ``name``, ``unit`` ("" if not stated), extremes [unit], and what it may be."""

    name: str
    unit: str
    minimum: float
    maximum: float
    role: ChannelRole


@dataclass(frozen=True)
class Event:
    """An impact or a train: ``record`` from 1, ``time`` from the start of the record [s], ``size`` [unit of channel].

    The size is the peak of an impact's force, or the length of a train [s].
    """

    record: int
    time: float
    size: float


@dataclass(frozen=True)
class FileContents:
    """Contents of one raw file.

    ``kind`` is "impacts", "trains", "frequency responses" or "" (neither found). ``n_samples`` is the range of samples
    per record; ``problems`` are damaged records and contradictions. ``events`` belong to channel ``event_channel``.
    ``unexplained`` are names and values of metadata that may state a rate, scale or unit, and that nothing explains.
    ``starts`` are the times of first and last record; ``has_zone`` tells whether the file states their time zone.
    """

    path: str
    format: str
    meaning: str
    size: int
    n_records: int = 0
    n_samples: tuple[int, int] = (0, 0)
    rate: StatedRate = NO_RATE
    starts: tuple[datetime, datetime] | None = None
    has_zone: bool = False
    channels: tuple[ChannelContents, ...] = ()
    kind: str = ""
    events: tuple[Event, ...] = ()
    event_channel: str = ""
    problems: tuple[str, ...] = ()
    unexplained: tuple[tuple[str, str], ...] = ()
    responses: FrequencyResponses | None = None
    records: tuple[RawRecord, ...] = field(default=(), repr=False)

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels, in the order of the file."""
        return tuple(channel.name for channel in self.channels)

    def with_role(self, role: str) -> tuple[ChannelContents, ...]:
        """Channels that may be of a role, the likeliest first.

        Parameters
        ----------
        role : str
            "force", "response", "time" or "other".

        Returns
        -------
        tuple of ChannelContents
            In the order of the file; those with the better evidence first.
        """
        channels = [channel for channel in self.channels if channel.role.name == role]
        return tuple(sorted(channels, key=lambda channel: channel.role.rank))


def file_contents(path: Path | str) -> FileContents:
    """Contents of one raw file, by the file alone.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    FileContents
        Records, channels, rate, times, and the impacts or trains in it.

    Raises
    ------
    ReadError
        If the file as a whole cannot be read.
    """
    path = Path(path)
    real_path = Path(os.path.realpath(path))  # a link that leads back to itself is reported by the reader
    try:
        responses = find_responses(real_path.name, real_path.parent)
        if responses is not None:
            return _response_contents(path, real_path, responses)
        is_large = real_path.is_file() and real_path.stat().st_size > MAX_WHOLE_FILE_SIZE
        source, format_name, raw = read_unconverted(real_path.name, real_path.parent, is_lazy=is_large)
        return _contents(path, source, format_name, raw)
    except ReadError as error:
        raise ReadError(path, error.where, error.problem, error.remedy, error.reason) from None


def _response_contents(path: Path, real_path: Path, responses: FrequencyResponses) -> FileContents:
    n_line = len(responses.frequency)
    return FileContents(
        str(path), responses.format, "frequency responses", real_path.stat().st_size, len(responses.frf),
        (n_line, n_line), kind="frequency responses", responses=responses,
    )  # fmt: skip


def _contents(path: Path, source: Source, format_name: str, raw: RawFile) -> FileContents:
    raw_records, expected = raw.records, raw.expected
    errors = [*(e for e in raw_records if isinstance(e, ReadError)), *errors_without_layout(raw, source)]
    problems = [f"{e.where}: {e.problem}. {e.remedy}." for e in errors]
    numbered = [(k, record) for k, record in enumerate(raw_records) if isinstance(record, RawRecord)]
    records = tuple(record for _, record in numbered)
    if expected is not None and len(raw_records) < expected:
        problems.append(f"it holds {len(raw_records)} of the {expected} records that its own header states")
    base = FileContents(
        str(path), format_name, FORMATS[format_name].meaning, source.size, len(raw_records),
        records=records, problems=tuple(problems),
    )  # fmt: skip
    if not records:
        return base
    rates = [stated_rate(record, k, len(raw_records), source) for k, record in numbered]
    rate = next((r for r in rates if r.value is not None), rates[0])
    problems += [f"record {k + 1}: {r.problem}" for (k, _), r in zip(numbered, rates) if r.problem]
    differing = sorted({r.value for r in rates if r.value is not None})
    if len(differing) > 1:
        problems.append(f"its records have different rates: {', '.join(f'{r:.9g}' for r in differing)} Hz")
    first = records[0]
    if any(record.names != first.names for record in records):
        problems.append("its records have different channels; those of the first are shown")
    lengths = [len(record.samples[0]) if record.samples else 0 for record in records]
    starts = [record.started_at for record in records if record.started_at is not None]
    roles = channel_roles(first, rate.value)
    channels = tuple(
        ChannelContents(name, unit, *_extremes(records, i), role)
        for i, (name, unit, role) in enumerate(zip(first.names, first.units, roles))
    )
    contents = replace(
        base,
        n_samples=(min(lengths), max(lengths)),
        rate=rate,
        starts=(starts[0], starts[-1]) if starts else None,
        has_zone=bool(starts) and starts[0].tzinfo is not None,
        channels=channels,
        problems=tuple(dict.fromkeys(problems)),
        unexplained=tuple(_unexplained_names(first, rate.value, len(raw_records))) if rate.value else (),
    )
    return _with_events(contents) if rate.value else contents


def _unexplained_names(record: RawRecord, rate: float, n_record: int) -> Iterator[tuple[str, str]]:
    units = with_stated_units(record).units
    facts = RecordFacts(rate, len(record.samples[0]), len(record.names), n_record, units, record.names)
    for entry, candidate in unexplained_entries(record.entries, facts):
        yield entry.name, shown_text(entry, candidate)


def _extremes(records: Sequence[RawRecord], index: int) -> tuple[float, float]:
    """Least and largest finite number of a channel over all records, nan without one."""
    low, high = np.inf, -np.inf
    for record in records:
        if index >= len(record.samples):
            continue
        column = record.samples[index]
        for start in range(0, len(column), BLOCK_SIZE):
            block = np.asarray(column[start : start + BLOCK_SIZE], dtype=float)
            block = block[np.isfinite(block)]
            if block.size:
                low, high = min(low, float(block.min())), max(high, float(block.max()))
    return (low, high) if low <= high else (float("nan"), float("nan"))


def _with_events(contents: FileContents) -> FileContents:
    """Contents with the impacts of the likeliest force, else with the trains of the likeliest responses."""
    forces, responses = contents.with_role("force"), contents.with_role("response")
    for force in forces:
        events = tuple(_impacts(contents, force.name))
        if events:
            return replace(contents, kind="impacts", events=events, event_channel=force.name)
    if not responses:
        return contents
    events = tuple(_trains(contents, [channel.name for channel in responses]))
    return replace(contents, kind="trains" if events else "", events=events)


def _impacts(contents: FileContents, force: str) -> Iterator[Event]:
    """Impacts in the numbers of one channel as they are."""
    rate, settings = float(contents.rate.value or 0.0), ReceptanceSettings()
    for k, record in enumerate(contents.records):
        if force not in record.names:
            continue
        x = np.asarray(record.samples[record.names.index(force)][:MAX_EXAMINED], dtype=float)
        x = np.nan_to_num(x - np.median(x[np.isfinite(x)]) if np.isfinite(x).any() else x)
        if np.ptp(x) == 0.0:
            continue
        noise = MAD_TO_SD * float(np.median(np.abs(x)))
        for first, last in find_triggers(x, noise, rate, settings)[0]:
            pulse = x[first : last + 1]
            yield Event(k + 1, first / rate, float(pulse[np.argmax(np.abs(pulse))]))


def _trains(contents: FileContents, names: Sequence[str]) -> Iterator[Event]:
    """Stretches in which the channels are together loud for the length of a train."""
    rate, settings = float(contents.rate.value or 0.0), PassageSettings()
    if rate <= 2.2 * BAND[1]:
        return
    for k, record in enumerate(contents.records):
        columns = [record.samples[record.names.index(name)] for name in names if name in record.names]
        n_sample = min((len(column) for column in columns), default=0)
        if n_sample < MIN_TRAIN_TIME * rate:
            continue
        for piece in cut_passages(_blocks(columns, min(n_sample, MAX_EXAMINED)), rate, settings):
            length = piece.samples.shape[1] / rate
            yield Event(k + 1, piece.start / rate, length)


def _blocks(columns: Sequence, n_sample: int) -> Iterator[np.ndarray]:
    for start in range(0, n_sample, BLOCK_SIZE):
        stop = min(start + BLOCK_SIZE, n_sample)
        block = np.stack([np.asarray(column[start:stop], dtype=float) for column in columns])
        yield np.nan_to_num(block, nan=0.0, posinf=0.0, neginf=0.0)
