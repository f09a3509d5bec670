"""A blow: what of the track and of its terms the hammer meets."""

import numpy as np

from turnout.physics import TERMS, SurfaceDip
from turnout.simulate import Hammer, Sensor, simulate_hammer, uniform_track

TRACK, MASS, VELOCITY = uniform_track(30.0), 5.5, 1.2
HAMMER = Hammer(MASS, VELOCITY, velocity_spread=0.0, place_spread=0.0, force=Sensor("hammer", 15.0, "hammer", "force"))
SHORT = {"n_blows": 1, "duration": 0.05, "pretrigger": 0.005}


def blow(**options):
    return simulate_hammer(TRACK, 15.0, HAMMER, **SHORT, **options)[0].samples


def test_a_free_mass_gives_the_rail_at_most_twice_its_momentum_whatever_wheels_roll_on():
    """It bounces off a track at rest with at most the speed it came with; 1 % for the anti-alias filter."""
    paths = tuple(term.example() for term in TERMS if term.kind == "path")
    found, bare = blow(terms=(SurfaceDip(15.0, -1e-3, 0.6), *paths)), blow()
    assert len(paths) >= 5
    assert 1.0 < found[0].sum() / 20e3 / (MASS * VELOCITY) < 2.02
    assert np.array_equal(found, bare)
