"""A loose block of a guard rail that rattles between two stops on the rail, steel on steel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

STOP_STIFFNESS = 8e8  # stiffness of the stops [N/m]


def draw(rng: np.random.Generator, site: Site, level: tuple[float, float]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mass and play, from the head of a bolt in a wide hole to a length of guard rail in a narrow one.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    level : (float, float)
        Mass [kg] and median play [m].

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    mass, play = level
    position = float(rng.uniform(min(site.sensors), max(site.sensors)))
    return {"position": position}, {"mass": float(mass), "play": float(play * np.exp(0.2 * rng.normal()))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Attach the mass by a soft spring (6 Hz) and stops.

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
    k = p["mass"] * (2.0 * np.pi * 6.0) ** 2
    world.attached_masses.append((where["position"], p["mass"], k, 0.1 * k / 40.0, p["play"], STOP_STIFFNESS))


LADDER = ((4.0, 4e-4), (15.0, 2e-4), (60.0, 8e-5), (200.0, 2.5e-5))
EFFECT = Effect("guard_rail_rattle", "place", LADDER, draw, act, "outside")
