"""A bad pad too far from all sensors to be observed: no effect at all gives the same recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

DISTANCE_FROM_SENSORS = 13.0  # distance of the sleeper from the nearest sensor [m]


def draw(rng: np.random.Generator, site: Site, factor: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Factor on the stiffness of a pad before the first sensor or behind the last.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    factor : float
        Factor on the stiffness of the pad. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    before = rng.random() < 0.5
    j = site.world.nearest(
        min(site.sensors) - DISTANCE_FROM_SENSORS if before else max(site.sensors) + DISTANCE_FROM_SENSORS
    )
    return {"sleeper": j, "position": float(site.world.position[j])}, {"factor": float(factor)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Multiply stiffness by the factor and damping by its square root.

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
    world.pad[where["sleeper"]] *= p["factor"]
    world.pad_damping[where["sleeper"]] *= p["factor"] ** 0.5


EFFECT = Effect("beyond_reach", "place", (0.5, 0.36, 0.25, 0.16), draw, act, "unidentifiable")
