"""Sampling rates at which the bins of the envelope are no whole milliseconds."""

import benchmarks.passage_truth as truth
import numpy as np
import pytest

from turnout.passage.analysis import analyse

PLACES = (0.0, 4.0, 9.0, 15.0)


@pytest.mark.parametrize("rate", [51200.0, 44100.0, 25600.0, 12800.0, 10240.0, 2048.0, 500.0])
def test_speed_and_axle_times_do_not_depend_on_the_rate(rate, settings, monkeypatch):
    """40 m/s, the first axle at the first sensor after two seconds: five errors, and 10 ms or 0.4 m at every axle."""
    monkeypatch.setattr(truth, "RATE", rate)
    recording = truth.rolling_noise(np.random.default_rng(1), truth.IC3, 40.0, PLACES, lead=2.0)
    passage = analyse(recording, truth.sensors_for(recording), truth.PATTERNS, settings)
    assert passage.n_axle == 8 and passage.type.type == "IC3"
    assert passage.speed.speed == pytest.approx(40.0, abs=5.0 * passage.speed.se)
    expected = truth.passing_times(truth.IC3, PLACES, 40.0, 0.0, 1, 2.0)
    for row, name in zip(expected, ("c0", "c1", "c2", "c3")):
        np.testing.assert_allclose(passage.at_sensor[name], row, atol=0.01)
