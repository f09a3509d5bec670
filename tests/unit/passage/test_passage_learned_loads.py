"""Loads and clusters are learnt from files and a registry, and used for the next passage."""

import json
import re
import shutil
from dataclasses import replace
from datetime import datetime, timedelta
from types import SimpleNamespace

import duckdb
import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, RATE, passing_times, rolling_noise, sensors_for
from scipy import stats

from turnout.cli.main import main
from turnout.config import load_configuration, with_raw
from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.axle_load import axle_load, calibrate, train_amplitude, with_error_correlation
from turnout.passage.kinematics import Motion
from turnout.passage.result import Passage, SpeedFinding
from turnout.passage.timetable import listed_trains
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.registry.view_texts import view_files
from turnout.stages.passage_context import read_clusters, read_loads
from turnout.stages.passage_training import learn_clusters, learn_loads, weighed_trains

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "ASM": 36.0}
GAIN = {"OT": 1.0, "SP": 1.4, "CLP": 0.8, "A7": 1.2, "ASM": 0.9}
WAVENUMBER = 1.1


def weighed(rng, load, speed, scatter=0.01):
    """Bursts that follow the wheels, and under each the v² w'' of a rail on its foundation, for ``load`` tonnes."""
    places = list(PLACES.values())
    recording = rolling_noise(rng, IC3, speed, places, noise=0.01)
    samples, time = 0.3 * recording.samples, np.arange(recording.n_sample) / RATE
    for row, name, times in zip(samples, PLACES, passing_times(IC3, places, speed, 0.0, 1, 1.0)):
        for t in times:
            kx = WAVENUMBER * speed * np.abs(time - t)
            shape = np.exp(-kx) * (np.cos(kx) - np.sin(kx))
            row += 2e-3 * GAIN[name] * load * (1 + scatter * rng.standard_normal()) * speed**2 * shape
    channels = tuple(Channel(n, "acceleration", x) for n, x in PLACES.items())
    return replace(recording, samples=samples, channels=channels)


@pytest.fixture(scope="module")
def turnout(tmp_path_factory, repository):
    """(turnout, raw, settings): nine trains on file, eight of them with their axle load in trains.csv."""
    raw, rng = tmp_path_factory.mktemp("weighed"), np.random.default_rng(31)
    folder = raw / "tommerup_s1" / "passages"
    folder.mkdir(parents=True)
    rows = ["passed_at_utc,train_type,speed_kmh,axle_load_t"]
    for k in range(9):
        moment, load = datetime(2024, 5, 13, 6) + timedelta(hours=k), 10.0 + 1.5 * k
        recording = replace(weighed(rng, load, 30.0 + 2.0 * k), started_at=moment)
        others = [c for c in ("A8", "A9", "ASD")]
        silent = 0.01 * rng.standard_normal((3, recording.n_sample))
        more = tuple(Channel(n, "acceleration", x) for n, x in zip(others, (26.4, 28.2, 36.0)))
        recording = replace(
            recording, samples=np.vstack([recording.samples, silent]), channels=recording.channels + more
        )
        write([recording], folder / f"{moment:%Y%m%dT%H%M%SZ}.h5", "hdf5")
        if k != 3:
            rows.append(f"{moment.isoformat()},IC3,{3.6 * (30 + 2 * k):.0f},{load}")
    (raw / "tommerup_s1" / "trains.csv").write_text("\n".join(rows) + "\n")
    found = with_raw(load_configuration(repository / "config").turnout("tommerup_s1"), raw)
    return found, raw, replace(found.settings["passage"], assets=str(raw / "assets"))


def test_trains_of_known_weight_calibrate_the_sensors_that_weigh_the_next_train(turnout):
    config, raw, settings = turnout
    trains = weighed_trains(config, raw, PATTERNS, settings)
    assert [t["load"] for t in trains] == [22.0, 20.5, 19.0, 17.5, 16.0, 13.0, 11.5, 10.0]
    made = learn_loads(config, trains, settings)
    assert set(made) == set(PLACES)
    for name in PLACES:
        assert made[name].exponent == pytest.approx(2.0, abs=0.15) and made[name].n == 8
        assert np.exp(made[name].log_gain) / made[name].speed ** 2 / GAIN[name] == pytest.approx(
            np.exp(made["OT"].log_gain) / made["OT"].speed ** 2, rel=0.05
        )
    known = read_loads(raw / "assets" / "loads.json")["tommerup_s1"]
    assert known.keys() == made.keys() and known["A7"].scatter == made["A7"].scatter
    recording = weighed(np.random.default_rng(32), 14.5, 36.0)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    found = axle_load(recording, passage, known, settings)
    assert found.mean == pytest.approx(14.5, rel=0.05) and found.se < 0.025 * found.mean


def test_a_row_of_the_train_data_counts_for_one_passage(turnout, tmp_path):
    """A second train 40 s later, without a row of its own. Formerly it had the load of the first one."""
    config, raw, settings = turnout
    shutil.copytree(raw / "tommerup_s1", tmp_path / "tommerup_s1")
    folder = tmp_path / "tommerup_s1" / "passages"
    (first,) = folder.glob("20240513T0600*")
    content = first.read_bytes().replace(b"2024-05-13T06:00:00", b"2024-05-13T06:00:40")
    (folder / "20240513T060040Z.h5").write_bytes(content)
    trains = weighed_trains(with_raw(config, tmp_path), tmp_path, PATTERNS, settings)
    assert [t["load"] for t in trains].count(10.0) == 1 and len(trains) == 8
    assert {t["type"] for t in trains} == {"IC3"}


@pytest.mark.parametrize(("train_type", "is_calibrated"), [("IC3", True), ("freight", False), ("unknown", False)])
def test_the_load_of_another_type_than_those_of_the_calibration_has_their_difference_in_its_error(
    turnout, train_type, is_calibrated
):
    config, raw, settings = turnout
    made = learn_loads(config, weighed_trains(config, raw, PATTERNS, settings), settings)
    assert all(c.types == ("IC3",) for c in made.values())
    recording = weighed(np.random.default_rng(32), 14.5, 36.0)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    passage = replace(passage, type=replace(passage.type, type=train_type))
    any_error = replace(settings, load_relative_error_maximum=1.0)
    found = axle_load(recording, passage, read_loads(raw / "assets" / "loads.json")["tommerup_s1"], any_error)
    same = axle_load(recording, passage, {n: replace(c, types=None) for n, c in made.items()}, any_error)
    expected = same.se / same.mean if is_calibrated else np.hypot(same.se / same.mean, 0.03)
    assert found.se / found.mean == pytest.approx(expected) and found.mean == pytest.approx(same.mean)
    assert (axle_load(recording, passage, made, settings) is not None) == is_calibrated


def test_too_few_trains_of_known_weight_give_no_calibration(turnout):
    config, raw, settings = turnout
    trains = weighed_trains(config, raw, PATTERNS, settings, max_trains=4)
    assert len(trains) == 4
    assert learn_loads(config, trains, replace(settings, assets=str(raw / "none"))) == {}
    assert not (raw / "none").exists()


def test_a_train_below_the_noise_does_not_change_the_gain():
    """For slow trains v² w'' is below the noise. Their axles disagree, so they are left out or have a low weight."""
    rng = np.random.default_rng(33)
    speeds, loads = np.repeat([12.0, 25.0, 40.0], 10), rng.uniform(10, 20, 30)
    axles = [0.01 * p * v**2 + 40.0 * rng.standard_normal(8) for p, v in zip(loads, speeds)]
    mean, se = np.transpose([train_amplitude(a) for a in axles])
    found = calibrate(mean, loads, speeds, 5, se)
    assert found.n < 30 and found.slowest == 25.0
    gain = found.log_gain - found.exponent * np.log(found.speed)
    error = np.array([1.0, -np.log(found.speed)])
    assert found.exponent == pytest.approx(2.0, abs=4 * np.sqrt(found.covariance[1, 1]))
    assert np.exp(gain + (found.exponent - 2) * np.log(30.0)) == pytest.approx(0.01, rel=0.05)
    assert error @ found.covariance @ error > 0


@pytest.mark.parametrize("common, own", [(0.05, 0.005), (0.0, 0.05), (0.03, 0.03)])
def test_the_stated_error_of_a_load_includes_an_error_common_to_all_sensors(common, own, monkeypatch):
    """Nine sensors, thirty trains on file, 200 more to be weighed: the stated error is the actual one. Thirty
    trains determine the scatter to an eighth, 200 loads to a twentieth."""
    rng, names = np.random.default_rng(34), [f"c{k}" for k in range(9)]
    monkeypatch.setattr("turnout.passage.axle_load.quasi_static", lambda own_, *_: own_ * np.array([1.001, 0.999] * 6))
    settings = PassageSettings(load_relative_error_maximum=1.0)

    def train(load, speed):
        shared = common * rng.standard_normal()
        amplitudes = {n: load * (speed / 35.0) ** 2 * np.exp(shared + own * rng.standard_normal()) for n in names}
        return {"load": load, "speed": speed, "amplitudes": {n: (a, 1e-4 * a) for n, a in amplitudes.items()}}

    off = []
    for _ in range(200):
        trains = [train(rng.uniform(8, 22), rng.uniform(25, 45)) for _ in range(30)]
        columns = [[t[key] for t in trains] for key in ("load", "speed")]
        made = {n: calibrate([t["amplitudes"][n][0] for t in trains], *columns) for n in names}
        amplitudes = {n: a for n, (a, _) in train(15.0, 33.0)["amplitudes"].items()}
        recording = SimpleNamespace(channels=[SimpleNamespace(name=n, position=0.0) for n in names],
                                    signal=amplitudes.get, rate=1.0)  # fmt: skip
        passage = Passage("accepted", (), Motion(33.0), at_sensor=dict.fromkeys(names))
        found = axle_load(recording, passage, with_error_correlation(made, trains), settings)
        off.append((found.mean - 15.0) / found.se)
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.25


def weigh(monkeypatch, trains, amplitudes, speed=33.0, speed_se=1e-5):
    """Load from ``amplitudes`` (channel -> mean) of the train to be weighed, calibrated on ``trains``; any error."""
    monkeypatch.setattr("turnout.passage.axle_load.quasi_static", lambda own, *_: own * np.array([1.0001, 0.9999] * 6))
    columns = [[t[key] for t in trains] for key in ("load", "speed")]
    made = {n: calibrate([t["amplitudes"][n][0] for t in trains], *columns) for n in amplitudes}
    channels = [SimpleNamespace(name=n, position=0.0) for n in amplitudes]
    recording = SimpleNamespace(channels=channels, signal=amplitudes.get, rate=1.0)
    finding = SpeedFinding(speed, speed_se, 0.0, 0.0, "sensors")
    passage = Passage("accepted", (), Motion(speed), finding, at_sensor=dict.fromkeys(amplitudes))
    calibrations = with_error_correlation(made, trains)
    return axle_load(recording, passage, calibrations, PassageSettings(load_relative_error_maximum=1.0))


@pytest.mark.parametrize("n_trains", [5, 8, 20])
def test_the_interval_of_a_load_holds_the_truth_also_with_few_trains_of_known_weight(n_trains, monkeypatch):
    """One sensor, trains that scatter by 3 %: a t distribution with ``n_trains`` - 2 degrees of freedom."""
    rng, covered = np.random.default_rng([35, n_trains]), 0

    def train(load, speed):
        amplitude = load * (speed / 35.0) ** 2 * np.exp(0.03 * rng.standard_normal())
        return {"load": load, "speed": speed, "amplitudes": {"c": (amplitude, 1e-4 * amplitude)}}

    for _ in range(400):
        trains = [train(rng.uniform(8, 22), rng.uniform(25, 45)) for _ in range(n_trains)]
        found = weigh(monkeypatch, trains, {"c": train(15.0, 33.0)["amplitudes"]["c"][0]})
        covered += abs(np.log(found.mean / 15.0)) < 1.96 * found.se / found.mean
    low, high = stats.binom.ppf([0.001, 0.999], 400, 0.95)
    assert low <= covered <= high


@pytest.mark.parametrize("n_sensors", [2, 3, 6])
@pytest.mark.parametrize("gain", [0.8, 1.1, 1.3])
def test_a_gain_that_changed_after_the_calibration_is_within_the_stated_error(n_sensors, gain, monkeypatch):
    """Exact trains: the mean of n logarithms is ln(gain) / n off, and so is the error that their differences show."""
    names = [f"c{k}" for k in range(n_sensors)]
    trains = [
        {"load": p, "speed": v, "amplitudes": {n: (p * (v / 35.0) ** 2, 0.0) for n in names}}
        for p, v in zip(np.linspace(8, 22, 12), [25, 45, 30, 40] * 3)
    ]
    own = {n: 15.0 * (33.0 / 35.0) ** 2 * (gain if n == "c0" else 1.0) for n in names}
    found = weigh(monkeypatch, trains, own)
    assert np.log(found.mean / 15.0) == pytest.approx(np.log(gain) / n_sensors, rel=1e-6)
    assert found.se / found.mean == pytest.approx(abs(np.log(gain)) / n_sensors, rel=1e-6)


@pytest.mark.parametrize("n_sensors", [1, 4])
@pytest.mark.parametrize("speed_error", [0.01, 0.16])
def test_the_interval_of_a_load_includes_the_error_of_the_speed(speed_error, n_sensors, monkeypatch):
    """A train of unknown type at one sensor has a speed to one sixth: its load has an error of a third."""
    rng, names, covered = np.random.default_rng([36, n_sensors]), [f"c{k}" for k in range(n_sensors)], 0
    trains = [
        {"load": p, "speed": v, "amplitudes": {n: (p * (v / 35.0) ** 2 * (1 + 1e-3 * (-1) ** k), 0.0) for n in names}}
        for k, (p, v) in enumerate(zip(np.linspace(8, 22, 12), [25, 45, 30, 40] * 3))
    ]
    amplitudes = {n: 15.0 * (33.0 / 35.0) ** 2 for n in names}
    for _ in range(200):
        speed = 33.0 * np.exp(speed_error * rng.standard_normal())
        found = weigh(monkeypatch, trains, amplitudes, float(np.clip(speed, 21.0, 55.0)), speed_error * speed)
        covered += abs(np.log(found.mean / 15.0)) < 1.96 * found.se / found.mean
    low, high = stats.binom.ppf([0.001, 0.999], 200, 0.95)
    assert low <= covered <= high


def test_the_load_of_an_unknown_train_at_one_sensor_is_unavailable(turnout):
    """Only its bogies show its speed, to one sixth. The load was given 5 to 50 % off, with an error of 2 %."""
    config, raw, settings = turnout
    known = learn_loads(config, weighed_trains(config, raw, PATTERNS, settings), settings)
    recording = weighed(np.random.default_rng(33), 14.5, 36.0)
    lone = replace(recording, samples=recording.samples[3:4], channels=recording.channels[3:4])
    passage = analyse(lone, sensors_for(lone), (), settings)
    assert (passage.speed.source, passage.n_axle) == ("bogie", 8)
    assert axle_load(lone, passage, known, settings) is None


def _speed_and_load(rng, fast):
    centre, spread = ((160.0, 12.0) if fast else (80.0, 14.0)), (3.0, 0.2)
    return [float(c + s * rng.standard_normal()) for c, s in zip(centre, spread)]


def connection_of(rng, n):
    con = duckdb.connect()
    con.execute(
        "create table passages_current (passage_id varchar, passed_at_utc timestamp, status varchar, "
        "train_type varchar, speed_kmh double, axle_load_t double, turnout_id varchar, direction varchar, "
        "track varchar)"
    )
    for name in ("passage_trains", "trains_current"):
        con.execute(view_files()[name])
    for k in range(n):
        fast = k % 2 == 0
        con.execute(
            "insert into passages_current values (?, ?, 'accepted', 'IC3', ?, ?, 'T1', 'facing', 'main')",
            [str(k), datetime(2024, 1, 1) + timedelta(hours=k), *_speed_and_load(rng, fast)],
        )
    return con


def test_clusters_come_from_the_registry_and_keep_their_ids_when_nights_are_added(tmp_path, settings):
    rng, here = np.random.default_rng(34), replace(settings, assets=str(tmp_path))
    first = learn_clusters(connection_of(rng, 120), here)
    assert first.version == 1 and len(first.clusters) == 2
    again = learn_clusters(connection_of(rng, 140), here)
    assert again.version == 2 and read_clusters(tmp_path / "clusters.json").version == 2
    for speed, load in ((160.0, 12.0), (80.0, 14.0)):
        assert first.assign("IC3", speed, load) == again.assign("IC3", speed, load) is not None


def test_the_command_prints_calibration_and_clusters(turnout, tmp_path, monkeypatch, repository, capsys):
    _, raw, _ = turnout
    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "turnout.registry.database.open_registry", lambda path: connection_of(np.random.default_rng(1), 60)
    )
    assert main(["trains", "--turnouts", "tommerup_s1", "--raw", str(raw)]) == 0
    output = capsys.readouterr().out
    assert "tommerup_s1: 8 trains of known weight, 10.0 to 22.0 t per axle" in output
    assert re.search(
        r" trains scatter by [\d.]+ % \(sd\) beyond their own errors, amplitude with speed to the power", output
    )
    assert "clusters, version 1:" in output
    assert json.loads((tmp_path / "config" / "passages" / "loads.json").read_text())["tommerup_s1"]
    assert main(["trains", "--turnouts", "tommerup_s1", "--raw", str(raw), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert {(r["channel"], r["n"], *r["train_types"]) for r in result["loads"]} == {(n, 8, "IC3") for n in PLACES}
    assert [set(c) for c in result["clusters"]] == 2 * [{"cluster_id", "speed_kmh", "axle_load_t", "n"}]


def test_without_a_registry_nothing_is_calibrated(turnout, tmp_path, monkeypatch, repository, capsys):
    """Formerly the loads were calibrated and stored, and the command said that it was not done."""
    _, raw, _ = turnout
    shutil.copytree(repository / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    assert main(["trains", "--turnouts", "tommerup_s1", "--raw", str(raw)]) == 2
    printed = capsys.readouterr()
    assert "there is no registry here" in printed.err and not printed.out
    assert not (tmp_path / "config" / "passages" / "loads.json").exists()


def test_a_number_of_the_train_data_that_is_none_is_named_with_its_column():
    rows = [{"passed_at_utc": "2024-05-13T10:00:00Z", "axle_load_t": text} for text in ("heavy", "1_2", "12.5")]
    trains, errors = listed_trains(rows)
    assert [t.axle_load for t in trains] == [12.5]
    assert errors == ("row 1: axle_load_t 'heavy' is not a number", "row 2: axle_load_t '1_2' is not a number")
