"""The disagreement between recordings is part of the error of their joint estimate."""

import numpy as np
import pytest

from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.cross_validation import jackknife_errors, jackknife_steps
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation

X = np.arange(1.0, 31.0)


class Lines(Case):
    """Recordings of lines through the origin, with one slope or with different ones."""

    def __init__(self, slopes, kinds=None):
        kinds = kinds or ["line"] * len(slopes)
        self.observations = tuple(
            Observation(f"o{k}", f"c{k}", s * X, 0.5, 1.0, kind) for k, (s, kind) in enumerate(zip(slopes, kinds))
        )
        self.nuisances = (Nuisance("slope", "-", 0.0, 1e4),)

    def predict(self, values, terms, observations):
        return [values["slope"] * X for _ in observations]


def test_the_disagreement_is_the_standard_error_of_the_mean_of_single_estimates():
    slopes = np.array([1.7, 2.0, 2.1, 2.6])
    case = Lines(slopes)
    expected = np.std(slopes, ddof=1) / np.sqrt(4)  # for a mean the jackknife is exact
    assert jackknife_errors(jackknife_steps(case, fit_jointly(case), "line")) == pytest.approx([expected], rel=1e-6)


def test_recordings_that_agree_add_no_error_and_two_recordings_are_too_few():
    for case in (Lines([2.0, 2.0, 2.0]), Lines([1.0, 2.0]), Lines([1.0, 2.0, 3.0], ["line", "other", "other"])):
        assert jackknife_errors(jackknife_steps(case, fit_jointly(case), "line")) == pytest.approx([0.0], abs=1e-9)
