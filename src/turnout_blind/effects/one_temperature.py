"""Pads that soften with temperature, in campaigns at one temperature: they cannot be distinguished from soft pads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, coefficient: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Relative loss of stiffness per kelvin.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    coefficient : float
        Relative loss of stiffness per kelvin. [1/K]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return {}, {"coefficient": float(coefficient)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Soften the pads as ``pad_temperature`` does.

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
    before, rate = world.softening or (lambda kelvin: 1.0), p["coefficient"]
    world.softening = lambda kelvin: before(kelvin) * float(np.exp(-rate * kelvin))


EFFECT = Effect(
    "one_temperature", "condition", (0.004, 0.007, 0.01, 0.013), draw, act, "unidentifiable", {"same_temperature": True}
)
