"""A worn and flattened nose of a crossing: the surface behind its tip lies lower, and falls to it more steeply.

Noses lose height by wear and plastic flow over some decimetres behind the tip (Palsson and Nielsen 2012, Vehicle System
Dynamics 50). The owner's file has the depth of the last survey.
"""

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

ROUNDING = 0.03  # half of the length over which the worn tip is rounded [m]
STEP = 0.005  # step of the search for the tip [m]


def wear_depth(x: ArrayLike, position: float, depth: float, length: float, share: float) -> np.ndarray:
    """Loss of height: two parabolic slopes of unequal length that meet in a rounded tip.

    Parameters
    ----------
    x : (n,) array of float
        Positions. [m]
    position : float
        Position of the tip. [m]
    depth : float
        Loss of height at the tip. [m]
    length : float
        Length of both slopes together. [m]
    share : float
        Share of the length before the tip.

    Returns
    -------
    (n,) array of float
        Loss of height, down positive. [m]
    """
    distance = np.asarray(x) - position
    reach = np.where(distance < 0.0, share * length, (1.0 - share) * length)
    rounded = np.sqrt(distance**2 + ROUNDING**2) - ROUNDING
    return depth * np.clip(1.0 - rounded / reach, 0.0, None) ** 2


def draw(rng: np.random.Generator, site: Site, depth: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Depth and length of the wear, and its share before the tip.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        A site in a crossing panel without the effect.
    depth : float
        Loss of height at the tip. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.

    Raises
    ------
    ValueError
        If the site has no crossing.
    """
    if site.crossing is None:
        raise ValueError("only a crossing has a nose that can wear")
    x = site.crossing.nose + np.arange(-0.5, 0.5, STEP)
    position = float(x[np.argmax(site.world.surface[0](x))])  # the true tip: the file's is off by some centimetres
    shape = {"length": float(rng.uniform(0.5, 1.2)), "share": float(rng.uniform(0.25, 0.5))}
    return {"position": position}, {"depth": float(depth), **shape}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Lower the rail surface at the nose.

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
    world.surface.append(lambda x: wear_depth(x, where["position"], p["depth"], p["length"], p["share"]))


LADDER = tuple(float(d) for d in np.geomspace(1e-4, 2.5e-3, 7))
EFFECT = Effect("nose", "place", LADDER, draw, act, "history", {"panel": "crossing"})
