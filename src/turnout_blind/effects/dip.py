"""A V-shaped, unsymmetric dip of the rail surface, its point rounded over 3 cm by wear."""

import numpy as np

from turnout_blind.effect import Effect


def dip_depth(x, position, depth, length, share):
    """Depth of the dip at ``x`` [m]: two slopes of unequal length that meet in a rounded point."""
    distance = np.asarray(x) - position
    reach = np.where(distance < 0.0, share * length, (1.0 - share) * length)
    rounded = np.sqrt(distance**2 + 0.015**2) - 0.015
    return depth * np.clip(1.0 - rounded / reach, 0.0, None)


def draw(rng, site, depth):
    """Position between the sensors, depth, length, and share of the length before the point."""
    position = float(rng.uniform(min(site.sensors) - 0.5, max(site.sensors) + 0.5))
    shape = {"length": float(rng.uniform(0.3, 1.0)), "share": float(rng.uniform(0.35, 0.65))}
    return {"position": position}, {"depth": float(depth), **shape}


def act(world, site, where, p):
    """Add the dip to the rail surface."""
    world.surface.append(lambda x: dip_depth(x, where["position"], p["depth"], p["length"], p["share"]))


EFFECT = Effect("dip", "place", tuple(np.geomspace(1.5e-5, 1.5e-3, 7)), draw, act)
