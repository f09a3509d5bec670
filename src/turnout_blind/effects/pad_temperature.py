"""Pads that soften exponentially with temperature (a linear law is what a simple model would have)."""

import numpy as np

from turnout_blind.effect import Effect


def draw(rng, site, coefficient):
    """Relative loss per kelvin."""
    return {}, {"coefficient": float(coefficient)}


def act(world, site, where, p):
    """Multiplies the slight softening that every site has."""
    before, rate = world.softening, p["coefficient"]
    world.softening = lambda kelvin: before(kelvin) * float(np.exp(-rate * kelvin))


# Two temperatures: with one it is not identifiable, which is ``one_temperature``.
LADDER = tuple(np.geomspace(8e-4, 2.5e-2, 7))
EFFECT = Effect("pad_temperature", "condition", LADDER, draw, act, site={"same_temperature": False})
