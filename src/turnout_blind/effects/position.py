"""A sensor at another position than its description says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, shift: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Shift along the rail [m].

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    shift : float
        Distance from the described position. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sensor(rng, site), {"shift": float(shift) * draw_sign(rng)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add to true position minus described position.

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
    world.sensor_shift[where["sensor"]] = world.sensor_shift.get(where["sensor"], 0.0) + p["shift"]


EFFECT = Effect("position", "sensor", tuple(np.geomspace(0.03, 0.6, 7)), draw, act)
