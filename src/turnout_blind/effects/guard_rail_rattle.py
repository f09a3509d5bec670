"""A guard rail's block that lies loose between two stops on the rail and rattles."""

import numpy as np

from turnout_blind.effect import Effect


def draw(rng, site, mass):
    """Mass and play of the block."""
    place = float(rng.uniform(min(site.sensors), max(site.sensors)))
    return {"position": place}, {"mass": float(mass), "play": float(rng.uniform(3e-5, 1.5e-4))}


def act(world, site, where, p):
    """A soft spring (6 Hz) carries it, stops of 40 MN/m catch it."""
    k = p["mass"] * (2.0 * np.pi * 6.0) ** 2
    world.riders.append((where["position"], p["mass"], k, 0.1 * k / 40.0, p["play"], 4e7))


EFFECT = Effect("guard_rail_rattle", "place", (20.0, 50.0, 110.0, 220.0), draw, act, "outside")
