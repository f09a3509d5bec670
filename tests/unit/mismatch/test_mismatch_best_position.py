"""A leader moves to the neighbouring position that explains more."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.mismatch.engine import leaders
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.diagnose import Diagnosis
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.leaders import at_best_position
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.verdict import Verdict
from turnout.physics import Parameter

X = np.linspace(0.0, 9.0, 300)
POSITIONS = (1.8, 2.4, 3.0, 3.6, 4.2, 4.8, 5.4, 6.6, 7.2)  # one support has no candidate
DEPTH, WIDTH = 0.8, 1.1
SIZE = (Parameter("depth", "-", 0.0, (-9.0, 9.0), "size", "made up 2026", (0.0, 3.0)),)


class Dented(Case):
    """A bump of a known width and an unknown depth at a support, four recordings, a slope, and an effect everywhere."""

    is_large = True

    def __init__(self, true_position, impossible=(), noise=0.05, error=0.05):
        rng = np.random.default_rng(6)
        self.impossible = impossible
        self.nuisances = (Nuisance("slope", "-", 0.0, 0.5),)
        self.candidates = (
            *(
                Candidate.of("bump", SIZE, lambda p, x=x: p | {"place": x}, ((1.0,),), {"place": x}, n_scanned=9)
                for x in POSITIONS
            ),
            Candidate.of("shift", SIZE, lambda p: p | {"place": None}, ((1.0,),)),
        )
        true = self.shape(DEPTH, true_position)
        self.observations = tuple(
            Observation(f"o{k}", f"day {k}", true + noise * rng.normal(size=X.size), error) for k in range(4)
        )

    def shape(self, depth, place):
        return depth * (np.ones(X.size) if place is None else np.exp(-(((X - place) / WIDTH) ** 2)))

    def predict(self, values, terms, observations):
        if any(t["place"] in self.impossible for t in terms):
            raise SimulationError("cannot be simulated there")
        return [values["slope"] * X / 9.0 + sum((self.shape(**t) for t in terms), 0.0 * X) for _ in observations]


def leader_at(case, position):
    base = fit_jointly(case)
    (candidate,) = (c for c in case.candidates if c.where.get("place") == position)
    return base, score_of(Search(case), base, fit_jointly(case, (candidate,), [1.0]), candidate)


def leader_at_first(case):
    base, candidate = fit_jointly(case), case.candidates[0]
    return base, score_of(Search(case), base, fit_jointly(case, (candidate,), [1.0]), candidate)


@pytest.mark.parametrize(("start", "true"), [(1.8, 4.2), (3.6, 4.2), (5.4, 4.2), (5.4, 7.2), (3.0, 1.8)])
def test_a_leader_at_another_position_moves_to_the_true_one(start, true):
    case = Dented(true)
    base, leader = leader_at(case, start)
    moved = at_best_position(Search(case), base, leader)
    assert moved.candidate.where["place"] == true
    assert moved.estimates[0][0] == pytest.approx(DEPTH, abs=4.0 * moved.estimates[1][0])
    assert moved.gain > leader.gain


class DentedBetween(Dented):
    """The bump may lie at every quarter of the bays beside a leader."""

    def finer_candidates(self, candidate):
        at = candidate.position
        return [
            Candidate.of("bump", SIZE, lambda p, x=x: p | {"place": x}, ((1.0,),), {"place": x}, n_scanned=36)
            for x in np.round(np.arange(at - 0.45, at + 0.5, 0.15), 2)
            if candidate.family == "bump" and x not in POSITIONS
        ]


@pytest.mark.parametrize("start", [4.2, 5.4])
def test_a_leader_moves_to_a_position_between_those_of_the_search(start):
    case = DentedBetween(4.35)
    base, leader = leader_at(case, start)
    moved = at_best_position(Search(case), base, leader)
    assert moved.candidate.where["place"] == 4.35
    assert moved.estimates[0][0] == pytest.approx(DEPTH, abs=4.0 * moved.estimates[1][0])


def test_the_gain_is_that_of_a_fit_which_starts_there():
    case = Dented(4.2)
    base, leader = leader_at(case, 3.0)
    _, there = leader_at(case, 4.2)
    moved = at_best_position(Search(case), base, leader)
    assert moved.gain == pytest.approx(there.gain, abs=0.01)  # a linear model: one optimum
    assert moved.fit.jacobian  # the gain by condition needs it


@pytest.mark.parametrize("position", [4.2, None])
def test_a_leader_at_its_best_position_or_without_one_stays(position):
    case = Dented(4.2)
    base, leader = leader_at(case, position)
    assert at_best_position(Search(case), base, leader) is leader


@pytest.mark.parametrize(("error", "possible"), [(1.3, None), (2.1, (2.4, 3.6)), (2.65, (1.8, 4.2))])
def test_positions_with_hardly_less_evidence_are_possible(error, possible):
    """The model is linear: the evidence of a bump is that of a normal distribution with its covariance."""
    case = Dented(3.0, noise=0.0, error=error)
    base, leader = leader_at(case, 3.0)
    data, slope = case.shape(DEPTH, 3.0), X / 9.0
    evidence = {}
    for x in POSITIONS:
        bump = case.shape(1.0, x)
        covariance = 0.25 * error**2 * np.eye(X.size) + 0.25 * np.outer(slope, slope) + 9.0 * np.outer(bump, bump)
        evidence[x] = -0.5 * (data @ np.linalg.solve(covariance, data) + np.linalg.slogdet(covariance)[1])
    close = [x for x, nats in evidence.items() if nats > evidence[3.0] - 6.0]
    assert ((min(close), max(close)) if len(close) > 1 else None) == possible
    found = at_best_position(Search(case), base, leader)
    assert found.candidate.where["place"] == 3.0 and found.possible_positions == possible


def test_a_diagnosis_has_the_possible_positions_of_each_effect_of_its_fit():
    """The fit has the second effect first; a rejected candidate has a range as well."""
    case = Dented(3.0, noise=0.0, error=2.1)
    base, leader = leader_at(case, 3.0)
    found = at_best_position(Search(case), base, leader)
    whole = next(c for c in case.candidates if c.family == "shift")
    elsewhere = replace(leader_at(case, 7.2)[1], possible_positions=(6.6, 7.2))
    second = score_of(Search(case), base, fit_jointly(case, (whole,), [1.0]), whole)
    fit = base.with_candidates((whole, found.candidate))
    verdicts = (Verdict("named", ("bump",), scores=(found, elsewhere)), Verdict("named", ("shift",), scores=(second,)))
    diagnosis = Diagnosis(verdicts, base, fit, (), None)
    assert diagnosis.possible_positions == (None, (2.4, 3.6))


def test_two_possible_lengths_at_one_position_are_no_range(monkeypatch):
    """Widths of 1.10 and 1.11 m cannot be distinguished."""
    case = Dented(3.0, noise=0.0)
    widths = {3: WIDTH, 5: 1.01 * WIDTH}
    case.candidates = tuple(
        Candidate.of(
            "bump", SIZE, lambda p, n=n: p | {"place": 3.0, "width": widths[n]}, ((1.0,),),
            {"place": 3.0, "sleepers": n},
        )
        for n in widths
    )  # fmt: skip
    monkeypatch.setattr(case, "shape", lambda depth, place, width: depth * np.exp(-(((X - place) / width) ** 2)))
    base, leader = leader_at_first(case)
    assert at_best_position(Search(case), base, leader) is leader


def test_an_effect_with_a_length_is_no_neighbour_of_one_without():
    """A long bump at the true position, and one as long as the leader beside it."""
    case = Dented(4.2)
    long_one = replace(case.candidates[4].site, where={"place": 4.2, "sleepers": 3})
    case.candidates = (*case.candidates[:4], replace(case.candidates[4], site=long_one), *case.candidates[5:])
    base, leader = leader_at(case, 3.0)
    assert at_best_position(Search(case), base, leader).candidate.where == {"place": 3.6}


def test_a_leader_also_moves_to_the_next_length(monkeypatch):
    """Bumps of three lengths at each position; the true one is at 4.2 m, the longest."""
    case = Dented(4.2)
    lengths = {1: 0.3, 3: 0.6, 5: WIDTH}
    case.candidates = tuple(
        Candidate.of(
            "bump", SIZE, lambda p, x=x, n=n: p | {"place": x, "width": lengths[n]}, ((1.0,),),
            {"place": x, "sleepers": n}, n_scanned=27,
        )
        for x in POSITIONS for n in lengths
    )  # fmt: skip
    monkeypatch.setattr(case, "shape", lambda depth, place, width: depth * np.exp(-(((X - place) / width) ** 2)))
    base = fit_jointly(case)
    (candidate,) = (c for c in case.candidates if c.where == {"place": 3.6, "sleepers": 1})
    leader = score_of(Search(case), base, fit_jointly(case, (candidate,), [1.0]), candidate)
    moved = at_best_position(Search(case), base, leader)
    assert moved.candidate.where == {"place": 4.2, "sleepers": 5}


def test_a_stretch_also_grows_at_one_end(monkeypatch):
    """Supports from 3.0 to 5.4 m have changed, a leader has the last three. Another middle or length alone is worse.

    The supports behind weigh five times as much, those at 3.0 and 3.6 m less than the others.
    """
    case = Dented(4.2)
    spacing, weight = 0.6, np.where(X > 5.7, 5.0, np.where(X < 3.9, 0.8, 1.0))
    case.candidates = tuple(
        Candidate.of(
            "bump", SIZE, lambda p, x=x, n=n: p | {"place": x, "n": n}, ((1.0,),), {"place": x, "sleepers": n},
            n_scanned=27,
        )
        for x in POSITIONS for n in (1, 3, 5)
    )  # fmt: skip
    monkeypatch.setattr(case, "shape", lambda depth, place, n: depth * weight * (np.abs(X - place) < 0.5 * n * spacing))
    true = case.shape(DEPTH, 4.2, 5)
    case.observations = tuple(replace(o, data=true + o.data - Dented(4.2).shape(DEPTH, 4.2)) for o in case.observations)
    base = fit_jointly(case)
    (candidate,) = (c for c in case.candidates if c.where == {"place": 4.8, "sleepers": 3})
    leader = score_of(Search(case), base, fit_jointly(case, (candidate,), [1.0]), candidate)
    assert at_best_position(Search(case), base, leader).candidate.where == {"place": 4.2, "sleepers": 5}


def test_each_position_is_tried_once_even_if_a_fit_to_convergence_has_less_evidence(monkeypatch):
    case, tried = Dented(4.2), []
    base, leader = leader_at(case, 3.0)
    score_at = leaders._score_at
    monkeypatch.setattr(leaders, "_score_at", lambda s, f, x, c: tried.append(c.key) or score_at(s, f, x, c))
    monkeypatch.setattr(
        leaders, "refit_to_convergence", lambda search, fit, score: replace(score, gain=leader.gain + len(tried))
    )
    at_best_position(Search(case), base, leader)
    assert len(tried) == len(set(tried))
    monkeypatch.setattr(
        leaders, "refit_to_convergence", lambda search, fit, score: replace(score, gain=leader.gain - 1.0)
    )
    stayed = at_best_position(Search(case), base, leader)
    assert replace(stayed, possible_positions=None) == leader
    assert stayed.possible_positions == (3.0, 4.8)  # the trials at 3.6 to 4.8 m have more evidence


@pytest.mark.parametrize("where", [{"place": "all supports"}, {}])
def test_an_effect_without_a_coordinate_is_no_neighbour(where):
    case = Dented(4.2)
    elsewhere = replace(case.candidates[1], site=replace(case.candidates[1].site, where=where))  # 2.4 m
    case.candidates = (case.candidates[0], elsewhere, *case.candidates[2:])
    base, leader = leader_at(case, 3.0)
    assert at_best_position(Search(case), base, leader).candidate.where["place"] == 4.2


def test_a_stretch_in_words_has_no_neighbours():
    case = Dented(4.2)
    base, leader = leader_at(case, 3.0)
    site = replace(leader.candidate.site, where={"place": "all supports"})
    of_all = replace(leader.candidate, site=site)
    stretch = replace(leader, candidate=of_all, fit=leader.fit.with_candidates((of_all,)))
    assert at_best_position(Search(case), base, stretch) is stretch


def test_a_neighbour_that_cannot_be_simulated_leaves_the_leader():
    case = Dented(4.2, impossible=(2.4, 3.6))
    base, leader = leader_at(case, 3.0)
    assert at_best_position(Search(case), base, leader) is leader
