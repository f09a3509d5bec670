"""Impacts and trains of one day are simulated on the same track, with the changes of all of its sections."""

import datetime

import numpy as np
import pytest

from turnout.demo.fleet import FLEET
from turnout.demo.hammer import N_SAMPLES, RATE, response_at
from turnout.demo.track_state import track_on, unloaded_track_on, with_stiffness
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.parameters import load_track
from turnout.simulate.turnout_track import stretch_of_track

SCENARIOS = {scenario.turnout: scenario for scenario in FLEET}
LAST_DAY, WARM = datetime.date(2026, 7, 25), 15.0


class _NoScatter:
    def standard_normal(self):
        return 0.0


def test_soft_ballast_of_one_section_changes_the_receptance_of_the_next():
    """A8 begins 0.6 m behind A7; its ballast has lost 18 % in 450 days at 15 % a year: 0.85 ** 1.232."""
    as_built = load_track("tommerup")
    soft = unloaded_track_on(SCENARIOS["tommerup_s2"], LAST_DAY, WARM)
    scale = SCENARIOS["tommerup_s2"].stiffness
    ratio = soft.track.ballast_stiffness / as_built.track.ballast_stiffness / scale
    is_a8 = np.array(as_built.track.section) == "A8"
    assert ratio[is_a8] == pytest.approx(0.85 ** ((LAST_DAY - datetime.date(2025, 5, 1)).days / 365.25))
    assert ratio[~is_a8] == pytest.approx(1.0)
    stretch = stretch_of_track(soft.track, 24.6, 18.0)
    frequency = np.fft.rfftfreq(N_SAMPLES, 1 / RATE)
    lines = (frequency > 100) & (frequency < 250)
    recorded = np.fft.rfft(response_at("A7", soft)(_NoScatter()))[lines] / RATE / -((2 * np.pi * frequency[lines]) ** 2)
    expected = receptance(assemble(stretch), frequency[lines], 24.6, 24.6)
    np.testing.assert_allclose(recorded, expected, rtol=1e-9)
    alone = receptance(assemble(stretch_of_track(with_stiffness(as_built, lambda _: (scale, scale)).track, 24.6, 18.0)),
                       frequency[lines], 24.6, 24.6)  # fmt: skip
    assert np.max(np.abs(expected / alone - 1)) > 0.1


def test_a_hanging_sleeper_has_ballast_contact_only_under_trains():
    scenario = SCENARIOS["aarup_n4"]
    loaded, unloaded = track_on(scenario, LAST_DAY, WARM), unloaded_track_on(scenario, LAST_DAY, WARM)
    position, route = loaded.locations["ASM"]
    track = loaded.track_of(route)
    k = track.nearest_support(position)
    assert track.ballast_stiffness[k] > 0 and track.ballast_damping[k] > 0
    bare = unloaded.track_of(route)
    assert bare.ballast_stiffness[k] == bare.ballast_damping[k] == 0
    others = np.arange(track.support.size) != k
    np.testing.assert_array_equal(bare.ballast_stiffness[others], track.ballast_stiffness[others])
    np.testing.assert_array_equal(bare.pad_stiffness, track.pad_stiffness)
