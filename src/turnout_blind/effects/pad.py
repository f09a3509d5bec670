"""A worn, missing or wrongly replaced pad at one sleeper: its stiffness changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, ratio: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Factor on stiffness, below or above 1.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    ratio : float
        Factor on the stiffness, or its inverse. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sleeper(rng, site), {"factor": float(ratio if rng.random() < 0.6 else 1.0 / ratio)}


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


EFFECT = Effect("pad", "place", (0.88, 0.75, 0.6, 0.45, 0.33, 0.24, 0.16), draw, act)
