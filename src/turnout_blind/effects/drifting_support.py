"""Wet ballast that loses stiffness during a passage and recovers partly before the next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sleeper

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, loss: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Share of stiffness lost per second of a record, and factor from passage to passage.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    loss : float
        Share of stiffness lost per second. [1/s]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sleeper(rng, site), {"loss": float(loss), "factor": float(rng.uniform(0.85, 0.95))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Change three sleepers.

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
    for j in range(where["sleeper"] - 1, where["sleeper"] + 2):
        world.drift[j] = -p["loss"]
        world.wear_per_passage[j] = (0.0, p["factor"])


EFFECT = Effect("drifting_support", "place", (0.08, 0.14, 0.2, 0.26), draw, act, "outside")
