"""A train that rolls the other way over the mirrored track gives the same signals and contact forces."""

import numpy as np

from turnout.simulate.passage import simulate_passage
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import uniform_track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import car
from turnout.simulate.wheel_path import Kink

LENGTH = 30.0  # m
RAMP = np.linspace(0.6, 1.5, 51)  # of the stiffness of pads and ballast, from one end to the other


def passage(is_mirrored):
    """Signals and contact forces over track whose ends differ, with a kink between two sensors."""
    track = uniform_track(LENGTH, end_length=3.0, end_damping=300.0)
    ramp = RAMP[::-1] if is_mirrored else RAMP
    track = track.with_(pad_stiffness=ramp * track.pad_stiffness, ballast_stiffness=ramp * track.ballast_stiffness)

    def at(x):
        return LENGTH - x if is_mirrored else x

    turnout = TurnoutTrack(track, {"main": ((Kink(at(14.0), 1e-3, 0.4, 0.5),),)})
    sensors = [Sensor("a", at(12.0), cutoff=None), Sensor("b", at(17.3), cutoff=None)]
    direction = "trailing" if is_mirrored else "facing"
    _, truth = simulate_passage(
        turnout, car(), 40.0, sensors, direction=direction, truth=True, lead=0.2, tail=0.1, entry=4.0
    )
    return truth.clean, truth.force


def test_a_trailing_train_is_the_mirror_image_of_a_facing_one():
    for mirrored, facing in zip(passage(True), passage(False)):
        # rounding of positions alone, 1e-15 of 30 m, which contact and elements make larger
        np.testing.assert_allclose(mirrored, facing, atol=1e-7 * np.max(np.abs(facing)))
