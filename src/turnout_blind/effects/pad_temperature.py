"""Pads that soften exponentially with temperature, where a simple model has a linear law."""

import numpy as np

from turnout_blind.effect import Effect


def draw(rng, site, coefficient):
    """Relative loss of stiffness per kelvin."""
    return {}, {"coefficient": float(coefficient)}


def act(world, site, where, p):
    """Multiply the slight softening that every site has."""
    before, rate = world.softening, p["coefficient"]
    world.softening = lambda kelvin: before(kelvin) * float(np.exp(-rate * kelvin))


# Needs two temperatures: with one it is not identifiable, see ``one_temperature``.
LADDER = tuple(np.geomspace(8e-4, 2.5e-2, 7))
EFFECT = Effect("pad_temperature", "condition", LADDER, draw, act, site={"same_temperature": False})
