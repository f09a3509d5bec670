"""Ceilings of channels: peaks that follow the trains, peaks that stay, peaks of which only the loud ones stay."""

import numpy as np

from turnout.mismatch.track.ceiling import FLOOR, saturation

LOUD = np.log([40.0, 55.0, 70.0, 100.0, 140.0, 200.0])
SCATTER = 0.1 * np.array([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])


def test_peaks_that_stay_gain_the_logarithm_of_the_scatter_they_lack():
    gain = saturation(np.full(6, np.log(8.0)), LOUD)
    assert np.isclose(gain, 3.0 * np.log(1.0 + np.var(LOUD) / FLOOR**2) - 0.5 * np.log(6.0), rtol=1e-12)


def test_peaks_that_follow_the_trains_gain_nothing():
    assert saturation(LOUD - 0.7 + SCATTER, LOUD) < 2.0


def test_only_the_loud_passages_may_reach_the_ceiling():
    peaks = np.minimum(np.log(90.0), LOUD + 0.01 * SCATTER)
    assert saturation(peaks, LOUD) > 12.0
    # the quiet ones alone are at no ceiling; whatever is flat gains something over what follows
    assert saturation(peaks[::-1], LOUD) < 0.5 * saturation(peaks, LOUD)
