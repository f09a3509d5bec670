"""Fastenings that barely hold the rail down: the pads of three sleepers act in compression and hardly in uplift."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, lift: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Stiffness in uplift over that in compression.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    lift : float
        Stiffness in uplift over that in compression. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sleeper(rng, site), {"lift": float(lift)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Give three pads another stiffness in uplift.

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
    world.lift[where["sleeper"] - 1 : where["sleeper"] + 2] = p["lift"]


EFFECT = Effect("bilinear_clip", "place", (0.95, 0.8, 0.5, 0.1), draw, act, "outside")
