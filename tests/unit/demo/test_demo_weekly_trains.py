"""The weekly trains of the demonstration equal direct simulations and run on the days of a timetable."""

import json
from collections import Counter
from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from scipy import signal

import turnout
from turnout.demo import weekly_trains
from turnout.demo.scenario import MILLIMETRE, TurnoutScenario, WornWeld
from turnout.demo.train_clusters import write_clusters
from turnout.demo.weekly_trains import KINDS, RUNS, TrainKind, simulate_run, timetable, weekly_jobs, write_weekly_trains

POSITIONS = {"A7": (24.6, "main"), "ASM": (36.0, "main"), "ASD": (36.0, "diverging")}
WELD = WornWeld("ASM", 36.3, date(2026, 4, 1), 0.4 * MILLIMETRE, 0.0)
SCENARIO = TurnoutScenario("tommerup_s2", "tdms", weld=WELD)


def test_every_week_has_five_trains_on_the_main_track():
    trains = timetable(date(2025, 3, 22), 70)
    weeks = Counter(day.isocalendar()[:2] for day, kind in trains if kind.track == "main")
    assert len(weeks) == 70 and set(weeks.values()) == {5}
    assert sum(kind.track == "diverging" for _, kind in trains) == 17
    fast = [kind for _, kind in trains if (kind.name, kind.speed_kmh) == ("IC3", 160.0)]
    assert len(fast) == 175  # Monday, Friday and every second Wednesday


@pytest.fixture(scope="module")
def runs():
    """The locomotive as simulated; the recordings of the other trains are zero."""
    jobs = weekly_jobs(SCENARIO, POSITIONS, date(2026, 7, 25), 70)
    chosen = [job for job in jobs if job[2].vehicle == "locomotive"]
    simulated = {job[3]: simulate_run(job) for job in chosen}
    silent = np.zeros((3, 400), dtype=np.float32)
    return simulated, [simulated[job[3]] if job[2].vehicle == "locomotive" else silent for job in jobs]


def test_a_dip_changes_the_recording_of_its_section_and_not_that_ten_metres_away(runs):
    simulated, _ = runs
    band = signal.butter(4, [80.0, 800.0], "bandpass", fs=10e3, output="sos")
    peak = {name: np.abs(signal.sosfilt(band, samples)).max(axis=1) for name, samples in simulated.items()}
    assert peak["dip"][1] > 1.15 * peak["light"][1]
    assert peak["dip"][0] == pytest.approx(peak["light"][0], rel=0.02)
    assert peak["light"][2] == pytest.approx(0.02 * peak["light"][1], rel=0.6)  # crosstalk from the other track


def test_recordings_are_the_simulated_train_and_noise(runs, tmp_path, monkeypatch):
    """At the speed of the timetable, with the smaller load, before the weld dips: the simulated train itself."""
    simulated, all_runs = runs
    monkeypatch.setattr(weekly_trains, "WEEKDAYS", ((4,),))
    monkeypatch.setattr(weekly_trains, "SPEED_SPREAD", 0.0)
    truths = write_weekly_trains(tmp_path, SCENARIO, POSITIONS, all_runs, 1, date(2025, 3, 31), 1)
    assert len(truths) == 1 and truths[0]["dip_m"] == 0.0 and truths[0]["n_axles"] == 4
    recording = turnout.read(tmp_path / "tommerup_s2/passages" / truths[0]["file"])[0]
    assert recording.rate == 5000.0 and recording.conditions["rail_temperature"] == pytest.approx(
        truths[0]["rail_temperature_c"], abs=0.05
    )
    share = truths[0]["load_share"]
    expected = simulated["light"] + share * (simulated["loaded"] - simulated["light"])
    at = recording.samples.shape[1]
    difference = recording.samples - expected[:, : 2 * at : 2]
    assert np.std(difference) == pytest.approx(0.3, rel=0.1)  # the noise
    wide = write_weekly_trains(tmp_path / "b", SCENARIO, POSITIONS, all_runs, 1, date(2026, 7, 25), 1)
    assert wide[0]["dip_m"] == pytest.approx(0.4e-3)


def test_trains_of_the_timetable_form_clusters(tmp_path, repository, monkeypatch):
    monkeypatch.chdir(tmp_path)
    silent = [np.zeros((3, 400), dtype=np.float32)] * (len(KINDS) * len(RUNS))
    write_weekly_trains(tmp_path / "raw", SCENARIO, POSITIONS, silent, 1, date(2026, 7, 25), 20)
    clusters = write_clusters(tmp_path / "raw", repository / "config")
    speeds = {c.id: float(np.exp(c.mean[0])) for c in clusters.clusters if c.type == "IC3"}
    assert any(abs(v - 160) < 3 for v in speeds.values()) and any(abs(v - 60) < 3 for v in speeds.values())
    stored = json.loads((tmp_path / "config/passages/clusters.json").read_text())
    assert len(stored["clusters"]) == len(clusters.clusters)


def test_the_kinds_of_trains_are_those_of_the_templates():
    assert {replace(kind, speed_kmh=1.0, track="main") for kind in KINDS} == {
        TrainKind("ic3", "IC3", 1.0), TrainKind("intercity", "intercity", 1.0),
        TrainKind("locomotive", "locomotive", 1.0),
    }  # fmt: skip
