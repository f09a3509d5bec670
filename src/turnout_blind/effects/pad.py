"""A worn, missing or wrongly replaced pad at one sleeper: its stiffness changes."""

from turnout_blind.effect import Effect, draw_sleeper


def draw(rng, site, ratio):
    """Factor on stiffness, below or above 1."""
    return draw_sleeper(rng, site), {"factor": float(ratio if rng.random() < 0.6 else 1.0 / ratio)}


def act(world, site, where, p):
    """Multiply stiffness by the factor and damping by its square root."""
    world.pad[where["sleeper"]] *= p["factor"]
    world.pad_damping[where["sleeper"]] *= p["factor"] ** 0.5


EFFECT = Effect("pad", "place", (0.88, 0.75, 0.6, 0.45, 0.33, 0.24, 0.16), draw, act)
