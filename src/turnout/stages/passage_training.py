"""Learn from past passages: axle load calibrations of the sensors, and clusters of similar passages."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.config.settings.passage import PassageSettings
from turnout.config.turnout import TurnoutConfig
from turnout.errors import ReadError
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
from turnout.passage.timetable import ListedTrain, is_of_one_passage, listed_for, listed_trains
from turnout.passage.train_type import UNKNOWN
from turnout.readers import read
from turnout.records import LongRecording, Recording, Unit
from turnout.stages.filed_times import time_of_label
from turnout.stages.passage import sensors_of, trains_in
from turnout.stages.passage_context import read_clusters, read_loads
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    import duckdb

MAX_PASSAGES = 20_000  # for the clusters: more do not change them, and a mixture fit takes time
RECENT_QUERY = """
    select train_type, speed_kmh, axle_load_t from passages_current
    where status <> 'rejected' and train_type is not null and speed_kmh is not null
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


def weighed_trains(
    turnout: TurnoutConfig,
    raw_root: str | Path,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
    max_trains: int = 60,
) -> list[dict]:
    """The latest trains of known axle load in a turnout's raw folder, with each sensor's amplitude.

    A train counts if trains.csv gives its axle load, its time and number of axles match one passage only, and the
    recording is accepted.

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
        Files are read until this number is reached.

    Returns
    -------
    list of dict
        Each has "file", "load" [t], "speed" [m/s], "type" and "amplitudes": mean and standard error [m/s²] by channel.
    """
    listed, _ = listed_trains([row for row in turnout.trains if row.get("axle_load_t")])
    trains: list[tuple[dict[str, Any], datetime, ListedTrain]] = []
    passage_units = [u for u in scan(turnout, Path(raw_root)).units if u.kind == "passage"] if listed else []
    for unit in sorted(passage_units, key=lambda u: u.label, reverse=True):
        started = time_of_label(unit.label)
        if started is not None and not any(abs((t.passed_at - started).total_seconds()) < 900 for t in listed):
            continue
        trains += _weighed_in_unit(unit, turnout, raw_root, patterns, settings, listed)
        if len(trains) >= max_trains:
            break
    of_one = is_of_one_passage([moment for _, moment, _ in trains], [row for *_, row in trains])
    return [train for (train, *_), keeps_row in zip(trains, of_one) if keeps_row]


def _weighed_in_unit(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
    listed: Sequence[ListedTrain],
) -> list[tuple[dict[str, Any], datetime, ListedTrain]]:
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
                    trains += _weighed_train(train_recording, moment, path, turnout, patterns, settings, listed)
        except ReadError:
            continue  # the passage stage puts it into quarantine
    return trains


def _weighed_train(
    recording: Recording,
    started: datetime,
    path: str,
    turnout: TurnoutConfig,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
    listed: Sequence[ListedTrain],
) -> list[tuple[dict[str, Any], datetime, ListedTrain]]:
    """(amplitudes, time, row of the train data) of one passage, [] if it is rejected or its load is not known."""
    passage = analyse(recording, sensors_of(turnout), patterns, settings)
    if passage.status != "accepted":
        return []
    moment = started + timedelta(seconds=round(float(passage.times[0]), 6))
    train = listed_for(moment, passage.n_axle, listed, settings.train_data_tolerance)
    if train is None:
        return []
    cleaned, _ = clean(recording, sensors_of(turnout))
    return [(_sensor_amplitudes(path, cleaned, passage, sensors_of(turnout), train), moment, train)]


def _sensor_amplitudes(
    path: str, recording: Recording, passage: Passage, sensors: Sequence[PassageSensor], train: ListedTrain
) -> dict[str, Any]:
    amplitudes = {
        s.name: train_amplitude(quasi_static(recording.signal(s.name), recording.rate, passage, s.position))
        for s in sensors
        if s.name in passage.at_sensor
    }
    if (speed := passage.speed) is not None:
        amplitudes = {name: with_speed_error(*a, speed.speed, speed.se) for name, a in amplitudes.items()}
    recorded_type = UNKNOWN if passage.type is None else passage.type.type
    return {
        "file": path,
        "load": train.axle_load,
        "speed": passage.train_motion.speed,
        "type": recorded_type,
        "amplitudes": amplitudes,
    }


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
