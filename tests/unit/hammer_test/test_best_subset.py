"""The subset of impacts that agree best, and the errors of the modes with it."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from benchmarks.off_axis import N_WANTED, recordings_of, rms_errors

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts, response_quality
from turnout.hammer_test.best_subset import best_subset
from turnout.records import Rejection


@pytest.mark.parametrize("seed", range(5))
def test_no_other_subset_has_a_larger_mean_coherence(seed):
    """Compared with all 126 subsets of nine impacts of which some agree less."""
    rng = np.random.default_rng(seed)
    quality = np.where(rng.random(9) < 0.3, 0.9, 0.99)
    pairs = np.minimum.outer(quality, quality) * rng.uniform(0.99, 1.0, (9, 9))
    pairs = (pairs + pairs.T) / 2

    def mean(subset):
        return sum(pairs[i, j] for i, j in combinations(subset, 2))

    assert mean(best_subset(pairs, 5)) == pytest.approx(max(map(mean, combinations(range(9), 5))), rel=1e-9)


def test_impacts_beside_the_axis_are_not_selected_and_the_reason_is_stated():
    settings = replace(ReceptanceSettings(), best_impacts=N_WANTED)
    impacts = find_impacts(recordings_of(3), "hammer", "rail", settings)
    assert sum(i.accepted for i in impacts) == N_WANTED
    (rejection,) = next(i.rejections for i in impacts if i.rejections and i.rejections[0].reason == "not_selected")
    assert rejection.value < rejection.limit and "selected" in rejection.detail
    everything = find_impacts(recordings_of(3), "hammer", "rail")
    assert not any(r.reason == "not_selected" for i in everything for r in i.rejections)


def test_impacts_that_a_later_test_rejects_are_not_among_the_selected(monkeypatch):
    """Two of those that agree best turn out to be saturated."""
    settings = replace(ReceptanceSettings(), best_impacts=N_WANTED, minimum_peak_force=0.0)
    first = [i.peak for i in find_impacts(recordings_of(3), "hammer", "rail", settings) if i.accepted]
    saturated = Rejection("overload", 2.0, 1.0, "saturated")

    def judge(impacts, response):
        return tuple(replace(i, rejections=(saturated,)) if i.peak in first[:2] else i for i in impacts)

    monkeypatch.setattr(response_quality, "judge_saturation", judge)
    found = response_quality.find_track_impacts(recordings_of(3), "hammer", "rail", settings)
    assert sum(i.rejections == (saturated,) for i in found) == 2
    assert sum(i.accepted for i in found) == N_WANTED


def test_the_modes_of_the_best_subset_are_nearer_to_the_truth_than_those_of_all_accepted_impacts():
    """Of six tests; all four errors of 24 tests are bars of ``python -m benchmarks receptance``."""
    found = rms_errors(range(200, 206))
    ratios = {
        (band, name): found[band, name, N_WANTED] / found[band, name, 0]
        for band in ("ballast", "railpad")
        for name in ("frequency", "damping")
    }
    assert ratios["ballast", "frequency"] < 1.0
    assert np.prod(list(ratios.values())) ** 0.25 < 0.9
