"""A loose block of a guard rail that rattles between two stops on the rail, steel on steel."""

import numpy as np

from turnout_blind.effect import Effect

STOP_STIFFNESS = 8e8  # stiffness of the stops [N/m]


def draw(rng, site, level):
    """Mass and play, from the head of a bolt in a wide hole to a length of guard rail in a narrow one."""
    mass, play = level
    position = float(rng.uniform(min(site.sensors), max(site.sensors)))
    return {"position": position}, {"mass": float(mass), "play": float(play * np.exp(0.2 * rng.normal()))}


def act(world, site, where, p):
    """Attach the mass by a soft spring (6 Hz) and stops."""
    k = p["mass"] * (2.0 * np.pi * 6.0) ** 2
    world.attached_masses.append((where["position"], p["mass"], k, 0.1 * k / 40.0, p["play"], STOP_STIFFNESS))


LADDER = ((4.0, 4e-4), (15.0, 2e-4), (60.0, 8e-5), (200.0, 2.5e-5))
EFFECT = Effect("guard_rail_rattle", "place", LADDER, draw, act, "outside")
