"""Derivatives of receptances by parameters of terms, without solving the track again."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.turnout import TrackCase, receptance_observation
from turnout.mismatch.turnout.added_links import AddedLinks
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.receptance_changes import changed_links
from turnout.mismatch.turnout.screening import _pair_channel_changes
from turnout.simulate import uniform_track
from turnout.simulate.turnout_track import TurnoutTrack

J = 27


@pytest.fixture(scope="module")
def case_and_values():
    """(case, nuisances that differ from their means and between supports); the rail is that of the models."""
    small = small_plan((25.0,), passages=False, hammer_positions=(21.6, 24.0))
    turnout = TurnoutTrack(uniform_track(36.0, start=6.0), {"main": ((),)})
    plan = replace(small, turnout=turnout, n_impacts=3, sensors=small.sensors[:3])
    case, rng = TrackCase(measured_campaign(plan, (), 3)), np.random.default_rng(0)
    values = {n.name: n.mean + 0.3 * n.sd * rng.standard_normal() for n in case.nuisances}
    return case, values | {"rail_bending": 0.0, "rail_shear": 0.0}


def relative_error(case, values, old, new):
    """Relative error of the predicted step from ``old`` to ``new``."""
    before = case.predict(values, (old,), case.observations)
    short = np.concatenate(case.predict_near(values, (old,), (new,), case.observations, before))
    exact, before = np.concatenate(case.predict(values, (new,), case.observations)), np.concatenate(before)
    return np.linalg.norm(short - exact) / np.linalg.norm(exact - before)


@pytest.mark.parametrize(
    "term",
    [
        lambda s: physics.LocalBallast(J, 0.5 + 0.01 * s),
        lambda s: physics.LocalPad(J, 2.0 + 0.02 * s),
        lambda s: physics.HangingSleeper(J, 4e-4, 0.3 + 0.01 * s),
        lambda s: physics.AttachedResonator(J, 20.0, 180.0 + s),
        lambda s: physics.PadTemperature(0.005 + 1e-4 * s),
        lambda s: physics.ZenerPad(0.5 + 0.01 * s),
        lambda s: physics.SleeperMode(0.25, 200.0 + s),
        lambda s: physics.BallastInertia(120.0 + s, 1e3),
    ],
)
def test_a_step_of_a_parameter_is_right_to_first_order(case_and_values, term):
    """The error of a tangent is of second order: a quarter of the step has a quarter of the relative error."""
    whole, quarter = (relative_error(*case_and_values, term(0.0), term(s)) for s in (1.0, 0.25))
    assert quarter < 0.05
    assert quarter == pytest.approx(whole / 4.0, rel=0.1)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (physics.RailShear(1.0), physics.RailShear(1.1)),
        (physics.TimeOffset("S2", 1e-3), physics.TimeOffset("S2", 1.1e-3)),
        (physics.SensorPosition("S3", 0.1), physics.SensorPosition("S3", 0.15)),
        (physics.DryFriction(J, 0.0), physics.DryFriction(J, 100.0)),
    ],
)
def test_a_step_that_is_no_change_of_links_is_predicted_exactly(case_and_values, old, new):
    """Another rail, a channel, a link that was not there."""
    assert relative_error(*case_and_values, old, new) < 1e-9


def test_a_change_to_other_links_is_no_small_step(case_and_values):
    case, values = case_and_values
    model = case.predictor.pair_sensitivity(
        values, (physics.LocalBallast(J, 0.5),), next(iter(case.frf_pairs.values()))
    ).model
    assert changed_links(model, (physics.LocalBallast(J + 1, 0.5),)) is None
    assert changed_links(model, (physics.LocalPad(J, 0.5),)) is None
    ends, impedance = changed_links(model, (physics.LocalBallast(J, 0.5),))
    assert ends.shape[0] == 0 and impedance.shape == (0, receptance_observation.LINES.size)


def test_tests_of_several_days_share_solutions_that_do_not_depend_on_the_day(case_and_values):
    """The track and the pairs are the same, unless pads are softer on the warmer day, which needs two solutions."""
    case, values = case_and_values
    pairs = {n: replace(p, conditions={"rail_temperature": 5.0}) for n, p in case.frf_pairs.items()}
    pairs |= {f"{n} later": replace(p, conditions={"rail_temperature": 25.0}) for n, p in case.frf_pairs.items()}
    predictor = case.predictor.with_recordings(pairs, {})
    name = next(iter(case.frf_pairs))
    for terms, is_shared in (((), True), ((physics.PadTemperature(0.01),), False)):
        sensitivity_of = predictor.pair_sensitivities(values, terms)
        early, late = sensitivity_of(pairs[name]), sensitivity_of(pairs[f"{name} later"])
        assert (early is late) == is_shared
        assert len(early.row) == len({(p.test.place, p.seat) for p in case.frf_pairs.values()})
        softer = np.linalg.norm(early.receptance(pairs[name]) - late.receptance(pairs[f"{name} later"]))
        assert (softer == 0.0) == is_shared


def test_an_added_link_changes_a_receptance_as_a_track_that_has_it(case_and_values):
    """A pad, and a mass on a spring, at three supports, at their starts: one link each, so exact."""
    case, values = case_and_values
    chosen = [(c, 0) for c in case.candidates if c.family in ("local_pad", "attached_resonator")][::7]
    added = AddedLinks(case.predictor, values, (), chosen)
    for o in case.observations[:3]:
        (before,) = case.predict(values, (), [o])
        for (c, k), found in zip(chosen, added.changes(case.frf_pairs[o.name]).values()):
            (after,) = case.predict(values, (c.term(c.starts[k]),), [o])
            assert np.linalg.norm(found - (after - before)) < 1e-9 * np.linalg.norm(after - before)


def test_the_effect_of_a_channel_on_a_receptance_is_that_of_the_case(case_and_values):
    """A gain, a lag, a corner frequency: exact. Another seat: exact except for the correction of the rail, which is
    that of the old seat. With the rail two hundredths from its grid the error is below that share of the change."""
    case, values = case_and_values
    values = values | {"rail_shear": 0.02}
    predicted = case.predict(values, (), case.observations)
    fit, families = SimpleNamespace(values=values, terms=(), predictions=predicted), set()
    chosen = [(c, 0) for c in case.candidates if c.term(c.starts[0]).column_type == "channel"]
    for o, old in zip(case.observations, predicted):
        for c, found in zip(*_compared(case, fit, o, old, chosen)):
            (after,) = case.predict(values, (c.term(c.starts[0]),), [o])
            allowed = 0.02 if c.family == "sensor_position" else 1e-9
            assert np.linalg.norm(found - (after - old)) <= allowed * np.linalg.norm(after - old) + 1e-12, c.key
            families.add(c.family)
    assert {"sensor_gain", "sensor_position", "low_pass", "mount_resonance"} <= families


def _compared(case, fit, observation, old, chosen):
    """Candidates on the channel of an observation, and their columns."""
    found = _pair_channel_changes(case, fit, observation, old, chosen)
    return [c for c, k in chosen if (c.key, k) in found], found.values()


def test_pairs_of_different_lines_are_predicted_together_as_each_alone(case_and_values):
    """Predictions and derivatives, beside a soft pad; one pair has a third of its lines, one is given twice."""
    case, values = case_and_values
    term, (first, second, *_) = physics.LocalPad(J, 0.6), case.observations
    pair = case.frf_pairs[first.name]
    fewer = replace(pair, frequency=pair.frequency[::3], size=pair.size[::3])
    predictor = case.predictor.with_recordings({**case.frf_pairs, first.name: fewer}, {})
    observations = [second, replace(first, data=first.data[: 2 * fewer.size.size], sigma=0.1, modes=None, cells=None)]
    observations.append(second)
    together = predictor.predict(values, (term,), observations)
    whole = case.predictor.predict(values, (term,), [first, second])
    every_third = np.concatenate([half[::3] for half in np.split(whole[0], 2)])
    for found, expected in zip(together, (whole[1], every_third, whole[1])):
        assert np.allclose(found, expected, atol=0.0, rtol=1e-12)
    near = physics.LocalPad(J, 0.61)
    steps = predictor.predict_near(values, (term,), (near,), observations, together)
    whole_step = case.predictor.predict_near(values, (term,), (near,), [first, second], whole)
    expected_step = np.concatenate([half[::3] for half in np.split(whole_step[0], 2)])
    assert np.allclose(steps[1], expected_step, atol=0.0, rtol=1e-12)
    assert np.linalg.norm(steps[1] - together[1]) > 1e-5
    jacobians = predictor.nuisance_jacobian(case.nuisances, values, (term,), observations, together)
    whole_jacobians = case.predictor.nuisance_jacobian(case.nuisances, values, (term,), [first, second], whole)
    expected = np.concatenate([half[::3] for half in np.split(whole_jacobians[0], 2)])
    assert np.allclose(jacobians[1], expected, atol=1e-12 * np.abs(expected).max(), rtol=1e-12)
    assert np.array_equal(jacobians[0], jacobians[2])


@pytest.mark.parametrize("name", ["gain_S3", "rail_shear", f"pad_{J}", "ballast_damping"])
def test_a_derivative_of_all_pairs_is_the_direction_of_their_predictions(case_and_values, name):
    case, values = case_and_values
    k, step = [n.name for n in case.nuisances].index(name), 1e-5
    before = case.predict(values, (), case.observations)
    column = np.concatenate([j[:, k] for j in case.nuisance_jacobian(values, (), case.observations, before)])
    sides = (
        np.concatenate(case.predict({**values, name: values[name] + s}, (), case.observations)) for s in (step, -step)
    )
    difference = np.subtract(*sides) / (2.0 * step)
    assert np.linalg.norm(column - difference) < 1e-3 * np.linalg.norm(difference)


def test_a_sensor_moved_from_the_rail_to_a_sleeper_is_another_seat(case_and_values):
    """The same channel at the same position has another mounting in the second test: each pair is predicted as if
    alone."""
    case, values = case_and_values
    first, second = [o for o in case.observations if ":S1" in o.name][:2]
    sleeper = replace(case.frf_pairs[second.name].sensor, mounting="sleeper")
    pairs = {**case.frf_pairs, second.name: replace(case.frf_pairs[second.name], sensor=sleeper)}
    found = case.predictor.with_recordings(pairs, {})
    (alone,), (beside,) = case.predict(values, (), [first]), found.predict(values, (), [first])
    assert np.allclose(alone, beside, atol=0.0, rtol=1e-9)
    (there,), (moved,) = case.predict(values, (), [second]), found.predict(values, (), [second])
    assert np.linalg.norm(moved - there) > 0.1 * np.linalg.norm(there)
