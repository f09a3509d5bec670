"""An amplifier that saturates softly and unsymmetrically, at a limit relative to the peak acceleration of the rail."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect, draw_sensor
from turnout_blind.record import passage_motion, sensor_positions
from turnout_blind.run import simulate_impacts

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.instrument import Fault
    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def peak_acceleration(site: Site, sensor: str) -> float:
    """Largest acceleration of the rail at a sensor, of impacts at all hammer positions and the fastest passage.

    The impacts have the usual velocity.

    Parameters
    ----------
    site : Site
        The site without the effect.
    sensor : str
        Name of the sensor.

    Returns
    -------
    float
        Largest magnitude. [m/s²]
    """
    i, positions = site.names().index(sensor), sensor_positions(site, site.world)
    impacts = [
        simulate_impacts(site.world, positions, x, [0.0], [0.95], 0.03, tip=site.tip)[1][i]
        for x in site.hammer_positions
    ]
    fastest = max(range(len(site.passages)), key=lambda k: site.passages[k].speed)
    passage = passage_motion(site, site.world, fastest, None)[i]
    return float(max(np.abs(x).max() for x in (*impacts, passage)))


def draw(rng: np.random.Generator, site: Site, share: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Limit as the mean of both sides. Four digits, since the peak has the round-off of the libraries.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    share : float
        Limit over the largest acceleration of the rail at the sensor. [-]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    where = draw_sensor(rng, site)
    return where, {"limit": float(f"{share * peak_acceleration(site, where['sensor']):.4g}"), "share": float(share)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add a limit 8 % higher upward and 8 % lower downward. The channel is linear up to 80 % of its limit.

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
        def clip(x: np.ndarray, rate: float) -> np.ndarray:
            limit = np.where(x > 0.0, 1.08 * p["limit"], 0.92 * p["limit"])
            magnitude, knee = np.abs(x), 0.8 * limit
            excess = np.maximum(magnitude - knee, 0.0)
            return np.sign(x) * (np.minimum(magnitude, knee) + 0.2 * limit * np.tanh(excess / (0.2 * limit)))

        return clip

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("clipping", "sensor", (1.2, 1.0, 0.9, 0.8, 0.68, 0.55, 0.4), draw, act)
