"""Stage passage: registry rows of one passage file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, cast
from zlib import crc32

import scipy.signal  # noqa: F401 - each of the forked processes would load it at its first use otherwise

from turnout.config.settings.passage import PassageSettings
from turnout.config.turnout import TurnoutConfig
from turnout.errors import PartlyComputed, ReadError
from turnout.passage.analysis import analyse
from turnout.passage.axle_load import LoadCalibration, LoadFinding, axle_load
from turnout.passage.axle_patterns import Pattern
from turnout.passage.channel_fit import find_peak, fit_channel
from turnout.passage.cleaning import clean
from turnout.passage.clusters import Clusters
from turnout.passage.result import Passage, PassageSensor
from turnout.passage.segmentation import cut_passages
from turnout.passage.timetable import OtherPassage, listed_for, listed_trains
from turnout.records import LongRecording, ModalModel, Recording, Unit
from turnout.registry.ids import content_id
from turnout.stages.filed_times import MAX_NAME_OFFSET, TIME_REMEDY, time_contradiction, time_of_label
from turnout.stages.neighbouring_files import passages_beside
from turnout.stages.passage_rows import finding_rows, fit_row, passage_row
from turnout.stages.raw_files import quarantine_row, read_or_quarantine, recording_row
from turnout.units import IGNORED

NO_MODEL = "none"  # in the place of a model's id: the section has no model


@dataclass(frozen=True)
class SectionModel:
    """An identified model of a section that passages are fitted with."""

    model_id: str
    measured_at: datetime
    model: ModalModel


@dataclass(frozen=True)
class PassageContext:
    """What the analysis of a turnout's passages needs beside their files.

    ``models`` maps a section's label to its accepted models in order of time, ``patterns`` are the axle patterns of
    known trains, ``clusters`` the current ``Clusters`` or None, ``loads`` maps a channel to its ``LoadCalibration``.
    """

    models: dict[str, tuple[SectionModel, ...]] = field(default_factory=dict)
    patterns: tuple[Pattern, ...] = ()
    clusters: Clusters | None = None
    loads: dict[str, LoadCalibration] = field(default_factory=dict)


def passage_unit(
    unit: Unit, turnout: TurnoutConfig, raw_root: str | Path, context: PassageContext | None = None, algo: str = ""
) -> dict[str, list[dict]]:
    """Rows by table (recordings, passages, passage_fits, quarantine) for one passage file.

    A file that cannot be read, has no train, or has a time that contradicts its name is a quarantine row. A clipped,
    dead, swapped or lost channel is a quarantine row too; the other channels of the passage are used.

    Parameters
    ----------
    unit : Unit
        One passage file.
    turnout : TurnoutConfig
        With its rows of trains.csv.
    raw_root : path
        Folder that the path starts from.
    context : PassageContext or None
        Without one no model is fitted and every train is of unknown type.
    algo : str
        Version of the code.

    Raises
    ------
    PartlyComputed
        With the rows of the other records, if a record caused a program error.
    """
    context = context or PassageContext()
    faults: list[tuple] = []
    base = {"turnout_id": unit.turnout}
    rows: dict[str, list[dict]] = {"recordings": [], "passages": [], "passage_fits": [], "quarantine": []}
    description = turnout.require_passages().description
    for path, size, _ in unit.files:
        longest = turnout.settings["passage"].longest
        result = read_or_quarantine(path, raw_root, description, base, rows["quarantine"], "passage", longest=longest)
        if result is None:
            continue
        recording_id = result.sha256[:32]
        both: list[Recording | LongRecording] = [*result.recordings, *result.long_recordings]
        records = sorted(both, key=lambda r: r.record)
        contradiction = time_contradiction(path, records, time_of_label(unit.label), MAX_NAME_OFFSET, TIME_REMEDY)
        if contradiction is not None:
            rows["quarantine"].append(quarantine_row(contradiction, base, "passage", "passage", None, recording_id))
            continue
        if not sensors_of(turnout):
            rows["quarantine"] += [_without_sensor(path, r.record, base, turnout, recording_id) for r in records]
            rows["recordings"].append(recording_row(result, path, size, description, base, "passage", passage_id=None))
            continue
        trains: list[_AnalysedTrain] = []
        for recording in records:
            started_at = recording.started_at or time_of_label(unit.label)
            if started_at is None:
                remedy = "Put the time in its name as YYYYMMDDTHHMMSSZ, or record it in the file"
                error = ReadError(path, f"record {recording.record + 1}", "has no time", remedy, "wrong_time")
                rows["quarantine"].append(
                    quarantine_row(error, base, "passage", "passage", recording.record, recording_id)
                )
                continue
            try:
                for train_recording, offset, name in trains_in(recording, turnout.settings["passage"]):
                    moment = started_at + timedelta(seconds=offset)
                    trains.append(
                        _analyse_train(train_recording, moment, recording_id, path, turnout, context, rows, name)
                    )
            except ReadError as error:  # a long record is read in pieces: its file may be damaged or change meanwhile
                rows["quarantine"].append(
                    quarantine_row(error, base, "passage", "passage", recording.record, recording_id)
                )
            except (MemoryError, OSError):
                raise
            except Exception as error:
                faults.append((path, recording.record, error))
        _add_trains(trains, path, raw_root, turnout, context, rows)
        first = rows["passages"][0]["passage_id"] if rows["passages"] else None
        rows["recordings"].append(recording_row(result, path, size, description, base, "passage", passage_id=first))
    if faults:
        raise PartlyComputed(rows, faults)
    return rows


def _without_sensor(
    path: str, record: int, base: Mapping[str, Any], turnout: TurnoutConfig, recording_id: str
) -> dict[str, Any]:
    """Quarantine row of a record of a turnout whose passages have no accelerometer."""
    quantities = sorted({c.quantity for c in turnout.require_passages().description.channels} - {IGNORED})
    problem = f"its channels measure {' and '.join(quantities)}, and trains are found by accelerometers alone"
    remedy = "Name an acceleration channel in the layout; until then the recording is filed without a passage"
    error = ReadError(path, f"record {record + 1}", problem, remedy, "no_accelerometer")
    return quarantine_row(error, base, "passage", "passage", record, recording_id)


def sensors_of(turnout: TurnoutConfig) -> tuple[PassageSensor, ...]:
    """The acceleration sensors of a turnout's passages.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration with passages.

    Returns
    -------
    tuple of PassageSensor
        In the order of the layout's channels.

    Raises
    ------
    ConfigError
        If the layout describes no passages.
    """
    sensors, passages = [], turnout.require_passages()
    for channel in passages.description.channels:
        if channel.quantity == "acceleration":
            section = turnout.section(passages.sections[channel.name])
            position = channel.position if channel.position is not None else section.position
            sensors.append(PassageSensor(channel.name, section.label, float(position), section.track, section.panel))
    return tuple(sensors)


def model_at(models: Sequence[SectionModel], moment: datetime) -> SectionModel | None:
    """The latest model identified at or before a moment, else the first one.

    Parameters
    ----------
    models : sequence of SectionModel
        Models of one section, in order of time.
    moment : datetime
        Naive UTC.

    Returns
    -------
    SectionModel or None
        None without any model.
    """
    before = [m for m in models if m.measured_at <= moment]
    return before[-1] if before else models[0] if models else None


def trains_in(
    recording: Recording | LongRecording, settings: PassageSettings
) -> Iterator[tuple[Recording, float, tuple[str, ...]]]:
    """Every passage in a record.

    A record longer than ``settings.longest`` is continuous and is cut at the quiet times. A ``LongRecording`` is read
    in pieces.

    Parameters
    ----------
    recording : Recording or LongRecording
        One record of a file.
    settings : PassageSettings
        Settings of the passages.

    Yields
    ------
    tuple of (Recording, float, tuple of str)
        The passage, its start after that of the record [s], and what distinguishes it from others in the record.

    Raises
    ------
    ReadError
        The file of a ``LongRecording`` is damaged.
    """
    if recording.duration <= settings.longest:
        yield cast("Recording", recording), 0.0, ()  # a LongRecording is longer
        return
    rows = list(recording.of_quantity("acceleration"))
    attributes = {
        name: getattr(recording, name) for name in ("rate", "kind", "source", "record", "started_at", "conditions")
    }
    channels = tuple(recording.channels[i] for i in rows)
    blocks = (block[rows] for block in recording.blocks(settings.chunk))
    for piece in cut_passages(blocks, recording.rate, settings):
        train_recording = Recording(samples=piece.samples.astype(float), channels=channels, **attributes)
        yield train_recording, piece.start / recording.rate, (str(piece.start),)


@dataclass(frozen=True)
class _AnalysedTrain:
    """A train before its row of the train data is known; ``name`` distinguishes it from others in its record."""

    passage: Passage
    identity: dict[str, Any]
    record: int
    name: tuple[str, ...]
    conditions: Mapping[str, Any]
    load: LoadFinding | None
    fits: list[dict[str, Any]]

    @property
    def in_time(self) -> OtherPassage:
        """When it passed, with its axles."""
        return OtherPassage(self.identity["passed_at_utc"], self.passage.n_axle)


def _analyse_train(
    recording: Recording,
    started_at: datetime,
    recording_id: str,
    path: str,
    turnout: TurnoutConfig,
    context: PassageContext,
    rows: dict[str, list[dict]],
    name: tuple[str, ...] = (),
) -> _AnalysedTrain:
    """Analyse one train, and add its findings to the rows."""
    settings = turnout.settings["passage"]
    sensors = sensors_of(turnout)
    passage = analyse(recording, sensors, context.patterns, settings)
    recording, _ = clean(recording, sensors)  # for loads and fits
    first = float(passage.times[0]) if passage.n_axle else 0.0
    passed_at = started_at + timedelta(seconds=round(first, 3))
    rows["quarantine"] += finding_rows(passage, {"turnout_id": turnout.id}, path, recording.record, recording_id)
    load = axle_load(recording, passage, context.loads, settings) if passage.n_axle else None
    identity = {"turnout_id": turnout.id, "recording_id": recording_id, "passed_at_utc": passed_at}
    fits = _fit_rows(recording, passage, sensors, turnout, context, identity, settings) if passage.n_axle else []
    return _AnalysedTrain(passage, identity, recording.record, name, recording.conditions, load, fits)


def _add_trains(
    trains: Sequence[_AnalysedTrain],
    path: str,
    raw_root: str | Path,
    turnout: TurnoutConfig,
    context: PassageContext,
    rows: dict[str, list[dict]],
) -> None:
    """Add the rows of the trains of a file. A row of the train data belongs to one of them at most."""
    listed, _ = listed_trains(turnout.trains)
    tolerance = turnout.settings["passage"].train_data_tolerance
    for train in trains:
        passage, listed_train = train.passage, None
        if listed and passage.n_axle:
            rivals = [t.in_time for t in trains if t is not train and t.passage.n_axle]
            if not train.name:  # the files of a continuous logger do not begin with a train
                rivals += passages_beside(path, raw_root, train.in_time.moment, tolerance)
            listed_train = listed_for(train.in_time.moment, passage.n_axle, listed, tolerance, rivals)
        row = passage_row(passage, train.identity, listed_train, train.load, train.conditions)
        if context.clusters is not None and passage.n_axle:
            values = (row.get(key) for key in ("train_type", "speed_kmh", "axle_load_t"))
            row["cluster_id"] = context.clusters.assign(*values)
        # The id depends on the whole row: train data, models, clusters and loads change it as well as the file does.
        # It depends on the path too, so that the row of a copy stays when that of its original is withdrawn.
        passage_id = {"passage_id": content_id("passage", path, str(train.record), *train.name, row, train.fits)}
        # The codes repeat what the row states in words, so they are not part of the id.
        rows["passages"].append(passage_id | row | {"reason_codes": [f.reason for f in passage.findings]})
        rows["passage_fits"] += [passage_id | fit for fit in train.fits]


def _fit_rows(
    recording: Recording,
    passage: Passage,
    sensors: Sequence[PassageSensor],
    turnout: TurnoutConfig,
    context: PassageContext,
    identity: Mapping[str, Any],
    settings: PassageSettings,
) -> list[dict[str, Any]]:
    """One row per sensor that recorded the train; where its section has no model, with the peak alone."""
    unfit = {f.channel for f in passage.findings if f.reason in ("clipped", "drop_out")}
    lost_from = {f.channel: f.time for f in passage.findings if f.reason == "sensor_lost"}
    rows = []
    latest = {label: model_at(models, identity["passed_at_utc"]) for label, models in context.models.items()}
    for sensor in sensors:
        section_model = latest.get(sensor.section)
        if sensor.name not in passage.at_sensor:
            continue
        times = passage.at_sensor[sensor.name]
        lost_at = lost_from.get(sensor.name)
        if lost_at is not None:
            times = times[times + settings.score_window < lost_at]
        is_unfit = sensor.name in unfit and lost_at is None
        fit = None
        if not is_unfit and len(times) >= 2:
            samples, model = recording.signal(sensor.name), section_model.model if section_model else None
            if model is None or not is_scored(identity["passed_at_utc"], settings.scored_share):
                fit = find_peak(samples, recording.rate, times, settings)
            else:
                others = {label: m.model for label, m in latest.items() if m is not None and label != sensor.section}
                fit = fit_channel(samples, recording.rate, times, passage.train_motion.speed, model, settings, others)
        model_id = section_model.model_id if section_model else NO_MODEL
        rows.append(fit_row(fit, sensor, model_id, turnout, identity))
    return rows


def is_scored(passed_at: datetime, share: float) -> bool:
    """Whether a passage is among the share that is scored: by its time, so the same again and in any order.

    Parameters
    ----------
    passed_at : datetime
        Time of the first axle.
    share : float
        Share of the passages that are scored. [-]

    Returns
    -------
    bool
        True for every passage if the share is 1.

    Examples
    --------
    >>> moments = [datetime(2025, 1, 1) + timedelta(hours=k) for k in range(1000)]
    >>> [sum(is_scored(m, share) for m in moments) for share in (0.0, 0.3, 1.0)]
    [0, 300, 1000]
    """
    return crc32(passed_at.isoformat(timespec="seconds").encode()) < share * 2**32
