"""Each listed term reproduces one number that is known independently."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.physics import HangingSleeper, ZenerPad
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import car, lone_wheels

TRACK = uniform_track(24.0)


def test_a_hanging_sleeper_withholds_the_ballast_up_to_its_gap():
    position = np.zeros(41)
    state = SimpleNamespace(track=TRACK, sleeper_position=position, sleeper_velocity=np.zeros(41))
    term = HangingSleeper(20, 1e-3)
    for y, withheld in ((-2e-4, -90e6 * 2e-4), (4e-4, 90e6 * 4e-4), (1e-3, 90e3), (3e-3, 90e3)):
        position[20] = y
        assert term.force(state)[20] == pytest.approx(withheld)


def test_a_gap_moves_the_load_of_a_wheel_to_the_neighbouring_sleepers():
    """A gap that does not close removes the whole support: the static solution without that ballast."""
    wheel = lone_wheels(700.0, gravity=0.0, pressing=50e3)
    stiffness = TRACK.ballast_stiffness.copy()
    stiffness[20] = 0.0
    without = prepare(TRACK.with_(ballast_stiffness=stiffness), 1e-4)
    rows, weights = without.matrices.rail_weights(12.0)
    known = 50e3 * (weights @ without.static_response(rows, weights)[rows])
    for gap, expected in ((4.9e-3, known), (0.0, None)):
        prepared = prepare(TRACK, 1e-4, terms=(HangingSleeper(20, gap),))
        motion = run(prepared, 1e-3, [], wheel, Drive(12.0, 0.0, entry=0.0)).motion
        found = motion.u[prepared.arrays.pad + rows] @ weights
        if expected is None:
            assert found < 0.8 * known
        else:
            assert found == pytest.approx(expected, rel=1e-6)


def test_a_zener_pad_has_the_dynamic_stiffness_of_its_equation():
    """Between rigid rail and ground a pad with its branch: 1/receptance = k + i w c + r k i w t / (1 + i w t)."""
    term = ZenerPad(0.8, 4e-4)
    track = uniform_track(6.0, layers=1)
    frequency = np.array([20.0, 400.0, 900.0])
    plain, with_branch = assemble(track), assemble(track, (term,))
    assert with_branch.n == plain.n + track.support.size
    # The same track with that complex stiffness at one frequency, put in as stiffness and damping:
    for f in frequency:
        k = term.dynamic_stiffness(track, f)
        same = track.with_(pad_stiffness=np.full(11, k.real), pad_damping=np.full(11, k.imag / (2 * np.pi * f)))
        expected = receptance(assemble(same), [f], 3.0, 3.3)
        assert receptance(with_branch, [f], 3.0, 3.3)[0] == pytest.approx(expected[0], rel=1e-9, abs=0.0)
    assert term.dynamic_stiffness(track, 0.0) == pytest.approx(300e6)
    assert term.dynamic_stiffness(track, 1e6).real == pytest.approx(1.8 * 300e6, rel=1e-3)


def test_parameters_outside_their_bounds_are_rejected():
    prepared = prepare(TRACK, 1e-4, terms=(HangingSleeper(20, -1e-3),))
    with pytest.raises(SimulationError, match=r"gap = -0.001 m is outside 0.0 to 0.005 m"):
        run(prepared, 1e-3, [], car(), Drive(20.0, 1.0, entry=0.0))
    with pytest.raises(SimulationError, match=r"ratio = -1"):
        assemble(TRACK, (ZenerPad(-1.0),))
