"""A common gain error of all channels in passages: heavier trains would give the same recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.instrument import Fault
    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, change: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Common factor.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    change : float
        Relative increase of all signals. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return {}, {"gain": float(1.0 + change)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Multiply all channels in passages only: hammer tests have another logger.

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

    def fault(recording_type: str, rng: np.random.Generator) -> Fault:
        return lambda x, rate: p["gain"] * x if recording_type == "passage" else x

    for name in site.names():
        world.channels.setdefault(name, []).append(fault)


EFFECT = Effect("common_gain", "condition", (0.06, 0.09, 0.12, 0.15), draw, act, "unidentifiable")
