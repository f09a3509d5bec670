"""A sensor on a weak mount without play, which adds a resonance.

It comes in series with the mount of every sensor (2.5 to 4.5 kHz). At 5 kHz both together are still a good mount.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect, draw_sensor
from turnout_blind.instrument import mounting_response

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.instrument import Fault
    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def draw(rng: np.random.Generator, site: Site, frequency: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Frequency and quality factor of the mount.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    frequency : float
        Resonance of the mount. [Hz]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sensor(rng, site), {"frequency": float(frequency), "quality": float(rng.uniform(4.0, 14.0))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Filter the channel, in hammer tests and passages.

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
        return lambda x, rate: mounting_response(x, rate, p["frequency"], p["quality"])

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("mount_resonance", "sensor", tuple(np.geomspace(5000.0, 180.0, 7)), draw, act)
