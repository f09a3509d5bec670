"""Cases of other fields: positions in words, parameters at their bounds, effects that held-out data do not confirm."""

from types import SimpleNamespace

import numpy as np
import pytest
from examples.oscillator_case import OscillatorCase

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import is_same_site
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.decision import PAIR_RULES
from turnout.mismatch.engine.localization import _location_of_candidate
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.rule import first_applicable
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.two_effects import PairEvidence
from turnout.physics import Parameter

SIZE = (Parameter("size", "-", 0.0, (-1.0, 1.0), "of an effect", "made up 2026"),)


def candidate(family, place):
    return Candidate.of(family, SIZE, dict, ((0.1,),), {"place": place}, frame="place")


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [("left bearing", "left bearing", True), ("left bearing", "right bearing", False), (1.0, 1.2, True),
     (1.0, 9.0, False), ("left bearing", 1.0, False)],
)  # fmt: skip
def test_a_position_may_be_a_word(first, second, same):
    assert is_same_site(candidate("soft", first), candidate("loose", second)) is same


def test_a_position_in_words_has_no_coordinate():
    location = _location_of_candidate(Score(candidate("soft", "left bearing"), 20.0, 0.0, 1.0, None))
    assert location.place is None and location.level == "soft[place=left bearing]"


def test_an_oscillator_is_fitted_although_its_frequency_reaches_the_lower_bound():
    """A record without resonance, as of a mass on a far softer spring than assumed: the fit goes to the bound."""
    rng = np.random.default_rng(1)
    u, n = rng.normal(size=1200), 1200
    drift = np.cumsum(np.cumsum(u)) * 1e-4
    records = [("a", "a", u, drift - drift.mean())]
    case = OscillatorCase(records, [], 500.0, (4.0, 40.0), (0.1, 0.1), (1.0, 1.0), skipped=100)
    low = next(x for x in case.nuisances if x.name == "frequency").bounds[0]
    assert 0.0 < low < 0.1
    at_bound = {x.name: x.mean for x in case.nuisances} | {"frequency": low}
    for o, p in zip(case.observations, case.predict(at_bound, (), case.observations)):
        assert p.shape == (n - 100,) and np.all(np.isfinite(p)) and p.shape == o.data.shape
    fit = fit_jointly(case, values=at_bound)
    assert fit.values["frequency"] >= low and np.isfinite(fit.cost)
    assert np.all(np.isfinite(case.latent_covariates(fit)["force"]))
    with pytest.raises(ValueError, match="must be above 0"):
        OscillatorCase(records, [], 500.0, (0.0, 1.0), (0.1, 0.1), (1.0, 1.0))


def pair_evidence(first_error, second_error, change):
    """A pair beside its first effect: errors of their predictions of one held-out recording, and the second's part."""
    wave = np.sin(np.arange(400) / 7.0)
    reserved = Observation("held out", "c", wave, 0.1)
    ripple = np.cos(np.arange(400) * 1.3)
    case = Case()
    case.reserved = (reserved,)
    predictions = {
        "first": wave + first_error * ripple,
        "pair": wave + second_error * ripple + change * np.sign(ripple),
    }
    case.predict = lambda values, terms, observations: [predictions[values["which"]]]
    fits = {k: SimpleNamespace(candidates=(), psi=np.zeros(0), values={"which": k}, terms=()) for k in predictions}
    score = SimpleNamespace(fit=fits["first"])
    verdict = SimpleNamespace(scores=(score,), names=("loose",))
    findings = SimpleNamespace(search=Search(case), fit=fits["pair"], verdicts=(verdict, verdict), is_pair=True)
    evidence = PairEvidence(findings)
    evidence.__dict__["converged_first"] = fits["first"]
    return evidence


@pytest.mark.parametrize(
    ("errors", "change", "improves_nothing"),
    [((0.10, 0.10), 0.05, True), ((0.30, 0.10), 0.0, False), ((0.10, 0.101), 0.0, False)],
    ids=["a fall", "an improvement", "an effect that these recordings do not show"],
)
def test_a_second_name_must_improve_held_out_recordings_in_which_it_shows(
    monkeypatch, errors, change, improves_nothing
):
    from turnout.mismatch.engine import two_effects

    evidence = pair_evidence(*errors, change)
    monkeypatch.setattr(two_effects, "reserved_fit", lambda case, fit: _fit_of(case, fit))
    assert evidence.second_improves_nothing is improves_nothing
    assert evidence.second_fails_reserved is improves_nothing


def _fit_of(case, fit):
    from turnout.mismatch.engine.fit_quality import fit_percent

    predictions = case.predict(fit.values, (), case.reserved)
    return predictions, fit_percent(case.reserved, predictions)


def test_a_second_name_without_improvement_is_withdrawn_and_the_first_stays():
    facts = dict.fromkeys(
        ("is_choice", "both_stand", "first_is_unknown", "first_is_redundant", "second_predicts_worse"), False
    )
    facts |= {"is_pair": True, "second_improves_nothing": True, "second_text": "hardening"}
    rule = first_applicable(PAIR_RULES, SimpleNamespace(**facts))
    assert (rule.name, rule.answer) == ("second_does_not_improve_reserved", "first")
    assert "hardening" in rule.reason_for(SimpleNamespace(**facts))
