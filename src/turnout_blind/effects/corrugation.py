"""Corrugation over a stretch of rail: crests sharper than a sine, amplitude largest in the middle of the stretch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, amplitude: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Wavelength, stretch and phase.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    amplitude : float
        Largest amplitude of the waves. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    centre = float(rng.uniform(min(site.sensors) + 1.0, max(site.sensors) - 1.0))
    extent = {"wavelength": float(rng.uniform(0.15, 0.6)), "reach": float(rng.uniform(2.5, 5.0))}
    return {"position": centre}, {"amplitude": float(amplitude), "phase": float(rng.uniform(0.0, 6.28)), **extent}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add the waves to the rail surface.

    Parameters
    ----------
    world : World
        World that is changed.
    site : Site
        The site without the effect.
    where : mapping
        Where the effect is, from ``draw``.
    p : mapping
        Parameters, from ``draw``.
    """

    def dips(x: ArrayLike) -> np.ndarray:
        distance = np.asarray(x) - where["position"]
        phase = 2.0 * np.pi * distance / p["wavelength"] + p["phase"]
        swell = np.cos(0.5 * np.pi * np.clip(distance / p["reach"], -1.0, 1.0))
        return p["amplitude"] * swell * (np.cos(phase) + 0.25 * np.cos(2.0 * phase))

    world.surface.append(dips)


EFFECT = Effect("corrugation", "wavelength", tuple(np.geomspace(4e-6, 1.5e-4, 7)), draw, act)
