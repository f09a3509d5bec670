"""Axle times of 15 trains at two places near Bern (SBB; Scossa-Romano and Oertli 2016): counted, timed and named.

The vehicles whose dimensions no type sheet gives were measured on passages 0, 5 and 9 (config/vehicles/
axle_patterns.yaml says which); the other 24 records are new to the templates.
"""

import json

import numpy as np
import pytest
from ruamel.yaml import YAML

from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.axle_patterns import read_patterns
from turnout.passage.result import PassageSensor
from turnout.passage.train_type import find_type
from turnout.records import Channel, Recording

CASES = [(str(k), place) for k in range(15) for place in ("Q1", "Q4")]
RATE = 20000.0


@pytest.fixture(scope="module")
def trains(shared_data):
    path = shared_data / "track_sbb_niederwangen" / "results.json"
    if not path.exists():
        pytest.skip("axle times of Niederwangen are not there")
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def patterns(repository):
    return read_patterns(YAML(typ="safe").load(repository / "config" / "vehicles" / "axle_patterns.yaml"))


@pytest.mark.parametrize("train, place", CASES)
def test_type_and_speed_follow_from_the_axle_times(trains, patterns, train, place):
    """The type is recognized; the mean speed is within 0.7 km/h of the published one, which assumes bogies of 2.5 m."""
    times = np.array(trains[train][place]["tPeaks"])
    found = find_type(times, patterns, PassageSettings())
    assert found.type == trains[train]["Zugstyp"]
    assert found.probability > 0.99
    middle = found.speed + found.acceleration * (times[-1] - times[0]) / 2
    assert 3.6 * middle == pytest.approx(trains[train][place]["vAv"], abs=0.7)
    # errors of wheels, coupler slack and timing together: with a larger misfit it would be another train
    assert found.residual < 0.05


@pytest.mark.parametrize("train, place", [("3", "Q1"), ("13", "Q4"), ("0", "Q1")])
def test_axles_are_counted_in_noise_bursts_at_the_published_times(trains, patterns, train, place):
    """No raw signals are public: bursts of noise at the measured times replace them; one sensor, unknown speed."""
    recording = bursts(trains[train][place], np.random.default_rng(int(train)))
    sensor = [PassageSensor("rail", "S", 0.0)]
    passage = analyse(recording, sensor, patterns, PassageSettings())
    assert passage.n_axle == trains[train]["axleN"]
    assert passage.type.type == trains[train]["Zugstyp"]


def bursts(train, rng) -> Recording:
    """Noise whose power rises and falls around every axle time as it does for a wheel: e-folding in 0.4 m."""
    times = np.array(train["tPeaks"])
    times = times - times[0] + 1.0
    time = np.arange(int((times[-1] + 1.0) * RATE)) / RATE
    power = np.zeros_like(time)
    for t in times:
        power += np.exp(-np.abs(time - t) * (train["vAv"] / 3.6) / 0.4)
    samples = np.sqrt(power) * rng.standard_normal(time.size) + 0.02 * rng.standard_normal(time.size)
    return Recording(samples[None], RATE, (Channel("rail", "acceleration", 0.0),), "passage")
