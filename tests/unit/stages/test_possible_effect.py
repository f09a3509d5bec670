"""Additions to the answer "none": the most likely effect without enough evidence, and values that differ."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.decision import judge
from turnout.mismatch.engine.score import Score
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan
from turnout.stages.possible_effect import agreement_sentence, scope_of_agreement, sentence_on_possible_effect

FINDING = {"train": None, "axle": None, "channel": None}


@pytest.fixture(scope="module")
def case():
    return PlannedCase(small_plan(), families=("sensor_gain", "local_pad", "unsprung_mass"))


def score_of(case, family, gain, size, error, worst_gain=0.0):
    """Score of the first candidate effect of a family, as a fit with this size gives it."""
    candidate = next(c for c in case.candidates if c.family == family)
    fit = SimpleNamespace(psi=np.array([size]), psi_se=np.array([error]), part=lambda _: slice(0, 1))
    return Score(candidate, gain, worst_gain, 1.0, fit)


def sentence_of(case, *scores):
    return sentence_on_possible_effect(judge(list(scores), 0.9, case.settings), case, FINDING)


def test_the_most_likely_effect_is_stated_with_its_evidence_and_size(case):
    gain, pad = score_of(case, "sensor_gain", 9.23, 1.2, 0.03), score_of(case, "local_pad", 7.0, 0.5, 0.1)
    channel = gain.candidate.where["sensor"]
    assert sentence_of(case, gain, pad) == (
        f"Possible, with 9.2 of the 12 nats (log odds) of evidence that a name needs: “Sensor {channel} reads "
        "1.20 times the true value (95 % interval: 1.14 to 1.26).”"
    )
    place = pad.candidate.where["place"]
    assert f"at {place:.1f} m is 0.50 times as stiff" in sentence_of(case, pad)


def test_the_sentence_of_an_effect_of_a_train_has_the_name_of_the_train(case):
    mass = score_of(case, "unsprung_mass", 6.1, 1.4, 0.05)
    assert f"The wheelsets of {mass.candidate.where['train']} are 1.40 times as heavy" in sentence_of(case, mass)


@pytest.mark.parametrize(("gain", "is_stated"), [(5.9, False), (6.0, True), (12.0, True), (12.1, False)])
def test_an_effect_with_half_to_all_of_the_evidence_for_a_name_is_stated(case, gain, is_stated):
    assert bool(sentence_of(case, score_of(case, "sensor_gain", gain, 1.2, 0.03))) is is_stated
    assert "with 11.9 of the 12 nats" in sentence_of(case, score_of(case, "sensor_gain", 11.99, 1.2, 0.03))


def test_an_effect_that_is_too_small_or_contradicted_is_not_stated(case):
    too_small = score_of(case, "sensor_gain", 9.0, 1.0005, 1e-4)
    assert sentence_of(case, too_small) == "" == sentence_of(case)
    other = score_of(case, "local_pad", 7.0, 0.5, 0.1)
    assert "0.50 times as stiff" in sentence_of(case, too_small, other)
    contradicted = score_of(case, "sensor_gain", 14.7, 1.2, 0.03, worst_gain=-9.0)
    assert sentence_of(case, contradicted) == ""


def test_the_sentence_states_agreement_only_with_other_values_than_those_of_the_files():
    assert agreement_sentence("Both agree.", False) == "Both agree."
    assert agreement_sentence("Both agree.", True) == "Both agree, but only with other values than the files have."


@pytest.mark.parametrize(("n_compared", "n_recorded"), [(6, 6), (0, 0)])
def test_the_sentence_has_no_limitation_if_all_passages_were_compared(n_compared, n_recorded):
    assert scope_of_agreement("Simulation and recordings agree.", n_compared, n_recorded) == (
        "Simulation and recordings agree."
    )


def test_the_sentence_states_the_number_of_passages_that_were_not_compared():
    sentence = scope_of_agreement("Both agree.", 4, 6)
    assert sentence == "Both agree. 2 of 6 passages could not be compared with their simulations: see the notes."
