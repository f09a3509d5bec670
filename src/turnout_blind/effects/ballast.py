"""Ballast softer or stiffer under one sleeper, and a third as much (in logarithms) under one neighbour."""

from turnout_blind.effect import Effect, draw_sign, draw_sleeper


def draw(rng, site, ratio):
    """Factor on stiffness. For stiffer ballast the logarithm of the factor is 0.6 times that for softer."""
    factor = ratio if rng.random() < 0.65 else ratio**-0.6
    return draw_sleeper(rng, site), {"factor": float(factor), "side": draw_sign(rng)}


def act(world, site, where, p):
    """Multiply stiffness by the factor and damping by its square root."""
    for j, share in ((where["sleeper"], 1.0), (where["sleeper"] + int(p["side"]), 0.33)):
        world.ballast[j] *= p["factor"] ** share
        world.ballast_damping[j] *= p["factor"] ** (0.5 * share)


EFFECT = Effect("ballast", "place", (0.9, 0.8, 0.65, 0.5, 0.35, 0.22, 0.12), draw, act)
