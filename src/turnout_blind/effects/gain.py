"""A sensor whose sensitivity differs from the one in its file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.effect import Effect, draw_sensor

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from turnout_blind.instrument import Fault
    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, change: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Factor on the signal.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    change : float
        Relative increase of the signal; a decrease by the same factor is equally likely. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sensor(rng, site), {"gain": float(1.0 + change if rng.random() < 0.5 else 1.0 / (1.0 + change))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Multiply the channel, in hammer tests and passages.

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
        return lambda x, rate: p["gain"] * x

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("gain", "sensor", (0.02, 0.04, 0.07, 0.12, 0.2, 0.32, 0.5), draw, act)
