"""Ballast that stiffens with compression under five sleepers: a quadratic term in the force, as stones interlock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, rate: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Relative increase of secant stiffness per metre of compression.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    rate : float
        Relative increase of secant stiffness per compression. [1/m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sleeper(rng, site), {"rate": float(rate)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """F = k y (1 + h |y|).

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
    world.hardening[where["sleeper"] - 2 : where["sleeper"] + 3] = p["rate"]


EFFECT = Effect("hardening", "amplitude", tuple(np.geomspace(150.0, 8000.0, 7)), draw, act)
