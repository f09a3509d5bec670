"""A slide chair below the foot of the blade: worn plate, or a bearer that has settled against its neighbours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, gap: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """A slide chair that wheels on the blade pass, near the sensors, and its gap.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        A site in a switch panel without the effect.
    gap : float
        Gap below the unloaded blade. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    blade = site.world.blade
    assert blade is not None
    position = site.world.position[blade.supports]
    near = (position > blade.switch.toe + 0.7 * blade.switch.length) & (position < max(site.sensors) + 0.6)
    c = int(rng.choice(np.flatnonzero((blade.gap >= 0.0) & near)))
    return {"sleeper": int(blade.supports[c]), "position": float(position[c])}, {"gap": float(gap)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Open the gap.

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
    world.blade.gap[world.blade.supports == where["sleeper"]] = p["gap"]


LADDER = tuple(np.geomspace(1.5e-4, 4e-3, 7))
EFFECT = Effect("chair_gap", "place", LADDER, draw, act, "switch", {"panel": "switch"})
