"""A sleeper that hangs above its ballast; the gap closes softly, stone after stone, and grows from train to train."""

import numpy as np

from turnout_blind.effect import Effect, sleeper_near


def draw(rng, site, gap):
    """Gap, the length over which it closes, its growth per passage."""
    return sleeper_near(rng, site), {"gap": float(gap), "close": float(gap * rng.uniform(0.1, 0.4)), "growth": 0.02}


def act(world, site, where, p):
    """Ballast reacts only below the gap."""
    j = where["sleeper"]
    world.gap[j], world.close[j] = p["gap"], p["close"]
    world.wear_per_passage[j] = (p["gap"] * p["growth"], 1.0)


EFFECT = Effect("void", "place", tuple(np.geomspace(5e-5, 2.5e-3, 7)), draw, act)
