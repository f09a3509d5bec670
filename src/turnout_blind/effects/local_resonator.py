"""A mass on a spring under the rail, such as a loose heating rod or stretcher bar, unknown to the model."""

import numpy as np

from turnout_blind.effect import Effect


def draw(rng, site, mass):
    """Mass, frequency on a fixed rail, damping ratio."""
    position = float(rng.uniform(min(site.sensors), max(site.sensors)))
    more = {"frequency": float(rng.uniform(60.0, 260.0)), "damping": float(rng.uniform(0.01, 0.05))}
    return {"position": position}, {"mass": float(mass), **more}


def act(world, site, where, p):
    """Attach the mass to the rail."""
    omega = 2.0 * np.pi * p["frequency"]
    k, c = p["mass"] * omega**2, 2.0 * p["damping"] * p["mass"] * omega
    world.attached_masses.append((where["position"], p["mass"], k, c, 1.0, 0.0))


EFFECT = Effect("local_resonator", "place", (20.0, 40.0, 70.0, 120.0), draw, act, "outside")
