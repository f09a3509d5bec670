"""An effect with the predicted gain of a name is fitted from the priors if its refit from the base fit gains less."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.engine import candidate_search, refit
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import Entry, RefitTask, shortlist
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.leaders import start_from_priors
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.refit import _rank_families
from turnout.mismatch.engine.search import Search
from turnout.physics import Parameter

WAVE, OTHER_WAVE, BARRIER = (np.sin(np.linspace(0.0, x, 200)) for x in (7.0, 22.0, 31.0))
SIZE = (Parameter("height", "-", 0.0, (-9.0, 9.0), "size", "made up 2026", (0.0, 3.0)),)
IMITATION = 3.0  # of the nuisance: there it changes the recordings nearly as the effect does


class Imitated(Case):
    """A wave of height 1, and a nuisance that imitates it behind a barrier: from 0 to 3 the fit first gets worse."""

    def __init__(self, is_large=True):
        rng = np.random.default_rng(11)
        self.is_large = is_large
        self.nuisances = (Nuisance("stiffness", "-", 0.0, 0.5),)
        self.candidates = (
            Candidate.of("wave", SIZE, lambda p: p, ((0.1,),), {}),
            Candidate.of("other wave", SIZE, lambda p: p | {"other": True}, ((0.1,),), {}),
        )
        self.observations = tuple(
            Observation(f"o{k}", f"day {k}", WAVE + 0.2 * rng.normal(size=WAVE.size), 0.2) for k in range(4)
        )

    def predict(self, values, terms, observations):
        x = values["stiffness"]
        made = 0.98 * x / IMITATION * WAVE + 4.0 * np.sin(np.pi * x / IMITATION) ** 2 * BARRIER
        for term in terms:
            made = made + term["height"] * (OTHER_WAVE if "other" in term else WAVE)
        return [made for _ in observations]


def base_and_scores(monkeypatch, case, promises=(20.0, 0.0), fit=None):
    """(base fit, scores by effect) of tasks with these predicted gains."""
    base = fit or fit_jointly(case, values={"stiffness": IMITATION})
    tasks = [RefitTask(c, np.array([0.1]), {}, p) for c, p in zip(case.candidates, promises)]
    monkeypatch.setattr(refit, "shortlist", lambda *a: tasks)
    return base, {s.family: s for s in _rank_families(Search.of(case), base, ())}


def test_a_base_fit_that_imitates_the_effect_does_not_leave_that_minimum():
    """The precondition of the other tests."""
    base = fit_jointly(Imitated(), values={"stiffness": IMITATION})
    assert base.values["stiffness"] == pytest.approx(IMITATION, abs=0.3)


def test_a_predicted_gain_that_no_refit_reaches_causes_a_restart_from_the_priors(monkeypatch):
    _, scores = base_and_scores(monkeypatch, Imitated())
    wave = scores["wave"]
    assert wave.estimates[0][0] == pytest.approx(1.0, abs=4.0 * wave.estimates[1][0])
    assert wave.fit.values["stiffness"] == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize("promise", [0.0, 11.0])
def test_a_predicted_gain_below_the_threshold_causes_no_restart(monkeypatch, promise):
    """Restarts need many simulations; without any effect no predicted gain is near the threshold of a name."""
    _, scores = base_and_scores(monkeypatch, Imitated(), (promise, 0.0))
    assert scores["wave"].fit.values["stiffness"] == pytest.approx(IMITATION, abs=0.3)


def test_a_restart_with_a_lower_gain_is_not_used(monkeypatch):
    """The absent wave has a large predicted gain: its restart ends with the nuisance at 0 and the wave unexplained."""
    base, before = base_and_scores(monkeypatch, Imitated(), (0.0, 0.0))
    _, after = base_and_scores(monkeypatch, Imitated(), (0.0, 20.0), base)
    assert after["other wave"].gain == before["other wave"].gain


def test_a_restart_ends_if_it_does_not_lead_to_half_of_the_threshold(monkeypatch):
    """The target is below the cost of the fit without the effect, so a restart without a gain does not use all
    steps."""
    case, bars = Imitated(), []
    base, fit = fit_jointly(case, values={"stiffness": IMITATION}), Search.fit
    monkeypatch.setattr(Search, "fit", lambda self, *a, **k: bars.append(k.get("sought_cost")) or fit(self, *a, **k))
    search = Search.of(case)
    start_from_priors(search, base, RefitTask(case.candidates[1], np.array([0.1]), {}, 20.0))
    assert bars == [pytest.approx(base.cost - search.settings.threshold)]


@pytest.mark.parametrize(("family", "is_continued"), [("wave", True), ("other wave", False)])
def test_only_a_restart_with_a_gain_is_continued_to_convergence(monkeypatch, family, is_continued):
    case, continued = Imitated(), []
    base, converge = fit_jointly(case, values={"stiffness": IMITATION}), Search.converge
    monkeypatch.setattr(Search, "converge", lambda self, fit: continued.append(fit) or converge(self, fit))
    candidate = next(c for c in case.candidates if c.family == family)
    start_from_priors(Search.of(case), base, RefitTask(candidate, np.array([0.1]), {}, 20.0))
    assert bool(continued) == is_continued


def test_there_is_no_restart_if_another_effect_reaches_the_threshold(monkeypatch):
    case, begun = Imitated(), []
    monkeypatch.setattr(refit, "start_from_priors", lambda search, fit, task: begun.append(task))
    score_task = refit._score_task
    monkeypatch.setattr(refit, "_score_task", lambda *a: replace(score_task(*a), gain=20.0))
    monkeypatch.setattr(refit, "_refine_leaders", lambda search, fit, scores: scores)
    base_and_scores(monkeypatch, case)
    assert begun == []
    monkeypatch.setattr(refit, "_score_task", lambda *a: replace(score_task(*a), gain=3.0))
    base_and_scores(monkeypatch, case)
    assert [t.candidate.family for t in begun] == ["wave"]


def test_there_is_no_restart_beside_an_effect_or_in_a_small_case(monkeypatch):
    """Beside another effect the residual may be an error of its shape; a small case tries all starts anyway."""
    begun = []
    monkeypatch.setattr(refit, "start_from_priors", lambda search, fit, task: begun.append(task))
    case = Imitated()
    beside = fit_jointly(case, case.candidates[1:], [0.0], {"stiffness": IMITATION})
    base_and_scores(monkeypatch, case, fit=beside)
    base_and_scores(monkeypatch, Imitated(is_large=False))
    assert begun == []


def test_rivals_are_restarted_together(monkeypatch):
    """Two effects with equal responses: if only one of them were restarted, its name would be wrong."""
    case = Imitated()
    case.candidates = (case.candidates[0], Candidate.of("twin", SIZE, lambda p: p, ((0.1,),), {}))
    _, scores = base_and_scores(monkeypatch, case, (20.0, 15.0))
    assert scores["twin"].gain == pytest.approx(scores["wave"].gain, abs=0.5) and scores["twin"].gain > 10.0


def test_the_predicted_gain_is_that_of_the_chosen_entry(monkeypatch):
    """Another entry of the candidate, fitted to few recordings, gives the start and not the predicted gain."""
    case = Imitated()
    base, wave = fit_jointly(case, values={"stiffness": IMITATION}), case.candidates[0]
    entry = Entry(18.0, wave, np.array([0.1]), {})
    monkeypatch.setattr(candidate_search, "_screened_entries", lambda *a: [entry])
    (task,) = shortlist(Search.of(case), base, [Entry(3.0, wave, np.array([0.7]), {"stiffness": 0.4})])
    assert task.promise == 18.0 and task.start == [0.7] and task.values == {"stiffness": 0.4}


def test_the_best_restarted_effect_moves_along_the_track(monkeypatch):
    """The others keep the sites of their predicted gains."""
    moved = []
    monkeypatch.setattr(refit, "_refine_leaders", lambda search, fit, scores: scores)
    monkeypatch.setattr(refit, "at_best_position", lambda search, fit, s: moved.append(s.family) or s)
    base_and_scores(monkeypatch, Imitated(), (20.0, 20.0))
    assert moved == ["wave"]
