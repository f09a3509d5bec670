"""Hammer tests localize a cause without a name at several supports, and a nonlinear one."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.engine.localization import locate
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.residual_spaces import source_spaces
from turnout.simulate import uniform_track
from turnout.simulate.turnout_track import TurnoutTrack


@pytest.fixture(scope="module")
def case():
    plan = small_plan((5.0,), passages=False, hammer_positions=(21.6, 24.0, 26.7))
    turnout = TurnoutTrack(uniform_track(36.0, start=6.0), {"main": ((),)})
    return TrackCase(measured_campaign(replace(plan, turnout=turnout, n_impacts=3), (), 3))


def changes_of(case, positions, sizes):
    """Change of each observation by pads at ``positions``, ``sizes`` impact -> logarithm of their stiffness."""
    support, means = case.predictor.track().support, {n.name: n.mean for n in case.nuisances}
    pads = [f"pad_{np.argmin(np.abs(support - x))}" for x in positions]
    changes = []
    for o in case.observations:
        changed = means | dict.fromkeys(pads, sizes[case.frf_pairs[o.name].test.place])
        changes.append(case.predict(changed, (), [o])[0] - case.predict(means, (), [o])[0])
    return changes


def share_outside(change, columns):
    solution = np.linalg.lstsq(columns, change, rcond=1e-12)[0]
    return np.linalg.norm(change - columns @ solution) / np.linalg.norm(change)


def test_the_effect_of_two_pads_is_that_of_a_force_at_each_of_them(case):
    """Woodbury: the change of a receptance by two links is that of two forces, for any size of the change.

    No sensor is on one of these sleepers, where it would also record the link itself.
    """
    sizes = {21.6: 0.4, 24.0: -0.7, 26.7: -1.2}
    changes = dict(zip((o.name for o in case.observations), changes_of(case, (24.0, 24.6), sizes)))
    fit = replace(fit_jointly(case, iterations=0), values={n.name: n.mean for n in case.nuisances})
    spaces = [s for s in source_spaces(case, fit) if s.law == "free" and ("place", (24.0, 24.6)) in s.combinations]
    assert len(spaces) == 3
    for space in spaces:
        change = np.concatenate([changes[name] for name in space.names])
        both = space.columns[:, space.combinations["place", (24.0, 24.6)]]
        assert share_outside(change, both) < 1e-9
        assert share_outside(change, space.columns[:, space.combinations["place", 24.0]]) > 0.02


@pytest.mark.parametrize(
    "positions, sizes",
    [
        ((22.2, 22.8, 23.4), {21.6: 0.4, 24.0: -0.32, 26.7: -0.5}),
        ((24.6, 25.2, 25.8), {21.6: 0.16, 24.0: 0.73, 26.7: -0.18}),
        ((21.6,), {21.6: 0.53, 24.0: -0.24, 26.7: 0.55}),
    ],
)
def test_pads_whose_stiffness_depends_on_the_impact_are_located(case, positions, sizes):
    """No linear change of the track does this; fastenings that lift do."""
    changed = copy(case)
    pairs = zip(case.observations, changes_of(case, positions, sizes))
    changed.observations = tuple(replace(o, data=o.data + change) for o, change in pairs)
    changed.place_level = 0.0  # these recordings have no errors of a model
    found = locate(changed, fit_jointly(changed, iterations=30))
    centre = 0.5 * (positions[0] + positions[-1])
    assert found.frame == "place"
    assert abs(found.place - centre) < 0.61  # one bay
    assert found.low - 0.01 <= centre <= found.high + 0.01
    assert found.high - found.low < 1.9


def test_a_late_channel_is_no_cause_at_the_supports_beside_it(case):
    """Every impact shows the same delay. Forces at two supports, different for each impact, explain it less well."""
    late, observations = copy(case), []
    for o in case.observations:
        pair, (real, imaginary) = case.frf_pairs[o.name], np.split(o.data, 2)
        shifted = (real + 1j * imaginary) * np.exp(-2j * np.pi * pair.frequency * 3e-4 * (pair.channel == "S3"))
        observations.append(replace(o, data=np.concatenate([shifted.real, shifted.imag])))
    late.observations = tuple(observations)
    found = locate(late, fit_jointly(late, iterations=30))
    assert (found.frame, found.sensor) == ("sensor", "S3")


def changes_within(case, name, size, low, high):
    """Change of each observation by ``size`` of a logarithm, between two frequencies [Hz]."""
    means, changes = {n.name: n.mean for n in case.nuisances}, []
    for o in case.observations:
        frequency = np.tile(case.frf_pairs[o.name].frequency, 2)
        change = case.predict(means | {name: size}, (), [o])[0] - case.predict(means, (), [o])[0]
        changes.append(change * ((frequency > low) & (frequency < high)))
    return changes


@pytest.mark.parametrize("name", ["pad_stiffness", "ballast_stiffness", "rail_bending", "rail_shear"])
def test_a_small_change_of_the_whole_track_is_proportional_to_the_derivative_by_its_value(case, name):
    """To first order the change is the derivative, with any factor at each frequency."""
    fit = replace(fit_jointly(case, iterations=0), values={n.name: n.mean for n in case.nuisances})
    (space,) = (s for s in source_spaces(case, fit) if s.law == name and ("frequency", "track") in s.combinations)
    changes = dict(zip((o.name for o in case.observations), changes_within(case, name, 1e-3, 300.0, 500.0)))
    assert share_outside(np.concatenate([changes[n] for n in space.names]), space.columns) < 2e-3


@pytest.mark.parametrize("name, size", [("rail_shear", -0.6), ("pad_stiffness", 0.4)])
def test_an_effect_of_the_whole_track_in_one_band_has_no_position(case, name, size):
    """No value of the base model does this; pads with several parameters or a rail soft in shear do."""
    changed = copy(case)
    changes = changes_within(case, name, size, 400.0, 600.0)
    changed.observations = tuple(replace(o, data=o.data + c) for o, c in zip(case.observations, changes))
    assert locate(changed, fit_jointly(changed, iterations=30)).frame == "frequency"
