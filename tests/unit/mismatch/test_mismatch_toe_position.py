"""The toe of a blade may be a few centimetres from its position in the file: hammer tests determine it."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import PlannedCase, measured_campaign, small_plan
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.toe_position import TOE, toe_nuisances, with_toe
from turnout.simulate.blade import Blade
from turnout.simulate.sensor import Sensor

TOE_OF_FILE, SHIFT = 22.05, 0.04


def plan_with_toe(toe):
    """Impacts 0.3 m behind a toe between bearers at 21.6 and 22.2 m."""
    plan = small_plan((15.0,), passages=False, hammer_positions=(22.5,))
    track = plan.turnout.track
    blade = Blade(toe, 26.4, 32.0, track.rail, 3e8, 3e4)
    return replace(plan, n_impacts=3, turnout=replace(plan.turnout, track=track.with_(blade=blade)))


@pytest.fixture(scope="module")
def case():
    return PlannedCase(plan_with_toe(TOE_OF_FILE))


def means(case):
    return {n.name: n.mean for n in case.nuisances}


def receptance(case, pair, values):
    return case.predictor.pair_sensitivity(values, (), pair).receptance(pair)


def test_a_shift_predicts_the_receptances_of_a_blade_that_begins_there(case):
    moved = PlannedCase(plan_with_toe(TOE_OF_FILE + SHIFT))
    for name, pair in case.frf_pairs.items():
        expected = receptance(moved, moved.frf_pairs[name], means(moved))
        found = receptance(case, pair, means(case) | {TOE: SHIFT})
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.max(np.abs(expected)))


def test_the_derivative_is_that_of_central_differences():
    """Beside the toe, and of impact and sensor in the two elements that end at it."""
    plan = plan_with_toe(TOE_OF_FILE)
    beside = Sensor("S1", TOE_OF_FILE - 0.03), Sensor("S2", TOE_OF_FILE + 0.09)
    points = tuple((TOE_OF_FILE + x, 15.0) for x in (-0.05, 0.08, 0.45))
    case = PlannedCase(replace(plan, sensors=(*beside, *plan.sensors[2:]), hammer_points=points))
    step = 2e-4
    for pair in case.frf_pairs.values():
        sensitivity = case.predictor.pair_sensitivity(means(case), (), pair)
        h = [receptance(case, pair, means(case) | {TOE: d}) for d in (step, -step)]
        expected = (h[0] - h[1]) / (2.0 * step)
        found = sensitivity.toe_gradients[sensitivity.row_of(pair)]
        assert np.linalg.norm(found - expected) < 1e-3 * np.linalg.norm(expected)


def test_the_derivative_at_a_bound_is_not_0(case):
    bounds = next(n.bounds for n in case.nuisances if n.name == TOE)
    for shift in bounds:
        (pair, *_) = case.frf_pairs.values()
        sensitivity = case.predictor.pair_sensitivity(means(case) | {TOE: shift}, (), pair)
        assert np.linalg.norm(sensitivity.toe_gradients[sensitivity.row_of(pair)]) > 0.0


def test_a_fit_finds_the_shift_in_receptances_that_have_no_other_error(case):
    exact = copy(case)
    predicted = case.predictor.predict(means(case) | {TOE: SHIFT}, (), case.observations)
    pairs = zip(case.observations, predicted)
    exact.observations = tuple(replace(o, data=p, sigma=0.02 * o.sigma, modes=None) for o, p in pairs)
    fit = fit_jointly(exact)
    assert fit.values[TOE] == pytest.approx(SHIFT, abs=2e-3)


def test_the_error_by_chairs_is_within_the_stated_uncertainty_of_the_toe():
    """Recordings, simulated in time, of a blade that begins 4 cm nearer to its first chair than in the file."""
    recorded = measured_campaign(plan_with_toe(TOE_OF_FILE + SHIFT), (), 3)
    case = TrackCase(replace(recorded, turnout=plan_with_toe(TOE_OF_FILE).turnout))
    fit = fit_jointly(case)
    column = [n.name for n in case.nuisances].index(TOE)
    error = np.sqrt(fit.covariance[column, column])
    assert abs(fit.values[TOE] - SHIFT) < 2.5 * error and error < TRACK.toe_sd


def test_only_a_toe_between_bearers_is_uncertain_and_it_stays_there(case):
    track = plan_with_toe(TOE_OF_FILE).turnout.track
    (nuisance,) = toe_nuisances([track.with_(blade=None), track])
    # six standard deviations; a tenth of a bay before 22.2 m
    assert nuisance.bounds == pytest.approx((-0.18, 0.09), abs=1e-6)
    for shift in nuisance.bounds:
        moved = with_toe(track, {TOE: shift})
        assert moved.blade.chairs(moved) == track.blade.chairs(track)
    assert toe_nuisances([track.with_(blade=None)]) == []
    assert toe_nuisances([plan_with_toe(21.63).turnout.track]) == []  # on a bearer
    assert with_toe(track, {}) is track
