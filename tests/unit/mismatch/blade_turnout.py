"""A turnout with the blade of a switch, for the tests of its chairs and of its heel."""

from dataclasses import replace

from turnout.simulate.blade import Blade
from turnout.simulate.wheel_path import BladeTop, StockFall


def with_blade(turnout):
    """The turnout with a blade from 20.1 m to the heel at 32.0 m, to which the wheels change."""
    track = turnout.track
    return replace(
        turnout,
        track=track.with_(blade=Blade(20.1, 25.2, 32.0, track.rail, 3e8, 3e4)),
        routes={"main": ((StockFall(21.6, 3.0, 0.02),), (BladeTop(20.1, 3.0, 0.015),))},
    )
