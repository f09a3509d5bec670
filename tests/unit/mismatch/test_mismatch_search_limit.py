"""A search with more simulations than its case allows ends with "cannot tell" and states the reason."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.mismatch.engine import search
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.diagnose import diagnose, fit_base
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.search_limit import SearchLimit, SearchLimitError, check_limit
from turnout.physics.term import Parameter
from turnout.stages.finding_row import sentence

SIZE = (Parameter("size", "-", 0.0, (0.0, 9.0), "of the parabola", "made up 2026"),)


class Counted(Case):
    """Readings of a line with a parabola; every prediction counts as a simulation."""

    control_level = {"reading": 1.5}

    def __init__(self, most):
        self.x, rng, self.count, self.max_simulations = np.arange(1.0, 41.0) / 10.0, np.random.default_rng(3), 0, most
        data = [2.0 * self.x + self.x**2 + 0.1 * rng.normal(size=40) for _ in range(3)]
        self.observations = tuple(Observation(f"o{k}", f"c{k}", d, 0.1, 1.0, "reading") for k, d in enumerate(data))
        self.nuisances = (Nuisance("slope", "-", 2.0, 1.0),)
        self.candidates = (Candidate.of("bend", SIZE, lambda psi: psi["size"], ((1.0,),)),)

    @property
    def n_simulations(self):
        return self.count

    def predict(self, values, terms, observations):
        self.count += len(observations)
        return [values["slope"] * self.x + sum(terms) * self.x**2 for _ in observations]


@pytest.mark.parametrize(("most", "count"), [(None, 10_000), (5, 4), (5, 5), (0, 0)])
def test_a_search_may_use_as_many_simulations_as_its_limit(most, count):
    case = Counted(most)
    case.count = 7 + count
    check_limit(case, 7)


@pytest.mark.parametrize(("most", "count"), [(5, 6), (0, 1)])
def test_one_more_simulation_ends_the_search_with_both_numbers_in_the_message(most, count):
    case = Counted(most)
    case.count = 7 + count
    with pytest.raises(SearchLimitError, match=f"has cost {count} simulations, of at most {most}") as end:
        check_limit(case, 7)
    assert end.value.limit == SearchLimit(count, most)


@pytest.mark.parametrize("most", [None, 100_000])
def test_a_search_within_its_limit_is_not_changed(most):
    assert diagnose(Counted(most)).names == ("bend",)


def test_simulations_of_the_fit_without_effects_do_not_count_for_the_search(monkeypatch):
    """The simulations before a search, those of the fit without effects, are subtracted in every check."""
    base, n_before = Counted(None), []
    fit_base(Search.of(base))
    monkeypatch.setattr(search, "check_limit", lambda case, n: n_before.append(n))
    diagnose(Counted(None))
    assert base.count > 0 and set(n_before) == {base.count}


def test_a_search_beyond_its_limit_has_no_answer():
    case = Counted(3)
    found = diagnose(case)
    assert found.verdict.answer == "unknown" and found.verdict.trail[0] == "search_too_long"
    assert found.verdict.reason == "the search was not finished within 3 simulations of a train"
    assert sentence(found).startswith("Whether something is missing is open: the search was not finished within 3 ")
    assert found.fit is found.base and found.names == () and 0.0 < found.probability < 1.0
    whole = Counted(None)
    diagnose(whole)
    assert case.count < whole.count


class TwoEffects(Counted):
    """A parabola and, smaller, a wave; the first effect leaves an excess, so that a second one is tested."""

    def __init__(self, most):
        super().__init__(most)
        wave = np.sin(4.0 * self.x)
        self.observations = tuple(replace(o, data=o.data + 0.15 * wave) for o in self.observations)
        self.candidates = (
            Candidate.of("bend", SIZE, lambda psi: psi["size"] * self.x**2, ((1.0,),)),
            Candidate.of("wave", SIZE, lambda psi: psi["size"] * wave, ((1.0,),)),
        )

    def predict(self, values, terms, observations):
        self.count += len(observations)
        return [values["slope"] * self.x + sum(terms) for _ in observations]


def test_a_name_stays_if_the_search_for_a_second_effect_is_not_finished():
    whole = TwoEffects(None)
    assert sorted(diagnose(whole).names) == ["bend", "wave"]
    answers = [diagnose(TwoEffects(most)) for most in range(0, whole.count, 10)]
    trails = [a.verdict.trail[0] for a in answers]
    kept = [a for a in answers if "further_effect_not_sought_to_the_end" in a.verdict.trail]
    assert kept and trails == sorted(trails, key=lambda name: name != "search_too_long")
    for answer in kept:
        assert answer.names == ("bend",) and answer.verdict.grade == "B" and len(answer.verdicts) == 1
        assert "whether there is a second effect was not decided within" in answer.verdict.reason


def test_a_name_stays_if_a_simulation_fails_in_the_search_for_a_second_effect(monkeypatch):
    def failing(first):
        raise SimulationError("the wheel leaves the track at 3 m.")

    monkeypatch.setattr("turnout.mismatch.engine.diagnose._seek_further", failing)
    found = diagnose(TwoEffects(None))
    assert found.names == ("bend",) and len(found.verdicts) == 1
    reason = (
        "whether there is a second effect was not decided, since a simulation failed: the wheel leaves the track at 3 m"
    )
    assert found.verdict.reason == reason and "further_effect_not_sought_to_the_end" in found.verdict.trail
