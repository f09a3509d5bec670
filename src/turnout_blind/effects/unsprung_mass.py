"""Wheelsets of one train heavier than its vehicle file says."""

from turnout_blind.effect import Effect


def draw(rng, site, factor):
    """Train and factor."""
    return {"train": str(rng.choice(sorted(site.trains)))}, {"factor": float(factor)}


def act(world, site, where, p):
    """Factor on the unsprung mass."""
    world.wheel_mass[where["train"]] = world.wheel_mass.get(where["train"], 1.0) * p["factor"]


EFFECT = Effect("unsprung_mass", "train", (1.04, 1.1, 1.18, 1.28, 1.42, 1.6, 1.85), draw, act)
