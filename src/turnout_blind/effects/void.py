"""A hanging sleeper: first over a part of its bed, then over all of it. The gap closes gradually, stone by stone.

A complete gap of any size shows in hammer tests, since nothing supports the unloaded sleeper. Voids grow from partial
ones (Kaewunruen and Remennikov 2008, Dynamic properties of railway track). Low rungs therefore keep a share of the
ballast stiffness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, level: tuple[float, float]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Gap, share of the bed that still bears, compression over which the gap closes, and growth per passage.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    level : (float, float)
        Gap [m], and share of the bed that still bears [-].

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    gap, seated = level
    close = float(gap * rng.uniform(0.1, 0.4))
    return draw_sleeper(rng, site), {"gap": float(gap), "seated": float(seated), "close": close, "growth": 0.02}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Open the gap: beside the share that bears, ballast reacts only when the gap is closed.

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
    j = where["sleeper"]
    world.gap[j], world.seated[j], world.close[j] = p["gap"], p["seated"], p["close"]
    world.wear_per_passage[j] = (p["gap"] * p["growth"], 1.0)


LADDER = ((5e-5, 0.97), (1e-4, 0.92), (2e-4, 0.82), (3.5e-4, 0.62), (7e-4, 0.35), (1.3e-3, 0.0), (2.5e-3, 0.0))
EFFECT = Effect("void", "place", LADDER, draw, act)
