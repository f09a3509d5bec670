"""Corrugation over a stretch of rail: crests sharper than a sine, amplitude largest in the middle of the stretch."""

import numpy as np

from turnout_blind.effect import Effect


def draw(rng, site, amplitude):
    """Wavelength, stretch and phase."""
    centre = float(rng.uniform(min(site.sensors) + 1.0, max(site.sensors) - 1.0))
    extent = {"wavelength": float(rng.uniform(0.15, 0.6)), "reach": float(rng.uniform(2.5, 5.0))}
    return {"position": centre}, {"amplitude": float(amplitude), "phase": float(rng.uniform(0.0, 6.28)), **extent}


def act(world, site, where, p):
    """Add the waves to the rail surface."""

    def dips(x):
        distance = np.asarray(x) - where["position"]
        phase = 2.0 * np.pi * distance / p["wavelength"] + p["phase"]
        swell = np.cos(0.5 * np.pi * np.clip(distance / p["reach"], -1.0, 1.0))
        return p["amplitude"] * swell * (np.cos(phase) + 0.25 * np.cos(2.0 * phase))

    world.surface.append(dips)


EFFECT = Effect("corrugation", "wavelength", tuple(np.geomspace(4e-6, 1.5e-4, 7)), draw, act)
