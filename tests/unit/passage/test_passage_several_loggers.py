"""Several recordings of one train are one train, and trains that follow each other are several."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
import scipy
from benchmarks.passage_truth import IC3, PATTERNS, RATE, passing_times, rolling_noise

from turnout.config import load_configuration, with_raw
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.stages.passage_training import _has_row, _recorded_train, same_trains, weighed_trains

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4, "ASM": 36.0}
LOGGERS = {1: [tuple(PLACES)], 2: [("OT", "SP", "CLP"), ("A7", "A8", "ASM")]}
LOGGERS[3] = [("OT", "SP"), ("CLP", "A7"), ("A8", "ASM")]
NOON = datetime(2024, 5, 13, 12)


def train(seed, load=12.0, speed=35.0):
    """Bursts that follow the wheels, and under each the bending of the rail; the diverging sensors stay silent."""
    rng, places = np.random.default_rng(seed), list(PLACES.values())
    recording = rolling_noise(rng, IC3, speed, places, noise=0.01)
    samples, time = 0.3 * recording.samples, np.arange(recording.n_sample) / RATE
    for row, times in zip(samples, passing_times(IC3, places, speed, 0.0, 1, 1.0)):
        for t in times:
            kx = 1.1 * speed * np.abs(time - t)
            row += 2e-3 * load * speed**2 * np.exp(-kx) * (np.cos(kx) - np.sin(kx))
    silent = 0.01 * rng.standard_normal((2, recording.n_sample))
    channels = tuple(Channel(n, "acceleration", x) for n, x in {**PLACES, "A9": 28.2, "ASD": 36.0}.items())
    return replace(recording, samples=np.vstack([samples, silent]), channels=channels)


def of_logger(recording, names, moment, fill=0.0):
    """The recording of a logger with these sensors; its other channels hold noise of ``fill`` m/s², or nothing."""
    rng, samples = np.random.default_rng(5), recording.samples.copy()
    for i, channel in enumerate(recording.channels):
        if channel.name not in names:
            samples[i] = fill * rng.standard_normal(samples.shape[1])
    return replace(recording, samples=samples, started_at=moment)


@pytest.fixture(scope="module")
def turnout(repository):
    return load_configuration(repository / "config").turnout("tommerup_s1")


def recorded(turnout, *recordings):
    settings = turnout.settings["passage"]
    return [r for x in recordings for r in _recorded_train(x, x.started_at, "p", turnout, PATTERNS, settings)]


@pytest.mark.parametrize("n_loggers", [2, 3])
@pytest.mark.parametrize("clock", [0.0, -6.0, 10.0])
def test_the_recordings_of_several_loggers_are_one_train_and_trains_that_follow_are_others(n_loggers, clock, turnout):
    """Two trains two minutes apart, each at every logger, whose clocks differ by ``clock`` seconds."""
    first, second = train(1), train(2)
    recordings = [
        of_logger(x, names, start + timedelta(seconds=clock * k / (n_loggers - 1)), fill)
        for x, start in ((first, NOON), (second, NOON + timedelta(minutes=2)))
        for k, (names, fill) in enumerate(zip(LOGGERS[n_loggers], (0.01, 0.0, 0.01)))
    ]
    found = recorded(turnout, *recordings)
    trains = same_trains(found)
    assert [[found.index(r) for r in t] for t in trains] == np.arange(2 * n_loggers).reshape(2, n_loggers).tolist()
    assert all(r.amplitudes for r in found)


def test_two_recordings_of_one_sensor_are_two_trains(turnout):
    found = recorded(turnout, *(of_logger(train(k), PLACES, NOON + timedelta(seconds=12 * k)) for k in (0, 1)))
    assert len(same_trains(found)) == 2


def test_a_logger_with_another_rate_or_a_late_start_records_the_same_train(turnout):
    """One at 10 kHz; one that begins within the train, so that axles are missing."""
    whole = train(3)
    slow = of_logger(whole, LOGGERS[2][0], NOON, 0.01)
    slow = replace(slow, rate=RATE / 2, samples=scipy.signal.decimate(slow.samples, 2, axis=1))
    x = of_logger(whole, LOGGERS[2][1], NOON, 0.01)
    skipped = round((1.0 + 25.0 / 35.0 + (24.6 + 12.0) / 35.0) * RATE)
    late = replace(x, samples=x.samples[:, skipped:], started_at=NOON + timedelta(seconds=skipped / RATE))
    found = recorded(turnout, slow, x, late)
    assert [r.passage.n_axle for r in found[:2]] == [8, 8] and found[2].passage.n_axle < 8
    assert len(same_trains(found[:2])) == 1 and len(same_trains([found[0], found[2]])) == 1
    assert not found[2].amplitudes  # a part of a train is not weighed


def test_another_train_at_other_sensors_is_none_of_the_same(turnout):
    """At another speed, or on the other track."""
    one, faster = recorded(
        turnout, of_logger(train(4), LOGGERS[2][0], NOON), of_logger(train(5, speed=42.0), LOGGERS[2][1], NOON)
    )
    assert len(same_trains([one, faster])) == 2
    main, diverging = (
        replace(one, passage=replace(one.passage, track=t, at_sensor={t: 0})) for t in ("main", "diverging")
    )
    assert len(same_trains([main, diverging])) == 2


@pytest.mark.parametrize("n_loggers", [1, 2, 3])
def test_a_train_in_several_files_is_weighed_once_with_all_of_its_sensors(n_loggers, turnout, tmp_path):
    """Two trains with loads. Formerly a train in two files lost its row to neither, and was not weighed."""
    folder, rows = tmp_path / "tommerup_s1" / "passages", ["passed_at_utc,train_type,axle_load_t"]
    folder.mkdir(parents=True)
    for n, load in enumerate((12.0, 15.0)):
        start = NOON + timedelta(minutes=2 * n)
        rows.append(f"{(start + timedelta(seconds=3)).isoformat()},IC3,{load}")
        for k, names in enumerate(LOGGERS[n_loggers]):
            moment = start + timedelta(seconds=2 * k)
            x = of_logger(train(10 + n, load), names, moment)
            write([x], folder / f"{moment:%Y%m%dT%H%M%SZ}.h5", "hdf5")
    (tmp_path / "tommerup_s1" / "trains.csv").write_text("\n".join(rows) + "\n")
    own = with_raw(turnout, tmp_path)
    trains = weighed_trains(own, tmp_path, PATTERNS, own.settings["passage"])
    assert sorted(t["load"] for t in trains) == [12.0, 15.0]
    assert all(set(t["amplitudes"]) == set(PLACES) for t in trains)


def test_a_train_whose_own_row_has_no_load_does_not_have_that_of_another(turnout, tmp_path):
    """Its row states no load; that of a train without a recording, a minute later, does. Formerly it had that one."""
    folder = tmp_path / "tommerup_s1" / "passages"
    folder.mkdir(parents=True)
    write([of_logger(train(6), PLACES, NOON)], folder / f"{NOON:%Y%m%dT%H%M%SZ}.h5", "hdf5")
    rows = "passed_at_utc,train_type,axle_load_t\n2024-05-13T12:00:02Z,IC3,\n2024-05-13T12:01:02Z,IC3,20.0\n"
    (tmp_path / "tommerup_s1" / "trains.csv").write_text(rows)
    own = with_raw(turnout, tmp_path)
    assert weighed_trains(own, tmp_path, PATTERNS, own.settings["passage"]) == []


def test_recordings_that_cannot_be_used_do_not_end_the_search(turnout, tmp_path):
    """The newest recording begins within its train. The one of an hour before is weighed in its place."""
    folder, rows = tmp_path / "tommerup_s1" / "passages", ["passed_at_utc,train_type,axle_load_t"]
    folder.mkdir(parents=True)
    for minutes, skipped in ((0, 0), (60, round(1.9 * RATE))):
        moment, x = NOON + timedelta(minutes=minutes), train(7)
        cut = replace(x, samples=x.samples[:, skipped:], started_at=moment)
        write([cut], folder / f"{moment:%Y%m%dT%H%M%SZ}.h5", "hdf5")
        rows.append(f"{(moment + timedelta(seconds=2)).isoformat()},IC3,{12.0 + minutes / 60}")
    (tmp_path / "tommerup_s1" / "trains.csv").write_text("\n".join(rows) + "\n")
    own = with_raw(turnout, tmp_path)
    trains = weighed_trains(own, tmp_path, PATTERNS, own.settings["passage"], max_trains=1)
    assert [t["load"] for t in trains] == [12.0]


def test_a_train_late_in_a_long_file_is_weighed():
    """Half an hour after the start of its file. Formerly only files that start near a row were read."""
    assert _has_row(NOON, [NOON], [NOON + timedelta(minutes=30)])
    assert not _has_row(NOON, [NOON, NOON + timedelta(minutes=10)], [NOON + timedelta(minutes=30)])
    assert not _has_row(NOON, [NOON], [NOON - timedelta(minutes=30)])
