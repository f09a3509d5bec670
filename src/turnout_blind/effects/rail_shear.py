"""A rail with lower shear stiffness than its description says."""

from dataclasses import replace

from turnout_blind.effect import Effect


def draw(rng, site, factor):
    """Factor on the shear stiffness."""
    return {}, {"factor": float(factor)}


def act(world, site, where, p):
    """Multiply the shear stiffness by the factor."""
    world.rail = replace(world.rail, shear=world.rail.shear * p["factor"])


EFFECT = Effect("rail_shear", "condition", (0.95, 0.88, 0.8, 0.7, 0.6, 0.5, 0.4), draw, act)
