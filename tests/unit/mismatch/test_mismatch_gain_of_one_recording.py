"""A gain in one recording that similar recordings do not have belongs to that recording alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate import Candidate, EffectSite
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.cross_validation import effect_energy, gain_where_unmasked
from turnout.mismatch.engine.decision import judge
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.single_source import REPETITION, share_without_repetition, single_source
from turnout.mismatch.turnout.case import TrackCase
from turnout.physics import Parameter

SIZE = (Parameter("size", "-", 0.0, (-9.0, 9.0), "of a bump", "made up 2026"),)
BUMP = np.sin(np.linspace(0.0, 6.0, 200))


class Days(Case):
    """A bump in three recordings, ``factors`` times as large in each; the second has half the independent samples."""

    def __init__(self, factors):
        self.factors = dict(zip("abc", factors))
        self.observations = tuple(
            Observation(n, n, s * BUMP, np.full(BUMP.size, 0.1), 0.5 if n == "b" else 1.0)
            for n, s in self.factors.items()
        )
        self.candidates = (Candidate.of("bump", SIZE, lambda p: p["size"], ((0.5,),)),)

    def predict(self, values, terms, observations):
        if not terms and self.factors["c"] < 0.0:
            raise SimulationError("cannot go without")
        return [sum(terms) * self.factors[o.name] * BUMP for o in observations]


def case_and_fit(factors):
    case = Days(factors)
    return case, fit_jointly(case, case.candidates, [0.5], iterations=20)


def test_the_visibility_of_an_effect_is_the_energy_of_its_change():
    case, fit = case_and_fit((1.0, 2.0, 3.0))
    size = float(fit.psi[0])
    for name, energy in effect_energy(case, fit, case.candidates[0]).items():
        share = 0.5 if name == "b" else 1.0
        by_hand = share * np.sum((case.factors[name] * size * BUMP / 0.1) ** 2)
        assert energy == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize(
    "factors, gains, alone",
    [
        (
            (1.0, 2.0, 1.0),
            {"a": 20.0, "b": 1.0, "c": 2.0},
            "a",
        ),  # b has twice the energy, c as much, and neither has a gain
        ((1.0, 1.02, 0.72), {"a": 20.0, "b": 1.0, "c": 2.0}, "a"),  # b and c show 0.52 of the energy of a
        ((1.0, 0.98, 0.72), {"a": 20.0, "b": 1.0, "c": 2.0}, ""),  # b shows 0.48: one recording does not confirm itself
        ((1.0, 2.0, 1.0), {"a": 20.0, "b": 1.0, "c": 12.0}, ""),  # the other recordings confirm it
        (
            (1.0, 2.0, 1.0),
            {"a": 11.0, "b": 1.0, "c": -3.0},
            "",
        ),  # it does not depend on a, whose gain alone is too small
        ((1.0, 2.0, 1.0), {}, ""),
        ((1.0, 2.0, -1.0), {"a": 20.0, "b": 1.0, "c": 2.0}, ""),  # it cannot be compared with no effect
    ],
)
def test_evidence_of_one_recording_that_similar_ones_do_not_confirm(factors, gains, alone):
    case, fit = case_and_fit(factors)
    assert single_source(Search(case), fit, case.candidates[0], 25.0, gains) == alone
    of_a_train = replace(case.candidates[0], site=EffectSite({"train": "ic3"}))
    assert single_source(Search(case), fit, of_a_train, 25.0, gains) == ""


@pytest.mark.parametrize(
    "others, gain, alone",
    [
        ((5.0, 2.0), 55.0, ""),  # 27 are less than half of 55: the rest is the penalty of nuisances
        ((5.0, 2.0), 53.0, "a"),
        ((5.0, -6.0), 55.0, "a"),  # the others contradict it by 1
    ],
)
def test_no_recording_is_the_source_where_most_of_the_evidence_is_the_penalty_of_nuisances(others, gain, alone):
    """A corrugation with 119 nats, of which conditions left out showed 22, was rejected as that of one passage."""
    case, fit = case_and_fit((1.0, 2.0, 1.0))
    by_condition = dict(zip("abc", (20.0, *others)))
    assert single_source(Search(case), fit, case.candidates[0], gain, by_condition) == alone


@pytest.mark.parametrize(
    "factors, nats",
    [
        ((1.0, 0.13, 0.0), 32.0),  # half of 0.13 squared is 0.8 % of the energy: b and c do not show it
        ((1.0, 0.15, 0.0), 30.0),  # 1.1 %: b may contain the residual of the first effect
        ((1.0, 0.9, 1.0), 0.0),
        ((1.0, 0.13, -1.0), 0.0),  # it cannot be compared with no effect
    ],
)
def test_recordings_without_the_first_effect_show_the_second(factors, nats):
    case, fit = case_and_fit(factors)
    gains = {"a": 7.0, "b": 2.0, "c": 30.0}
    assert gain_where_unmasked(case, fit, gains) == nats
    assert (
        gain_where_unmasked(case, replace(fit, candidates=()), gains) == 0.0
    )  # there is no effect before the first one


@pytest.mark.parametrize(
    "apart, places, answer", [(12.5, 1, "named"), (11.5, 1, "unknown"), (15.1, 20, "named"), (14.9, 20, "unknown")]
)
def test_evidence_in_other_recordings_need_not_explain_the_residual_of_the_first_effect(apart, places, answer):
    """A tenth of an excess of twice the control level, which may be the shape of the effect named before; of 20
    places each costs the evidence 3 nats."""
    candidate = Candidate.of("bump", (), lambda p: None, (), n_scanned=places)
    verdict = judge([Score(candidate, 40.0, 0.0, 0.1, None, unmasked_gain=apart)], 2.0, MismatchSettings())
    assert verdict.answer == answer
    assert "10 % of the residual" in verdict.reason
    assert ("the effect named first is not" in verdict.reason) == (answer == "named")


class ImpactCampaigns(Days):
    """Two campaigns of impacts at each of these positions [m], and a train."""

    def __init__(self, *positions):
        super().__init__((1.0, 1.0, 1.0))
        self.positions = positions

    def hammer_positions(self):
        return {f"{position} {year}": position for position in self.positions for year in (2025, 2026)}


@pytest.mark.parametrize(
    ("gains", "gain", "alone"),
    [
        (
            (0.5, -1.0, 7.0, 6.0, 1.0, 0.5, 1.5),
            16.0,
            "all impacts at 4.2 m",
        ),  # 13 against 2.5; no campaign would be enough alone
        ((0.5, 1.0, 17.0, 16.0, 1.0, 1.5, 1.9), 36.0, "all impacts at 4.2 m"),  # 33, and 5.9 of the others
        ((0.5, 1.0, 17.0, 16.0, 1.0, 1.5, 2.1), 36.0, ""),  # 6.1 of the others: half a name confirms one
        ((0.5, -1.0, 5.0, 6.0, 1.0, 0.5, 1.5), 14.0, "all impacts at 4.2 m"),  # 11, half a name, against 2.5
        ((0.5, -1.0, 5.0, 6.0, 4.0, 1.5, 1.5), 20.1, ""),  # 11 are no name and the others have half of one
        ((0.5, -1.0, 5.0, 6.0, 4.0, 1.5, 1.5), 19.9, REPETITION),  # 8 of 16 by repetition, and 11.9 without them
        ((3.0, 3.5, 3.0, 2.5, 7.0, 6.5, -1.0), 19.0, REPETITION),  # an intact track, the same at both visits
        ((3.0, 3.5, 3.0, 2.5, 7.0, 6.5, 12.0), 36.0, ""),  # a train confirms it
        ((0.5, -1.0, 2.5, 3.0, 1.0, 0.5, 1.5), 8.0, ""),  # nor does it depend on 5.5
        ((0.5, -1.0, 7.0, 6.0, 1.0, 0.5, 12.0), 26.0, ""),  # the train confirms it
        ((0.5, -1.0, 7.0, 6.0, 1.0, 0.5, 1.5), 30.0, "all impacts at 4.2 m"),  # 15.5 are most of 30
        ((0.5, -1.0, 7.0, 6.0, 1.0, 0.5, 1.5), 32.0, ""),  # and not of 32: the rest is the penalty of nuisances
        ((0.5, -4.0, 7.0, 6.0, 1.0, 0.5, 1.5), 32.0, "all impacts at 4.2 m"),  # yet others contradict it by 0.5
        (
            (0.5, -9.0, 14.0, 13.0, 1.0, 0.5, 12.1),
            34.0,
            "",
        ),  # a train alone is enough, even if other impacts lose evidence
        ((0.5, -9.0, 14.0, 13.0, 1.0, 0.5, 11.9), 34.0, "all impacts at 4.2 m"),  # and here it is not enough
    ],
)
def test_impacts_at_one_position_are_one_observation(gains, gain, alone):
    conditions = [f"{position} {year}" for position in (2.1, 4.2, 9.0) for year in (2025, 2026)]
    by_condition = dict(zip([*conditions, "railcar"], gains))
    case, fit = ImpactCampaigns(2.1, 4.2, 9.0), case_and_fit((1.0, 1.0, 1.0))[1]
    assert single_source(Search(case), fit, case.candidates[0], gain, by_condition) == alone


class ImpactsInSummerAndWinter(ImpactCampaigns):
    """Impacts at three positions, which the effect changes in the second campaign by this factor of the first."""

    def __init__(self, factor):
        super().__init__(2.1, 4.2, 9.0)
        self.factor = factor

    def changes_by_line(self, changes):
        lines = np.array([2.0, -1.0, np.nan, 3.0])
        factors = {2025: 1.0, 2026: self.factor}
        return {f"{x} {year}": factors[year] * lines for x in self.positions for year in (2025, 2026)}


@pytest.mark.parametrize(
    "factor, gain, alone",
    [
        (1.0, 30.1, ""), (1.0, 29.9, REPETITION),  # a half of 36 nats does not count: 12.1 and 11.9 remain
        (-1.0, 12.1, ""),  # with the opposite sign every test counts in full
        (0.0, 21.1, ""), (0.0, 20.9, REPETITION),  # nothing in the second campaign: a quarter of 36 nats, 9
    ],
)  # fmt: skip
def test_repeated_impacts_count_in_full_so_far_as_the_effect_changes_them_differently(factor, gain, alone):
    """As an effect of temperature does: an error that is the same at each visit does not imitate the difference."""
    case, fit = ImpactsInSummerAndWinter(factor), case_and_fit((1.0, 1.0, 1.0))[1]
    by_condition = {f"{x} {year}": 6.0 for x in (2.1, 4.2, 9.0) for year in (2025, 2026)} | {"railcar": 0.0}
    assert single_source(Search(case), fit, case.candidates[0], gain, by_condition) == alone


def test_lines_of_repeated_tests_that_only_one_of_them_has_do_not_count():
    assert share_without_repetition(np.array([[1.0, np.nan, 2.0], [1.0, 50.0, 2.0]])) == pytest.approx(0.5, rel=1e-12)
    assert share_without_repetition(np.array([[np.nan, 1.0], [1.0, np.nan], [1.0, 1.0]])) == 1.0 / 3.0
    three = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 2.0]])  # mean (2/3, 2/3): 1 - 2 * (8/9) / 6
    assert share_without_repetition(three) == pytest.approx(1.0 - 16.0 / 54.0, rel=1e-12)


def test_changes_of_tests_have_one_place_for_each_channel_and_line():
    """Channel A2 of the second test has been moved, so it has a place of its own."""
    seats = {"a": ("A1", 2.1, "rail"), "b": ("A2", 4.2, "rail"), "c": ("A1", 2.1, "rail"), "d": ("A2", 4.8, "rail")}
    lines = {"a": [0, 2], "b": [1], "c": [2, 3], "d": [1]}
    pairs = {name: SimpleNamespace(seat=seats[name], lines=np.array(lines[name])) for name in seats}
    conditions = {"a": "x", "b": "x", "passage": "train", "c": "y", "d": "y"}
    observations = [SimpleNamespace(name=name, condition=condition) for name, condition in conditions.items()]
    changes = [np.array(c) for c in ([1.0, 2.0, -1.0, -2.0], [5.0, -5.0], [9.0], [3.0, 4.0, -3.0, -4.0], [7.0, -7.0])]
    by_condition = TrackCase.changes_by_line(SimpleNamespace(observations=observations, frf_pairs=pairs), changes)
    assert list(by_condition) == ["x", "y"]
    first, second = (by_condition[c].reshape(3, 2, -1)[:, :, :4] for c in "xy")
    nan = np.nan
    np.testing.assert_array_equal(first[0], [[1.0, nan, 2.0, nan], [-1.0, nan, -2.0, nan]])
    np.testing.assert_array_equal(first[1, 0], [nan, 5.0, nan, nan])
    np.testing.assert_array_equal(second[0, 1], [nan, nan, -3.0, -4.0])
    assert np.all(np.isnan(first[2])) and np.all(np.isnan(second[1])) and second[2, 0, 1] == 7.0


@pytest.mark.parametrize("excess, answer", [(0.9, "none"), (1.1, "unknown")])
def test_a_name_that_rests_on_repeated_impacts_is_no_sign_of_an_effect(excess, answer):
    """It has less evidence than a name needs, however often the impacts are repeated."""
    score = Score(Candidate.of("bump", (), lambda p: None, ()), 60.0, 0.0, 1.0, None, {}, single_source=REPETITION)
    assert judge([score], excess, MismatchSettings()).answer == answer


def test_with_two_positions_neither_is_the_single_source():
    case, fit = case_and_fit((1.0, 1.0, 1.0))
    of_two = ImpactCampaigns(2.1, 4.2)
    gains = {"2.1 2025": 0.5, "2.1 2026": -1.0, "4.2 2025": 7.0, "4.2 2026": 6.0, "railcar": 1.0}
    assert single_source(Search(of_two), fit, case.candidates[0], 19.0, gains) == ""
    assert single_source(Search(of_two), fit, case.candidates[0], 15.0, gains) == REPETITION


@pytest.mark.parametrize("gain, answer", [(20.0, "none"), (60.0, "unknown")])
def test_an_effect_of_a_single_recording_has_no_name(gain, answer):
    candidate = Candidate.of("bump", (), lambda p: None, ())
    score = Score(candidate, gain, 0.0, 1.0, None, {"a": gain}, single_source="a")
    verdict = judge([score], 0.8, MismatchSettings())
    assert verdict.answer == answer and not verdict.names
    assert "bump" in verdict.reason
    assert judge([Score(candidate, gain, 0.0, 1.0, None)], 0.8, MismatchSettings()).names == ("bump",)
