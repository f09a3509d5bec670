"""Learn from past passages: axle load calibrations of the sensors, and clusters of similar passages."""

from __future__ import annotations

import json
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config.settings.passage import PassageSettings
from turnout.config.turnout import TurnoutConfig
from turnout.errors import REMARK_REASONS, ReadError
from turnout.files import write_if_changed
from turnout.passage.analysis import analyse
from turnout.passage.axle_load import (
    LoadCalibration,
    calibrate,
    quasi_static,
    train_amplitude,
    with_error_correlation,
    with_speed_error,
)
from turnout.passage.axle_patterns import Pattern
from turnout.passage.cleaning import clean
from turnout.passage.clusters import Clusters, fit_clusters
from turnout.passage.result import Passage, PassageSensor
from turnout.passage.timetable import ListedTrain, OtherPassage, listed_for, listed_trains
from turnout.passage.train_type import UNKNOWN
from turnout.readers import read
from turnout.records import LongRecording, Recording, Rejection, Unit
from turnout.stages.filed_times import time_of_label
from turnout.stages.passage import sensors_of, trains_in
from turnout.stages.passage_context import read_clusters, read_loads
from turnout.workflow.notes import MAX_FILE_DURATION, MAX_LOGGER_DIFFERENCE
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    import duckdb

MAX_PASSAGES = 20_000  # for the clusters: more do not change them, and a mixture fit takes time
MAX_WAY_TO_ROW = 900.0  # s, from the start of a file to a row of the train data that may be of its train
SAME_SPEED = 0.02  # share by which two recordings of a train that brakes may differ, beyond their errors
RECENT_QUERY = """
    select train_type, speed_kmh, axle_load_t from trains_current
    where train_type is not null and speed_kmh is not null
    order by passed_at_utc desc, passage_id limit ?
"""


def learn_clusters(connection: duckdb.DuckDBPyConnection, settings: PassageSettings) -> Clusters:
    """Clusters of the latest passages of a registry, written to a file; existing clusters keep their ids.

    Parameters
    ----------
    connection : duckdb connection
        An open registry.
    settings : PassageSettings
        Folder of the clusters, and their largest number.
    """
    path = Path(settings.assets) / "clusters.json"
    cursor = connection.execute(RECENT_QUERY, [MAX_PASSAGES])
    names = [d[0] for d in cursor.description]
    clusters = fit_clusters([dict(zip(names, row)) for row in cursor.fetchall()], settings, read_clusters(path))
    write_if_changed(path, json.dumps(clusters.document(), indent=1) + "\n")
    return clusters


@dataclass(frozen=True)
class RecordedTrain:
    """One recording of a train: file, ``moment`` (naive UTC), what was found of it, and its ``sensors`` by name.

    ``amplitudes`` are mean and standard error [m/s²] by channel, empty where the recording cannot be used for loads.
    """

    path: str
    moment: datetime
    passage: Passage
    amplitudes: Mapping[str, tuple[float, float]]

    @property
    def is_cut_off(self) -> bool:
        """Whether it holds a part of the train."""
        return any(f.reason == "train_cut_off" for f in self.passage.findings)


def weighed_trains(
    turnout: TurnoutConfig,
    raw_root: str | Path,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
    max_trains: int = 60,
) -> list[dict]:
    """The latest trains of known axle load in a turnout's raw folder, with each sensor's amplitude.

    A train counts if trains.csv gives its axle load, its time and number of axles match no other train, and a recording
    of it has no fault of a sensor in use. Recordings of several loggers are one train (``is_same_train``).

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : str or Path
        Folder that holds those of the turnouts.
    patterns : sequence of Pattern
        Axle patterns of known trains.
    settings : PassageSettings
        Settings of the passages.
    max_trains : int
        Files are read until this number has a recording that can be used.

    Returns
    -------
    list of dict
        Each has "file", "load" [t], "speed" [m/s], "type" and "amplitudes": mean and standard error [m/s²] by channel.
    """
    listed, _ = listed_trains(turnout.trains)
    row_times = [row.passed_at for row in listed if row.axle_load is not None]
    recordings: list[RecordedTrain] = []
    passage_units = [u for u in scan(turnout, Path(raw_root)).units if u.kind == "passage"] if row_times else []
    rows: set[ListedTrain] = set()  # that a usable recording may have
    starts = sorted({time for u in passage_units if (time := time_of_label(u.label)) is not None})
    for unit in sorted(passage_units, key=lambda u: u.label, reverse=True):
        started = time_of_label(unit.label)
        if started is not None and not _has_row(started, starts, row_times):
            continue
        is_enough = len(rows) >= max_trains
        if is_enough and (started is None or (recordings[-1].moment - started).total_seconds() > MAX_WAY_TO_ROW):
            break  # no further file has a recording of these trains, or another train near them
        for recording in _recordings_of(unit, turnout, raw_root, patterns, settings):
            row = listed_for(recording.moment, recording.passage.n_axle, listed, settings.train_data_tolerance)
            if row is not None and row.axle_load is not None and recording.amplitudes:
                rows.add(row)
            recordings.append(recording)
    return _trains_of_known_load(recordings, listed, settings)


def _has_row(started: datetime, starts: Sequence[datetime], rows: Sequence[datetime]) -> bool:
    """Whether one of the ``rows``, in order, may be of a train in a file that lasts until the next one starts."""
    following, reach = bisect_right(starts, started), timedelta(seconds=MAX_WAY_TO_ROW)
    end = started + MAX_FILE_DURATION
    end = min(end, starts[following]) if following < len(starts) else end
    first = bisect_left(rows, started - reach)
    return first < len(rows) and rows[first] <= end + reach


def _trains_of_known_load(
    recordings: Sequence[RecordedTrain], listed: Sequence[ListedTrain], settings: PassageSettings
) -> list[dict[str, Any]]:
    """Trains of known axle load among those of the recordings: a row of the train data belongs to one of them."""
    trains = same_trains(recordings)
    in_time = [OtherPassage(_mean_moment(train), max(r.passage.n_axle for r in train)) for train in trains]
    weighed = []
    for k, train in enumerate(trains):
        rivals, n_axles = [*in_time[:k], *in_time[k + 1 :]], in_time[k].n_axles or 0
        row = listed_for(in_time[k].moment, n_axles, listed, settings.train_data_tolerance, rivals)
        usable = [r for r in train if r.amplitudes]
        if row is not None and row.axle_load is not None and usable:
            weighed.append(_train(usable, row.axle_load))
    return weighed


def _train(recordings: Sequence[RecordedTrain], load: float) -> dict[str, Any]:
    """A train of known ``load`` [t] from all of its recordings. Its speed is that with the least error."""
    first = min(recordings, key=lambda r: np.inf if r.passage.speed is None else r.passage.speed.se)
    types = [r.passage.type.type for r in (first, *recordings) if r.passage.type is not None]
    return {
        "file": first.path,
        "load": load,
        "speed": first.passage.train_motion.speed,
        "type": next((t for t in types if t != UNKNOWN), UNKNOWN),
        "amplitudes": {name: a for r in recordings for name, a in r.amplitudes.items()},
    }


def same_trains(recordings: Sequence[RecordedTrain]) -> list[list[RecordedTrain]]:
    """Group the recordings of each train; each joins the nearest in time of which all are of the same train.

    Parameters
    ----------
    recordings : sequence of RecordedTrain
        In any order.

    Returns
    -------
    list of list of RecordedTrain
        One list per train, in the order of its first recording.
    """
    trains: list[list[RecordedTrain]] = []
    for recording in recordings:
        fitting = [train for train in trains if all(is_same_train(recording, r) for r in train)]
        if fitting:
            min(fitting, key=lambda train: abs(recording.moment - _mean_moment(train))).append(recording)
        else:
            trains.append([recording])
    return trains


def is_same_train(first: RecordedTrain, second: RecordedTrain) -> bool:
    """Whether two recordings are of one train, from two loggers.

    No sensor records it in both, their times differ by ``MAX_LOGGER_DIFFERENCE`` at most, and axles, speed, direction
    and track agree. A recording that cuts the train off may have fewer axles.

    Parameters
    ----------
    first, second : RecordedTrain
        The recordings.

    Returns
    -------
    bool
        A train that follows has the same sensors, or comes later.
    """
    a, b = first.passage, second.passage
    if set(a.at_sensor) & set(b.at_sensor):
        return False
    if abs((first.moment - second.moment).total_seconds()) > MAX_LOGGER_DIFFERENCE:
        return False
    if a.n_axle != b.n_axle and not (first if a.n_axle < b.n_axle else second).is_cut_off:
        return False
    for x, y in ((a.direction, b.direction), (a.track, b.track)):
        if x != y and "unknown" not in (x, y) and "both" not in (x, y):
            return False
    if a.speed is None or b.speed is None:
        return True
    error = max(3.0 * float(np.hypot(a.speed.se, b.speed.se)), SAME_SPEED * a.speed.speed)
    return abs(a.speed.speed - b.speed.speed) <= error


def _mean_moment(recordings: Sequence[RecordedTrain]) -> datetime:
    first = recordings[0].moment
    return first + sum((r.moment - first for r in recordings), timedelta()) / len(recordings)


def _recordings_of(
    unit: Unit, turnout: TurnoutConfig, raw_root: str | Path, patterns: Sequence[Pattern], settings: PassageSettings
) -> list[RecordedTrain]:
    trains = []
    for path, *_ in unit.files:
        try:
            result = read(path, raw_root, turnout.require_passages().description, settings.longest)
            records: list[Recording | LongRecording] = [*result.recordings, *result.long_recordings]
            for recording in records:
                started = recording.started_at or time_of_label(unit.label)
                if started is None:
                    continue
                for train_recording, offset, _ in trains_in(recording, settings):
                    moment = started + timedelta(seconds=offset)
                    trains += _recorded_train(train_recording, moment, path, turnout, patterns, settings)
        except ReadError:
            continue  # the passage stage puts it into quarantine
    return trains


def _recorded_train(
    recording: Recording,
    started: datetime,
    path: str,
    turnout: TurnoutConfig,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
) -> list[RecordedTrain]:
    """The train of one passage, [] without axles."""
    sensors = sensors_of(turnout)
    passage = analyse(recording, sensors, patterns, settings)
    if not passage.n_axle:
        return []
    moment = started + timedelta(seconds=round(float(passage.times[0]), 6))
    amplitudes = {}
    if all(_is_unused(finding, passage) for finding in passage.findings if finding.reason not in REMARK_REASONS):
        amplitudes = _sensor_amplitudes(clean(recording, sensors)[0], passage, sensors)
    return [RecordedTrain(path, moment, passage, amplitudes)]


def _is_unused(finding: Rejection, passage: Passage) -> bool:
    """Whether a finding concerns channels alone that did not record the train, such as dead ones."""
    return bool(finding.channels) and not set(finding.channels) & set(passage.at_sensor)


def _sensor_amplitudes(
    recording: Recording, passage: Passage, sensors: Sequence[PassageSensor]
) -> dict[str, tuple[float, float]]:
    amplitudes = {
        s.name: train_amplitude(quasi_static(recording.signal(s.name), recording.rate, passage, s.position))
        for s in sensors
        if s.name in passage.at_sensor
    }
    if (speed := passage.speed) is not None:
        amplitudes = {name: with_speed_error(*a, speed.speed, speed.se) for name, a in amplitudes.items()}
    return amplitudes


def learn_loads(
    turnout: TurnoutConfig, trains: Sequence[Mapping[str, Any]], settings: PassageSettings
) -> dict[str, LoadCalibration]:
    """Calibrate every sensor that recorded enough weighed trains, and write the file of all turnouts.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    trains : sequence of mapping
        Result of ``weighed_trains``.
    settings : PassageSettings
        Settings of the passages.

    Returns
    -------
    dict of str to LoadCalibration
        Calibrations by channel.
    """
    calibrations = {}
    for name in sorted({name for t in trains for name in t["amplitudes"]}):
        recorded = [t for t in trains if name in t["amplitudes"]]
        amplitudes, errors = zip(*(t["amplitudes"][name] for t in recorded))
        loads, speeds = [t["load"] for t in recorded], [t["speed"] for t in recorded]
        calibration = calibrate(amplitudes, loads, speeds, settings.load_trains_minimum, errors)
        if calibration is not None:
            types = tuple(sorted({t["type"] for t in recorded} - {UNKNOWN}))
            calibrations[name] = replace(calibration, types=types)
    calibrations = with_error_correlation(calibrations, trains)
    path = Path(settings.assets) / "loads.json"
    by_turnout = read_loads(path)
    if calibrations:
        by_turnout[turnout.id] = calibrations
        write_if_changed(path, json.dumps(_document(by_turnout), indent=1) + "\n")
    return calibrations


def _document(by_turnout: Mapping[str, Mapping[str, LoadCalibration]]) -> dict[str, Any]:
    return {
        turnout: {name: asdict(c) | {"covariance": c.covariance.tolist()} for name, c in sorted(channels.items())}
        for turnout, channels in sorted(by_turnout.items())
    }
