"""Hammer tests alone: an effect is fitted at every peak of its promise along the track, and moves on from there."""

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.hammer_prescreen import (
    PrescreenFit,
    _Prescreen,
    _Start,
    peaks_of_promise,
    sites_along_track,
)
from turnout.physics import Parameter

SIZE = (Parameter("mass", "kg", 0.0, (0.0, 150.0), "mass", "made up 2026"),)
# position [m]: promise of its column, gain of its fit [nats]; as for a mass of 40 kg at 3.9 m between two sensors
ALONG = {2.4: (78, 165), 2.7: (135, 321), 3.0: (138, 341), 3.3: (11, -14)}
ALONG |= {3.6: (74, 297), 3.9: (72, 526), 4.2: (68, 114)}


def start_at(position, promise, group="", **where):
    candidate = Candidate.of("mass", SIZE, dict, ((1.0,),), where or {"place": position}, prescreen_group=group)
    return _Start(float(promise), candidate, np.array([1.0]))


def starts(group=""):
    return [start_at(x, promise, group) for x, (promise, _) in ALONG.items()]


@pytest.fixture
def step(monkeypatch):
    """A prescreen whose fits have the gains above; ``tried`` are the positions that were fitted."""
    made = _Prescreen(MismatchSettings(), None, None, (), None, None)
    made.tried = []

    def fit(candidate, start):
        made.tried.append(candidate.position)
        return PrescreenFit(float(ALONG[candidate.position][1]), candidate, start, {}, 1.0, 2.0)

    monkeypatch.setattr(made, "fit", fit)
    return made


def test_the_likeliest_sites_are_peaks_and_not_the_neighbours_of_the_best(step):
    assert [c.position for c, _ in step.likeliest_starts(starts())] == [3.0, 3.6]
    assert [s.candidate.position for s in peaks_of_promise(reversed(starts()))] == [3.0, 3.6]


def test_a_fit_moves_from_a_lower_peak_to_the_best_position(step):
    sites = sites_along_track(starts())
    fits = [step.best_beside(step.fit(c, s), sites) for c, s in step.likeliest_starts(starts())]
    assert [f.candidate.position for f in fits] == [3.0, 3.9]
    assert max(fits, key=lambda f: f.gain).candidate.position == 3.9


def test_a_fit_without_promise_and_one_of_a_family_tried_everywhere_stay(step):
    sites = sites_along_track(starts())
    weak = step.fit(sites[3], np.array([1.0]))
    grouped = sites_along_track(starts("ballast"))
    strong = step.fit(grouped[4], np.array([1.0]))
    step.tried.clear()
    assert step.best_beside(weak, sites) is weak and step.best_beside(strong, grouped) is strong
    assert step.best_beside(None, sites) is None and step.tried == []


def test_sites_that_are_no_positions_alone_are_all_kept():
    channels = [start_at(None, promise, sensor=name) for name, promise in (("A1", 3.0), ("A2", 9.0), ("A3", 8.0))]
    assert sites_along_track(channels) == []
    assert [s.candidate.where["sensor"] for s in peaks_of_promise(channels)] == ["A2", "A3", "A1"]
