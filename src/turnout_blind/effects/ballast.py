"""Ballast softer or stiffer under one sleeper, and a third as much (in logarithms) under one neighbour."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sign, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, ratio: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Factor on stiffness. For stiffer ballast the logarithm of the factor is 0.6 times that for softer.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    ratio : float
        Factor on the stiffness of softer ballast. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    factor = ratio if rng.random() < 0.65 else ratio**-0.6
    return draw_sleeper(rng, site), {"factor": float(factor), "side": draw_sign(rng)}


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
    for j, share in ((where["sleeper"], 1.0), (where["sleeper"] + int(p["side"]), 0.33)):
        world.ballast[j] *= p["factor"] ** share
        world.ballast_damping[j] *= p["factor"] ** (0.5 * share)


EFFECT = Effect("ballast", "place", (0.9, 0.8, 0.65, 0.5, 0.35, 0.22, 0.12), draw, act)
