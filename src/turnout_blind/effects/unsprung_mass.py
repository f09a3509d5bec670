"""Wheelsets of one train heavier than its vehicle file says: brake discs left out, then a motor hung on the axle.

A driven axle counts 1.7 t or 4.2 t as its motor is carried (class 86, Bjork 1970): a wrong sheet is wrong by a factor.
"""

from turnout_blind.effect import Effect


def draw(rng, site, factor):
    """Train and factor."""
    return {"train": str(rng.choice(sorted(site.trains)))}, {"factor": float(factor)}


def act(world, site, where, p):
    """Factor on the unsprung mass."""
    world.wheel_mass[where["train"]] = world.wheel_mass.get(where["train"], 1.0) * p["factor"]


EFFECT = Effect("unsprung_mass", "train", (1.04, 1.12, 1.24, 1.4, 1.6, 1.85, 2.1), draw, act)
