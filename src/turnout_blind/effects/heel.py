"""Loose fastenings at the heel of the blade: the first of them most, those behind less."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

LOOSE = (1.0, 0.85, 0.3)  # exponents of the factor on the first fastenings


def draw(rng: np.random.Generator, site: Site, factor: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The heel of the blade, and the stiffness that is left.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        A site in a switch panel without the effect.
    factor : float
        Stiffness of the first fastening over that of a sound one.

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    blade = site.world.blade
    assert blade is not None
    j = int(blade.supports[np.argmax(blade.gap < 0.0)])
    return {"sleeper": j, "position": float(site.world.position[j])}, {"factor": float(factor)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Loosen the fastenings.

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
    assert world.blade is not None
    first = int(np.argmax(world.blade.supports == where["sleeper"]))
    for k, exponent in enumerate(LOOSE):
        world.blade.stiffness[first + k] *= p["factor"] ** exponent
        world.blade.damping[first + k] *= p["factor"] ** (0.5 * exponent)


LADDER = (0.75, 0.5, 0.3, 0.16, 0.08, 0.04, 0.02)
EFFECT = Effect("heel", "place", LADDER, draw, act, "switch", {"panel": "switch"})
