"""A simulation that fails at some values loses only the result at these values, not the diagnosis."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout.errors import SimulationError
from turnout.mismatch import diagnose
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import CampaignInput, TrackCase
from turnout.mismatch.turnout.campaign import PassageInput
from turnout.mismatch.turnout.candidates.short_polygons import short_polygon_candidates, wheel_excess
from turnout.mismatch.turnout.prediction import Predictor
from turnout.physics import Parameter

AMOUNT = (Parameter("amount", "-", 0.0, (-9.0, 9.0), "share of a wave", "made up 2026"),)
X = np.linspace(0.0, 1.0, 200)
WAVE = np.sin(9.0 * X)


class Brittle(Case):
    """A wave of 1.2 in three recordings and in one that is held out; ``is_divergent`` (terms, observations) raises."""

    def __init__(self, is_divergent):
        rng, self.is_divergent = np.random.default_rng(5), is_divergent
        found = [Observation(f"o{k}", f"day {k}", 1.2 * WAVE + 0.1 * rng.normal(size=X.size), 0.1) for k in range(4)]
        self.observations, self.reserved = tuple(found[:3]), tuple(found[3:])
        self.candidates = (Candidate.of("wave", AMOUNT, lambda p: p["amount"], ((0.5,),)),)

    def predict(self, values, terms, observations):
        if self.is_divergent(terms, observations):
            raise SimulationError("Newton's iteration did not converge")
        return [sum(terms) * WAVE for _ in observations]


def test_a_name_whose_held_out_recordings_cannot_be_simulated_is_withdrawn():
    """Without the failure it is named, and the fit with it is stated."""
    sound = diagnose(Brittle(lambda terms, observations: False))
    assert sound.names == ("wave",) and sound.verification.after > 80.0
    found = diagnose(Brittle(lambda terms, observations: bool(terms) and observations[0].name == "o3"))
    assert found.verdict.answer == "unknown" and not found.names
    assert found.verification.n == 1


def test_if_no_held_out_recording_can_be_simulated_the_others_decide():
    found = diagnose(Brittle(lambda terms, observations: observations[0].name == "o3"))
    assert found.names == ("wave",)
    assert np.isnan(found.verification.before) and found.verification.after is None


def test_a_large_fit_keeps_its_updated_derivatives_if_new_ones_fail():
    """From 3 to the true 1.2 in steps; the derivatives fail from the second time on."""

    class Dear(Case):
        is_large, n_calls = True, 0
        nuisances = (Nuisance("amount", "-", 3.0, 1.0),)
        observations = (Observation("o", "day", 1.2 * WAVE, 0.1),)

        def predict(self, values, terms, observations):
            return [(values["amount"] + 0.3 * values["amount"] ** 2 - 0.432) * WAVE]

        def nuisance_jacobian(self, values, terms, observations, base):
            self.n_calls += 1
            if self.n_calls > 1:
                raise SimulationError("it fails beside")
            return super().nuisance_jacobian(values, terms, observations, base)

    case = Dear()
    found = fit_jointly(case, iterations=12)
    assert case.n_calls > 1
    assert found.values["amount"] == pytest.approx(1.2, abs=0.05)  # five standard errors


def test_a_train_of_two_lengths_is_rejected():
    """Wheels are counted from the front: the ninth of eight is no wheel."""
    long, short = (PassageInput(f"p{n}", None, SimpleNamespace(wheels=range(n)), 20.0, "freight") for n in (12, 8))
    with pytest.raises(SimulationError, match="'freight' has 12 and 8 wheels"):
        CampaignInput(None, (), passages=(long, short))


def test_a_passage_that_cannot_be_simulated_has_a_note_and_the_others_are_used(monkeypatch):
    campaign = intact_campaign((24.0,), 3)
    (first, *_), names = campaign.passages, {p.name for p in campaign.passages}

    simulator_of = Predictor.passage_simulator

    def choosy_simulator(predictor, values, terms, passage):
        if passage.name == first.name:
            raise SimulationError("wheel 3 leaves the track")
        return simulator_of(predictor, values, terms, passage)

    monkeypatch.setattr(Predictor, "passage_simulator", choosy_simulator)
    case = TrackCase(campaign)
    assert any(first.name in note and "wheel 3 leaves" in note for note in case.notes)
    assert names - {first.name} >= set(case.aligned_passages) and len(case.aligned_passages) > 2


def test_wheels_in_no_fitted_recording_are_no_candidates_of_polygons():
    """No recording contains them; a recording with a too low rate for short waves has no bin for them either."""
    nothing = SimpleNamespace(level=np.full((2, 4, 60), np.nan))
    z, apart = wheel_excess([nothing], np.arange(20, 40), np.exp(-0.04 * np.arange(60)))
    assert apart == 0 and np.all(np.isneginf(z)) and z.shape == (4, 20)
    slow = SimpleNamespace(speed=30.0, passage=SimpleNamespace(recording=SimpleNamespace(rate=100.0)))
    assert short_polygon_candidates(SimpleNamespace(fitted_passages=lambda: [slow]), None) == ()
