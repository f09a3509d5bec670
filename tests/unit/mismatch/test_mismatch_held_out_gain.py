"""The standard error of the gain of a name on held-out recordings, against the scatter of many draws."""

import numpy as np
import pytest

from turnout.mismatch.engine.fit_quality import fit_percent, gain_error
from turnout.mismatch.engine.observation import Observation

STRETCH = 40  # samples over which the noise of a draw is correlated


def draw(rng):
    """Two recordings of unequal length, noise that is correlated over short stretches, and predictions by two
    models."""
    found = []
    for n, level in ((6000, 1.0), (4000, 0.6)):
        t = np.arange(n) / 500.0
        truth = level * (np.sin(9.0 * t) + 0.4 * np.sin(23.0 * t + 1.0))
        noise = 0.7 * np.repeat(rng.normal(size=n // STRETCH), STRETCH)
        found.append((Observation("a", "a", truth + noise, 0.5), 0.6 * truth, 0.9 * truth))
    return zip(*found)


def test_the_stated_error_is_the_scatter_of_the_gain():
    """400 draws determine a standard deviation to 3.5 %, 25 stretches of a recording to about 15 %."""
    rng, gains, stated = np.random.default_rng(3), [], []
    for _ in range(400):
        observations, before, after = draw(rng)
        gains.append(fit_percent(observations, after) - fit_percent(observations, before))
        stated.append(gain_error(observations, before, after))
    assert np.median(stated) == pytest.approx(np.std(gains), rel=0.2)


def test_sensors_with_equal_errors_are_not_independent():
    """Four sensors under one train have the same error: the gain scatters as that of one sensor. Half of the error
    would be stated if each sensor were an observation of its own."""
    rng, gains, stated, apart = np.random.default_rng(6), [], [], []
    for _ in range(400):
        observations, before, after = draw(rng)
        data, before, after = (np.tile(x[0], 4) for x in ([observations[0].data], before, after))
        together = Observation("a", "a", data, 0.5, rows=4)
        gains.append(fit_percent([together], [after]) - fit_percent([together], [before]))
        stated.append(gain_error([together], [before], [after]))
        apart.append(gain_error([Observation("a", "a", data, 0.5)], [before], [after]))
    assert np.median(stated) == pytest.approx(np.std(gains), rel=0.2)
    assert np.median(apart) < 0.7 * np.std(gains)


def test_models_with_equal_predictions_have_a_gain_of_0():
    observations, before, _ = draw(np.random.default_rng(4))
    assert gain_error(observations, before, before) == 0.0


def test_noise_that_no_model_predicts_is_not_part_of_the_error_of_the_gain():
    """Three times the noise makes each fit uncertain. The gain of two models that differ in one stretch has the error
    of one stretch among fifty."""
    observations, before, _ = (list(x) for x in draw(np.random.default_rng(5)))
    after = [p.copy() for p in before]
    after[0][:240] = observations[0].data[:240]
    gain = fit_percent(observations, after) - fit_percent(observations, before)
    assert gain_error(observations, before, after) == pytest.approx(gain, rel=0.1)
