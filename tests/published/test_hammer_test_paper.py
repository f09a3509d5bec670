"""Hammer tests computed from the paper's Tables 1 and 2, at its eight locations."""

import numpy as np
import pytest
from benchmarks.published import synthetic, tables

from turnout.hammer_test import bands_passed, find_impacts, receptance_of
from turnout.records import Channel, Recording

CHANNELS = Channel("hammer", "force"), Channel("rail", "acceleration", mounting="rail head at sleeper")


def recordings_of(test):
    pairs = zip(test.force, test.acceleration)
    return [Recording(np.stack(p), test.rate, CHANNELS, record=k) for k, p in enumerate(pairs)]


@pytest.mark.parametrize("location", tables.LOCATIONS)
def test_no_intact_impact_of_any_location_is_rejected(location):
    for snr in (40.0, 20.0):
        test = synthetic.hammer_test(location, 10, seed=3, snr_db=snr, duration=0.195, pre_trigger=5e-3)
        impacts = find_impacts(recordings_of(test), "hammer", "rail")
        assert [i.rejections for i in impacts] == [()] * 10
        # The truth starts its decay 0.2 ms behind the last sample above 2 % of the *true* peak.
        assert [i.decay_start for i in impacts] == pytest.approx(list(test.decay_start), abs=1)


@pytest.mark.parametrize("location", tables.LOCATIONS)
def test_decays_at_40_db_pass_the_gate_where_their_modes_lie(location):
    test = synthetic.hammer_test(location, 30, seed=3, duration=0.195, pre_trigger=5e-3)
    result = receptance_of(find_impacts(recordings_of(test), "hammer", "rail"))
    assert bands_passed(result)["ballast"] == 1.0 and result.n == 30
    for frequency in test.frequency.mean(axis=0):
        assert result.passed[np.argmin(np.abs(result.frequency - frequency))]


@pytest.mark.parametrize("location", ["SP", "CLP", "AS main"])
def test_a_scatter_of_resonances_of_3_percent_between_impacts_rejects_no_impact(location):
    # Without the natural scatter all later standard errors would be too small.
    for seed in range(4):
        test = synthetic.hammer_test(location, 10, seed=seed, spread=0.03, duration=0.195, pre_trigger=5e-3)
        assert [i.accepted for i in find_impacts(recordings_of(test), "hammer", "rail")] == [True] * 10
