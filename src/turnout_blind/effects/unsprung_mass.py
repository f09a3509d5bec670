"""Wheelsets of one train heavier than its vehicle file says: brake discs, or a motor carried by the axle.

A driven axle counts 1.7 t or 4.2 t, depending on how its motor is carried (class 86, Bjork 1970).
"""

from turnout_blind.effect import Effect


def draw(rng, site, factor):
    """Train and factor."""
    return {"train": str(rng.choice(sorted(site.trains)))}, {"factor": float(factor)}


def act(world, site, where, p):
    """Multiply the unsprung mass by the factor."""
    world.wheel_mass[where["train"]] = world.wheel_mass.get(where["train"], 1.0) * p["factor"]


EFFECT = Effect("unsprung_mass", "train", (1.04, 1.12, 1.24, 1.4, 1.6, 1.85, 2.1), draw, act)
