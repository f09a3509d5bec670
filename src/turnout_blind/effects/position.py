"""A sensor at another position than its description says."""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign


def draw(rng, site, shift):
    """Shift along the rail [m]."""
    return draw_sensor(rng, site), {"shift": float(shift) * draw_sign(rng)}


def act(world, site, where, p):
    """Add to true position minus described position."""
    world.sensor_shift[where["sensor"]] = world.sensor_shift.get(where["sensor"], 0.0) + p["shift"]


EFFECT = Effect("position", "sensor", tuple(np.geomspace(0.03, 0.6, 7)), draw, act)
