"""A V-shaped, unsymmetric dip of the rail surface, its point rounded over 3 cm by wear."""

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


def dip_depth(x: ArrayLike, position: float, depth: float, length: float, share: float) -> np.ndarray:
    """Depth of the dip: two slopes of unequal length that meet in a rounded point.

    Parameters
    ----------
    x : (n,) array of float
        Positions. [m]
    position : float
        Position of the lowest point. [m]
    depth : float
        Depth of the dip. [m]
    length : float
        Length of both slopes together. [m]
    share : float
        Share of the length before the lowest point.

    Returns
    -------
    (n,) array of float
        Depth, down positive. [m]
    """
    distance = np.asarray(x) - position
    reach = np.where(distance < 0.0, share * length, (1.0 - share) * length)
    rounded = np.sqrt(distance**2 + 0.015**2) - 0.015
    return depth * np.clip(1.0 - rounded / reach, 0.0, None)


def draw(rng: np.random.Generator, site: Site, depth: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Position between the sensors, depth, length, and share of the length before the point.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    depth : float
        Depth of the dip. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    position = float(rng.uniform(min(site.sensors) - 0.5, max(site.sensors) + 0.5))
    shape = {"length": float(rng.uniform(0.3, 1.0)), "share": float(rng.uniform(0.35, 0.65))}
    return {"position": position}, {"depth": float(depth), **shape}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add the dip to the rail surface.

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
    world.surface.append(lambda x: dip_depth(x, where["position"], p["depth"], p["length"], p["share"]))


EFFECT = Effect("dip", "place", tuple(np.geomspace(1.5e-5, 1.5e-3, 7)), draw, act)
