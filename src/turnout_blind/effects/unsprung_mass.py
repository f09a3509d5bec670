"""Wheelsets of one train heavier than its vehicle file says: brake discs, or a motor carried by the axle.

A driven axle counts 1.7 t or 4.2 t, depending on how its motor is carried (class 86, Bjork 1970).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, factor: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Train and factor.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    factor : float
        Factor on the unsprung mass. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return {"train": str(rng.choice(sorted(site.trains)))}, {"factor": float(factor)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Multiply the unsprung mass by the factor.

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
    world.wheel_mass[where["train"]] = world.wheel_mass.get(where["train"], 1.0) * p["factor"]


EFFECT = Effect("unsprung_mass", "train", (1.04, 1.12, 1.24, 1.4, 1.6, 1.85, 2.1), draw, act)
