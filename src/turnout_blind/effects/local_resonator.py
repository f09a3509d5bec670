"""A mass on a spring under the rail, such as a loose heating rod or stretcher bar, unknown to the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, mass: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mass, frequency on a fixed rail, damping ratio.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    mass : float
        Mass of the resonator. [kg]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    position = float(rng.uniform(min(site.sensors), max(site.sensors)))
    more = {"frequency": float(rng.uniform(60.0, 260.0)), "damping": float(rng.uniform(0.01, 0.05))}
    return {"position": position}, {"mass": float(mass), **more}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Attach the mass to the rail.

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
    omega = 2.0 * np.pi * p["frequency"]
    k, c = p["mass"] * omega**2, 2.0 * p["damping"] * p["mass"] * omega
    world.attached_masses.append((where["position"], p["mass"], k, c, 1.0, 0.0))


EFFECT = Effect("local_resonator", "place", (20.0, 40.0, 70.0, 120.0), draw, act, "outside")
