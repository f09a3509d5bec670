"""Ballast that stiffens with compression under five sleepers: a quadratic term in the force, as stones interlock."""

import numpy as np

from turnout_blind.effect import Effect, draw_sleeper


def draw(rng, site, rate):
    """Relative increase of secant stiffness per metre of compression."""
    return draw_sleeper(rng, site), {"rate": float(rate)}


def act(world, site, where, p):
    """F = k y (1 + h |y|)."""
    world.hardening[where["sleeper"] - 2 : where["sleeper"] + 3] = p["rate"]


EFFECT = Effect("hardening", "amplitude", tuple(np.geomspace(150.0, 8000.0, 7)), draw, act)
