"""Single supports beside their position in the file are errors of receptances."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.case import TrackCase
from turnout.mismatch.turnout.observed_tests import observe_tests
from turnout.mismatch.turnout.planned_case import PlannedCase, measured_campaign, small_plan
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.support_scatter import support_errors

POSITIONS = (21.6, 24.0)


@pytest.fixture(scope="module")
def case():
    return PlannedCase(small_plan((15.0,), passages=False, hammer_positions=POSITIONS), families=("local_pad",))


def moved_predictor(case, offsets):
    """Predictor of a track whose supports lie ``offsets`` (n_support,) [m] beside those of the file."""
    predictor = case.predictor
    zone = predictor.site.nominal
    track = replace(zone.turnout.track, support=zone.turnout.track.support + offsets)
    site = replace(predictor.site, nominal=replace(zone, turnout=replace(zone.turnout, track=track)))
    return Predictor(site, predictor.solver).with_recordings(predictor.frf_pairs, {})


def values_of(case):
    return {n.name: n.mean for n in case.nuisances}


def test_errors_are_derivatives_by_the_position_of_each_support(case):
    """All supports that move by a millimetre change a receptance by a tenth of the sum of the errors."""
    errors = support_errors(case.predictor, values_of(case), case.observations)
    zone, shift = case.predictor.site.nominal, 1e-3
    offsets = np.zeros(zone.turnout.track.support.size)
    offsets[list(zone.effect_supports)] = shift
    before, after = (
        p.predict(values_of(case), (), case.observations) for p in (case.predictor, moved_predictor(case, offsets))
    )
    for old, new, error in zip(before, after, errors):
        assert error.shape == (old.size, len(zone.effect_supports))
        by_sum = error.sum(axis=1) * shift / TRACK.support_position_sd
        single = np.linalg.norm(error, axis=0) * shift / TRACK.support_position_sd
        # a bay of 0.6 m has a wave of that length: a step of 5 mm errs by 2.6 % of the first order, sin(x) by x / 2
        assert np.linalg.norm(new - old - by_sum) < 0.026 * single.sum()


def test_a_bay_that_is_three_centimetres_shorter_leaves_no_more_than_other_errors(case):
    zone = case.predictor.site.nominal
    support = zone.turnout.track.support
    offsets = np.zeros(support.size)
    first = int(np.argmin(np.abs(support - 22.8)))
    offsets[first], offsets[first + 1] = 0.016, -0.016
    recorded = moved_predictor(case, offsets).predict(values_of(case), (), case.observations)
    filed = case.predictor.predict(values_of(case), (), case.observations)
    n_error = len(zone.effect_supports)
    squares = []
    for o, data, prediction in zip(case.observations, recorded, filed):
        alone = replace(o, modes=o.modes[:, :-n_error])
        squares.append([float(np.sum(np.square(x.whiten(data - prediction)))) for x in (o, alone)])
    with_them, without = np.transpose(squares)
    # two supports at 1.6 standard deviations cost no more than 5.1, to the 2.6 % of the test above
    assert np.all(with_them < 1.026**2 * np.minimum(without, 2 * 1.6**2))
    assert with_them.sum() < 0.5 * without.sum()


def test_errors_of_tests_at_one_position_are_counted_once():
    """Two tests with an error of √2 each give their mean the error of one."""
    plain = Observation("a", "a", np.zeros(2), 1e-3)
    twice = plain.with_errors(np.array([[1.0], [1.0]]), 2)
    np.testing.assert_allclose(twice.modes, np.sqrt(2.0) * np.ones((2, 1)), rtol=1e-12, atol=0.0)
    again = twice.with_errors(np.array([[0.0], [3.0]]))
    np.testing.assert_allclose(again.modes[:, 1], [0.0, 3.0], rtol=1e-12, atol=0.0)


def test_recorded_tests_have_the_errors_of_every_support():
    campaign = measured_campaign(small_plan((15.0,), passages=False, hammer_positions=POSITIONS), (), 3)
    recorded = TrackCase(campaign, families=("local_pad",))
    for (_, plain), o in zip(
        observe_tests(campaign, MismatchSettings().pair_tolerance).observations, recorded.observations
    ):
        assert plain.name == o.name
        assert o.modes.shape[1] == plain.modes.shape[1] + len(recorded.data.site.nominal.effect_supports)
