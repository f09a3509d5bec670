"""A rail with lower shear stiffness than its description says."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, factor: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Factor on the shear stiffness.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    factor : float
        Factor on the shear stiffness. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return {}, {"factor": float(factor)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Multiply the shear stiffness by the factor.

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
    world.rail = replace(world.rail, shear=world.rail.shear * p["factor"])


EFFECT = Effect("rail_shear", "condition", (0.95, 0.88, 0.8, 0.7, 0.6, 0.5, 0.4), draw, act)
