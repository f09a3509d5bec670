"""The receptance of the impacts of the demonstration fleet is that of the simulated track."""

import datetime

import numpy as np
import pytest

from turnout.demo.hammer import RATE, hammer_test, simulated_response
from turnout.simulate.frequency_response import receptance
from turnout.simulate.hammer import resolve_location
from turnout.simulate.matrices import assemble
from turnout.simulate.parameters import load_track
from turnout.simulate.turnout_track import stretch_of_track


@pytest.mark.parametrize("section", ["A8", "SP"])
def test_the_receptance_of_the_recordings_equals_that_of_the_track(section):
    """Below the resonances, too, where a response that is cut at the impact would resemble that of a free mass."""
    impacts, truth = hammer_test(
        simulated_response(section, 1.0, 1.0), 10.0, datetime.date(2025, 1, 1), 1, np.random.default_rng(1), 60
    )
    sound = [b.samples for b, t in zip(impacts, truth) if not t.fault]
    frequency = np.fft.rfftfreq(sound[0].shape[1], 1 / RATE)
    lines = (frequency > 30) & (frequency < 700)
    force, rail = np.fft.rfft(np.array(sound), axis=2).transpose(1, 0, 2)[:, :, lines]
    recorded = -np.sum(rail * force.conj(), axis=0) / np.sum(np.abs(force) ** 2, axis=0)
    recorded /= (2 * np.pi * frequency[lines]) ** 2
    place, track = resolve_location(load_track("tommerup"), section)
    stretch = stretch_of_track(track, place, 18.0)
    place = float(stretch.support[stretch.nearest_support(place)])
    expected = receptance(assemble(stretch), frequency[lines], place, place)
    # Noise of 1 % of the peak is the larger part at 33 Hz; impacts differ by 0.6 % in frequency.
    assert np.median(np.abs(recorded / expected - 1)) < 0.05
    assert np.max(np.abs(recorded / expected - 1)) < 0.4
