"""A sensor whose gain is wrong, by a range or a unit in the layout, beside sensors that are right."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, rolling_noise, sensors_for

from turnout.passage.analysis import analyse


@pytest.mark.parametrize("gain", [20.0, -20.0, 0.05])
@pytest.mark.parametrize("positions", [(0.0, 9.0), (-4.0, 6.0, 15.0), (-10.0, 0.0, 8.0, 21.0)])
def test_a_wrong_gain_of_one_sensor_leaves_no_sensor_out(positions, gain, settings):
    """Direction and speed need two sensors. The others seemed to be those of the neighbouring track."""
    recording = rolling_noise(np.random.default_rng(4), IC3, 25.0, positions, -1)
    samples = recording.samples.copy()
    samples[0] *= gain
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    assert (passage.n_axle, passage.direction, len(passage.at_sensor)) == (8, "trailing", len(positions))
    assert passage.status == "accepted"


@pytest.mark.parametrize("train_is_on", ["main", "diverging"])
def test_sensors_of_the_other_track_are_left_out_by_the_layout(train_is_on, settings):
    """Two sensors at each track; those of the other one record a twentieth, and as much over their quiet level."""
    tracks = ("main", "diverging", "main", "diverging")
    recording = rolling_noise(np.random.default_rng(5), IC3, 25.0, (0.0, 1.0, 9.0, 10.0))
    samples = recording.samples * np.array([[1.0 if t == train_is_on else 0.05] for t in tracks])
    sensors = [replace(s, track=t) for s, t in zip(sensors_for(recording), tracks)]
    passage = analyse(replace(recording, samples=samples), sensors, PATTERNS, settings)
    assert passage.track == train_is_on and passage.n_axle == 8
    assert list(passage.at_sensor) == [s.name for s in sensors if s.track == train_is_on]


@pytest.mark.parametrize("gain", [10.0, 30.0])
@pytest.mark.parametrize("train_is_on", ["main", "diverging"])
def test_the_gain_of_one_sensor_does_not_move_the_train_to_its_track(train_is_on, gain, settings):
    """Three sensors at each track; the other one records a twentieth. Formerly the loudest sensor decided."""
    tracks = ("main", "diverging") * 3
    recording = rolling_noise(np.random.default_rng(6), IC3, 25.0, (0.0, 1.0, 9.0, 10.0, 18.0, 19.0))
    samples = recording.samples * np.array([[1.0 if t == train_is_on else 0.05] for t in tracks])
    samples[tracks.index("diverging" if train_is_on == "main" else "main")] *= gain
    sensors = [replace(s, track=t) for s, t in zip(sensors_for(recording), tracks)]
    passage = analyse(replace(recording, samples=samples), sensors, PATTERNS, settings)
    assert (passage.track, passage.n_axle) == (train_is_on, 8)
    assert {s.name for s in sensors if s.track == train_is_on} <= set(passage.at_sensor)
