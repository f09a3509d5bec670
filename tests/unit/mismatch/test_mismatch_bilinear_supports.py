"""Receptances beside loose fastenings: with the simulated change they agree with recordings that are simulated."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.mismatch.blade_turnout import with_blade

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.bilinear_supports import bilinear_terms
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.receptance_changes import changed_links, predict_near
from turnout.physics import LocalPad, LooseFastening, SlideChairGap

POSITION = 23.4  # of the impacts and of the middle of three loose fastenings [m]


def loose_about(track, lost=0.8, damper=0.3):
    """Three loose fastenings by the numbers of their supports on a track; a case has a shorter one than a plan."""
    middle = int(np.argmin(np.abs(track.support - POSITION)))
    return LooseFastening(middle - 1, middle + 1, lost, damper)


@pytest.fixture(scope="module")
def case():
    """Three impacts; the hammer is a mass, at 20 kHz, and supports do not scatter."""
    plan = small_plan((15.0,), passages=False, hammer_positions=(POSITION,))
    loose = loose_about(plan.turnout.track_of("main"))
    return TrackCase(measured_campaign(replace(plan, n_impacts=3, scatter=0.0), (loose,), 3))


@pytest.fixture(scope="module")
def loose(case):
    return loose_about(case.predictor.track())


def file_values(case):
    return {n.name: n.mean for n in case.nuisances}


def rms_error(case, *terms):
    """Relative error of the receptances of the track in the file with ``terms``, rms over all lines and sensors."""
    predicted = case.predictor.predict(file_values(case), terms, case.observations)
    errors = [o.data - p for o, p in zip(case.observations, predicted)]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2) * 2.0))


def test_receptances_agree_with_simulated_impacts_where_no_linear_pad_does(case, loose):
    """Pads of 1 - 0.8 / 2 of their stiffness, and stiffer or softer ones, err by a third and more."""
    for factor in (1.0, 0.6, 0.2):
        assert rms_error(case, *(LocalPad(j, factor) for j in loose.supports)) > 0.33
    assert rms_error(case, loose) < 0.25  # of an intact track 0.17, by gains, noise and positions


def test_fastenings_that_lose_nothing_change_nothing(case, loose):
    assert rms_error(case, loose.neutral()) == rms_error(case)


def test_a_small_step_of_a_share_is_simulated_and_not_taken_from_links(case, loose):
    """Links have the mean of both stiffnesses alone."""
    values, other = file_values(case), replace(loose, lost=0.81)
    old = case.predictor.predict(values, (loose,), case.observations)
    near = predict_near(case.predictor, values, (loose,), (other,), case.observations, old)
    new = case.predictor.predict(values, (other,), case.observations)
    for a, b in zip(near, new):
        assert np.allclose(a, b, atol=1e-12, rtol=1e-9)
    (_, samples), *_ = case.predictor.pair_samples(values, (loose,), case.observations)
    assert changed_links(samples.sensitivity.model, (other,)) is None


def test_a_chair_without_contact_is_not_bilinear():
    """It is linear about rest, with and without contact; chairs that open have a correction of their own."""
    track = with_blade(small_plan((15.0,), passages=False).turnout).track_of("main")
    chairs = track.blade.slide_chairs(track)
    for gap in (3e-5, 2e-4, 2e-3):
        terms = [SlideChairGap(j, gap) for j in chairs]
        assert any(term.ports(track) for term in terms)
        assert bilinear_terms(terms, track) == ()
