"""Chairs that differ from each other: errors of receptances, one for each value of each chair."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.turnout.chair_parameters import chair_columns, chair_gradients
from turnout.mismatch.turnout.chair_scatter import CHAIR_SCATTER, chair_errors, with_chair_errors
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan
from turnout.physics.heel_support import HeelSupport
from turnout.simulate.blade import Blade

STEP = 2e-3


@pytest.fixture(scope="module")
def case():
    """Impacts in the middle of the blade and behind its heel."""
    plan = small_plan((15.0,), passages=False, hammer_positions=(23.4, 26.4))
    track = plan.turnout.track
    blade = Blade(20.1, 25.2, 32.0, track.rail, 3e8, 3e4)
    return PlannedCase(replace(plan, turnout=replace(plan.turnout, track=track.with_(blade=blade))))


def values_of(case):
    return {n.name: n.mean for n in case.nuisances}


def test_the_column_of_a_chair_is_the_difference_quotient_by_that_chair_alone(case):
    """A term changes the stiffness of one chair by a share, and its damping by half of that share."""
    predictor, values = case.predictor, values_of(case)
    track = predictor.track()
    chairs = list(track.blade.chairs(track))
    for pair in list(case.frf_pairs.values())[:4]:
        sensitivity = predictor.pair_sensitivity(values, (), pair)
        row, columns = sensitivity.row_of(pair), chair_columns(sensitivity)
        for number in (1, 4, len(track.blade.slide_chairs(track)) + 1):
            support = chairs[number]
            h = [
                predictor.pair_sensitivity(values, (HeelSupport(support, support, 1.0 + d),), pair).receptance(pair)
                for d in (STEP, -STEP)
            ]
            expected = (h[0] - h[1]) / (2.0 * STEP)
            column = columns["chair_stiffness"][row, number] + 0.5 * columns["chair_damping"][row, number]
            assert np.max(np.abs(column - expected)) < 1e-3 * np.max(np.abs(expected))


def test_all_columns_together_are_the_derivative_by_the_common_value(case):
    pair = next(iter(case.frf_pairs.values()))
    sensitivity = case.predictor.pair_sensitivity(values_of(case), (), pair)
    columns = chair_columns(sensitivity)
    for name, gradient in chair_gradients(sensitivity).items():
        assert np.sum(columns[name], axis=1) == pytest.approx(gradient, rel=1e-9, abs=1e-30)


def test_the_variance_of_an_observation_is_that_of_drawn_chairs(case):
    """2,000 draws of all chairs, each with its own scatter, through the linear response."""
    rng, values, pairs = np.random.default_rng(5), values_of(case), list(case.frf_pairs.values())
    errors = chair_errors(case.predictor, values, pairs)
    sensitivity = case.predictor.pair_sensitivity(values, (), pairs[0])
    columns = chair_columns(sensitivity)
    for o, pair in zip(case.observations, pairs):
        plain = replace(o, modes=None)
        modes = with_chair_errors(plain, pair, errors[pair.name]).modes
        drawn = 0.0
        for name, column in columns.items():
            deviations = CHAIR_SCATTER[name] * rng.normal(size=(2000, column.shape[1]))
            drawn = drawn + deviations @ column[sensitivity.row_of(pair)]
        drawn = drawn[:, pair.lines] / pair.size
        sample = np.column_stack([drawn.real, drawn.imag])
        assert np.sum(modes**2, axis=1) == pytest.approx(np.mean(sample**2, axis=0), rel=0.15, abs=1e-9)


def test_observations_of_a_switch_have_errors_of_chairs_and_those_of_plain_track_do_not(case):
    pairs = list(case.frf_pairs.values())
    errors = chair_errors(case.predictor, values_of(case), pairs)
    for o, pair in zip(case.observations, pairs):
        own = errors[pair.name].shape[1]
        assert own > 0
        expected = with_chair_errors(replace(o, modes=None), pair, errors[pair.name]).modes
        assert np.array_equal(o.modes[:, -own:], expected)
    plain = PlannedCase(small_plan((15.0,), passages=False, hammer_positions=(23.4,)))
    assert not chair_errors(plain.predictor, values_of(plain), list(plain.frf_pairs.values()))
