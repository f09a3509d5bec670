"""Slide chairs that open under impacts: receptances with them agree with a simulation in time."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.mismatch.blade_turnout import with_blade

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.lifting_chairs import lifting_chairs, with_lifting_error
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.receptance_observation import local_rms
from turnout.physics.slide_chair_gap import SlideChairGap


@pytest.fixture(scope="module")
def case():
    """Three impacts in the middle of the blade, on a track as in the file, simulated with chairs that only press."""
    plan = small_plan((15.0,), passages=False, hammer_positions=(23.4,))
    turnout = with_blade(plan.turnout)
    return TrackCase(measured_campaign(replace(plan, turnout=turnout, n_impacts=3), (), 3))


def rms_error(case, lifting):
    """Relative error of the receptances of the track in the file, rms over all lines and sensors."""
    predictor = case.predictor.with_lifting(lifting)
    values = {n.name: n.mean for n in case.nuisances}
    predicted = predictor.predict(values, (), case.observations)
    errors = [o.data - p for o, p in zip(case.observations, predicted)]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2) * 2.0))


def file_chairs(case):
    return lifting_chairs(case.predictor.site.nominal.turnout.track_of("main"), case.frf_pairs.values())


def test_receptances_with_chairs_that_open_agree_with_a_simulation_in_time(case):
    """The recordings are simulated at 20 kHz with the hammer as a mass; linear receptances err by a tenth and more."""
    assert rms_error(case, None) > 0.1
    assert rms_error(case, file_chairs(case)) < 0.35 * rms_error(case, None)


def test_only_a_track_with_slide_chairs_has_this_correction(case):
    assert rms_error(case, case.predictor.lifting) < 0.35 * rms_error(case, None)
    assert case.hammer_case().predictor.lifting is case.predictor.lifting
    plain = case.predictor.site.nominal.turnout.track_of("main").with_(blade=None)
    assert lifting_chairs(plain, case.frf_pairs.values()) is None


def test_a_weak_impact_opens_no_chair(case):
    """At a hundredth of the force the weight of the blade keeps all chairs closed."""
    chairs = file_chairs(case)
    weak = replace(
        chairs,
        tests=tuple(replace(t, impact=replace(t.impact, force=0.01 * t.impact.force)) for t in chairs.tests),
        changes={},
    )
    for pair in case.frf_pairs.values():
        assert np.max(np.abs(weak.change(pair, ()))) < 1e-3 * np.max(np.abs(chairs.change(pair, ())))


def test_chairs_without_contact_do_not_open(case):
    chairs = file_chairs(case)
    track = chairs.track
    gaps = [SlideChairGap(j, 2e-3) for j in track.blade.slide_chairs(track)]
    for pair in case.frf_pairs.values():
        some, none = chairs.change(pair, gaps[:1]), chairs.change(pair, gaps)
        assert np.max(np.abs(none)) < 1e-4 * np.max(np.abs(some))
        small = SlideChairGap(gaps[0].support, 1e-4)  # it closes under the weight of the blade
        assert np.array_equal(chairs.change(pair, (small,)), chairs.change(pair, ()))


def test_the_change_is_uncertain_by_half_its_size(case):
    """Its error is among the modes of an observation: their variance is a quarter of the mean square of the change."""
    chairs, pairs = file_chairs(case), case.frf_pairs
    for o in case.observations:
        plain = replace(o, modes=None)
        change = chairs.change(pairs[o.name], ())
        modes = with_lifting_error(plain, pairs[o.name], change).modes
        size = np.abs(change[pairs[o.name].lines]) / pairs[o.name].size
        assert np.mean(np.sum(modes**2, axis=1)) == pytest.approx(0.5**2 * np.mean(size**2), rel=0.3)


def information(case, lifting):
    """Information on one amplitude of the change that all tests have in common, smooth over frequency."""
    total = 0.0
    for o in case.observations:
        pair = case.frf_pairs[o.name]
        size = local_rms(pair.frequency, np.abs(lifting.change(pair, ())[pair.lines]) / pair.size)
        total += o.effective * float(np.sum(o.whiten(np.concatenate([size, 0.0 * size])) ** 2))
    return total


def test_a_repeated_test_does_not_reduce_the_error_by_the_same_chairs(case):
    """Chairs open in the same way at each visit: the error belongs to the model, not to a visit."""
    test, *_ = case.campaign.hammer
    repeated = TrackCase(replace(case.campaign, hammer=(test, replace(test, name="again"))))
    assert len(repeated.observations) == 2 * len(case.observations)
    chairs = lifting_chairs(case.predictor.lifting.track, repeated.frf_pairs.values())
    assert information(repeated, chairs) < 1.2 * information(case, chairs)
    (reserved,) = TrackCase(
        replace(case.campaign, hammer=(test, replace(test, name="again")), reserved=("again",))
    ).observations[:1]
    (alone,) = case.observations[:1]
    assert np.sum(reserved.modes**2) == pytest.approx(np.sum(alone.modes**2), rel=0.05)
