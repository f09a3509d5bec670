"""A blade that is worn, or chipped, where wheels come onto it."""

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

ROUNDING = 0.02  # length over which wheels have rounded the ends of the worn part [m]


def lost_height(x: ArrayLike, position: float, depth: float, length: float) -> np.ndarray:
    """Lost height: a flat loss with ends like an error function.

    Parameters
    ----------
    x : (n,) array of float
        Positions. [m]
    position : float
        Middle. [m]
    depth : float
        Lost height. [m]
    length : float
        Length between the points of half the depth. [m]

    Returns
    -------
    (n,) array of float
        [m]
    """
    distance = np.abs(np.asarray(x) - position)
    return 0.5 * depth * (1.0 - np.tanh((distance - 0.5 * length) / (ROUNDING + 0.15 * length)))


def draw(rng: np.random.Generator, site: Site, depth: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Where both tops are level, give or take; depth, and a length of a chip or of wear.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        A site in a switch panel without the effect.
    depth : float
        Lost height. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    blade = site.world.blade
    assert blade is not None
    x = np.arange(blade.switch.toe, blade.switch.heel, 0.005)
    level = x[np.argmax(blade.switch.blade_top(x) < blade.switch.stock_top(x))]
    position = float(level + rng.uniform(-0.1, 0.4))
    return {"position": position}, {"depth": float(depth), "length": float(rng.uniform(0.25, 1.2))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Lower the top of the blade.

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
    assert world.blade is not None
    world.blade.surface.append(lambda x: lost_height(x, where["position"], p["depth"], p["length"]))


LADDER = tuple(np.geomspace(1e-4, 4e-3, 7))
EFFECT = Effect("toe", "place", LADDER, draw, act, "switch", {"panel": "switch"})
