"""Sensors with names of which one is part of the other: a finding concerns the sensor that it names, and no other."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, RATE, impact_train, paper_model, rolling_noise, sensors_for

from turnout.config import load_configuration, with_raw
from turnout.errors import CHANNEL_REASONS
from turnout.passage.analysis import analyse
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.stages.passage import PassageContext, SectionModel, passage_unit
from turnout.workflow.scan import scan

SIMILAR_NAMES = [("S1", "S12"), ("A", "A7")]
FORMER_NAMES = ("A7", "A8")
POSITIONS = {"OT": -12.0, "SP": 3.6, "A7": 24.6, "A8": 26.4}
LOCATIONS = ("OT", "SP", "CP A7", "CP A8")
LOST_AT = 2.6  # s, about halfway through the train


def renamed(turnout, names):
    """The configuration with the sensors A7 and A8 under other ``names``."""
    new = dict(zip(FORMER_NAMES, names))
    description = turnout.passages.description
    channels = tuple(
        replace(c, name=new.get(c.name, c.name), source=new.get(c.source, c.source)) for c in description.channels
    )
    sections = {new.get(name, name): label for name, label in turnout.passages.sections.items()}
    passages = replace(turnout.passages, description=replace(description, channels=channels), sections=sections)
    return replace(turnout, passages=passages)


def rows_of(raw, repository, monkeypatch, names, change):
    """Rows of a passage of which only four sensors of the configuration recorded something."""
    monkeypatch.chdir(repository)
    configured = with_raw(load_configuration("config").turnout("tommerup_s1"), raw)
    rng = np.random.default_rng(1)
    recording, _ = impact_train(rng, LOCATIONS, list(POSITIONS.values()))
    labels = [dict(zip(FORMER_NAMES, names)).get(name, name) for name in POSITIONS]
    samples, turnout = recording.samples.copy(), renamed(configured, names)
    change(dict(zip(labels, samples)))
    silent = [c.name for c in turnout.passages.description.channels if c.name not in labels]
    samples = np.vstack([samples, 1e-3 * rng.standard_normal((len(silent), samples.shape[1]))])
    channels = tuple(Channel(name, "acceleration") for name in (*labels, *silent))
    folder = raw / "tommerup_s1" / "passages"
    folder.mkdir(parents=True)
    recording = replace(recording, samples=samples, channels=channels, started_at=datetime(2024, 5, 13, 10))
    write([recording], folder / "20240513T100000Z.h5", "hdf5")
    models = {
        label: (SectionModel(f"model-{label}", datetime(2024, 1, 1), paper_model(f"CP {label}")),)
        for label in FORMER_NAMES
    }
    return passage_unit(scan(configured, raw).units[0], turnout, raw, PassageContext(models, PATTERNS))


def lose_signal(samples, time=LOST_AT):
    samples[int(time * RATE) :] = 0.125


@pytest.mark.parametrize("names", SIMILAR_NAMES)
def test_a_lost_sensor_takes_no_wheels_from_a_sensor_with_a_similar_name(names, tmp_path, repository, monkeypatch):
    intact, lost = names
    rows = rows_of(tmp_path, repository, monkeypatch, names, lambda signals: lose_signal(signals[lost]))
    n_wheels = {fit["channel"]: fit["n_wheels"] for fit in rows["passage_fits"]}
    assert n_wheels[intact] == len(IC3) and 2 <= n_wheels[lost] < len(IC3)
    assert [(q["reason_code"], q["place"]) for q in rows["quarantine"]] == [("sensor_lost", f"record 1, {lost}")]


@pytest.mark.parametrize("names", SIMILAR_NAMES)
def test_a_clipped_sensor_is_not_fitted_if_one_with_a_similar_name_is_lost(names, tmp_path, repository, monkeypatch):
    clipped, lost = names

    def clip_and_lose(signals):
        np.clip(signals[clipped], -1.0, 1.0, out=signals[clipped])
        lose_signal(signals[lost])

    rows = rows_of(tmp_path, repository, monkeypatch, names, clip_and_lose)
    fits = {fit["channel"]: (fit["status"], fit["n_wheels"]) for fit in rows["passage_fits"]}
    assert fits[clipped] == ("rejected", 0) and fits[lost][1] >= 2
    reasons = {q["place"]: q["reason_code"] for q in rows["quarantine"]}
    assert reasons == {f"record 1, {clipped}": "clipped", f"record 1, {lost}": "sensor_lost"}


@pytest.mark.parametrize("names", SIMILAR_NAMES)
def test_two_exchanged_sensors_are_both_left_out_and_neither_is_called_lost(names, settings):
    """At its configured position the front sensor records the train too early, and nothing afterwards."""
    recording = rolling_noise(np.random.default_rng(16), IC3, 40.0, (0.0, 4.0, 9.0, 21.7, 30.0))
    labels = ("front", names[0], "middle", names[1], "rear")
    channels = tuple(replace(c, name=label) for c, label in zip(recording.channels, labels))
    recording = replace(recording, samples=recording.samples[[0, 3, 2, 1, 4]], channels=channels)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert [(f.reason, f.channels) for f in passage.findings] == [("channels_swapped", names)]
    assert set(passage.audible_sensors) == {"front", "middle", "rear"} and passage.n_axle == len(IC3)


def test_every_finding_about_a_channel_names_one_of_the_recording(settings):
    recording = rolling_noise(np.random.default_rng(15), IC3, 40.0, (0.0, 3.0, 6.0, 9.0, 12.0))
    samples = recording.samples.copy()
    np.clip(samples[1], -1.0, 1.0, out=samples[1])
    samples[2] = 0.0
    lose_signal(samples[3], 1.9)
    samples[4, 777] = np.nan
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    findings = {f.channel: (f.reason, f.time) for f in passage.findings if f.reason in CHANNEL_REASONS}
    assert len(findings) == len(passage.findings) == 4
    assert findings["c1"] == ("clipped", None) and findings["c2"] == ("dead_channel", None)
    assert findings["c3"] == ("sensor_lost", pytest.approx(1.9, abs=0.01))
    assert findings["c4"] == ("not_finite", pytest.approx(777 / RATE))
