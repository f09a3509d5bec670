"""Fastenings that barely hold the rail down: the pads of three sleepers act in compression and hardly in uplift."""

from turnout_blind.effect import Effect, draw_sleeper


def draw(rng, site, lift):
    """Stiffness in uplift over that in compression."""
    return draw_sleeper(rng, site), {"lift": float(lift)}


def act(world, site, where, p):
    """Give three pads another stiffness in uplift."""
    world.lift[where["sleeper"] - 1 : where["sleeper"] + 2] = p["lift"]


EFFECT = Effect("bilinear_clip", "place", (0.95, 0.8, 0.5, 0.1), draw, act, "outside")
