"""Pads that soften with temperature, in campaigns at one temperature: they cannot be distinguished from soft pads."""

import numpy as np

from turnout_blind.effect import Effect


def draw(rng, site, coefficient):
    """Relative loss of stiffness per kelvin."""
    return {}, {"coefficient": float(coefficient)}


def act(world, site, where, p):
    """Soften the pads as ``pad_temperature`` does."""
    before, rate = world.softening, p["coefficient"]
    world.softening = lambda kelvin: before(kelvin) * float(np.exp(-rate * kelvin))


EFFECT = Effect(
    "one_temperature", "condition", (0.004, 0.007, 0.01, 0.013), draw, act, "unidentifiable", {"same_temperature": True}
)
