"""A sleeper with a gap that no train closes: missing ballast would give the same recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, gap: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """A gap larger than every deflection.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    gap : float
        Gap, larger than every deflection. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sleeper(rng, site), {"gap": float(gap)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Open the gap: the ballast never reacts.

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
    world.gap[where["sleeper"]], world.close[where["sleeper"]] = p["gap"], 0.2 * p["gap"]


EFFECT = Effect("bottomless_void", "place", (0.01, 0.012, 0.015, 0.02), draw, act, "unidentifiable")
