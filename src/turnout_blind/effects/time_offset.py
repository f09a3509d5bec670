"""A channel on another logger whose clock lags by a constant delay, with 2 % jitter from record to record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.instrument import Fault
    from turnout_blind.site import Site
    from turnout_blind.true_site import World


def delay_signal(x: np.ndarray, rate: float, delay: float) -> np.ndarray:
    """A signal delayed by linear interpolation. At 60 kHz the error is 1e-3 at 1 kHz.

    Parameters
    ----------
    x : (n,) array of float
        Signal.
    rate : float
        Sampling rate. [Hz]
    delay : float
        Delay; negative: earlier. [s]

    Returns
    -------
    (n,) array of float
        Delayed signal, 0 before its start.
    """
    time = np.arange(x.size) / rate
    return np.interp(time - delay, time, x, left=0.0, right=0.0)


def draw(rng: np.random.Generator, site: Site, delay: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Delay of the channel [s].

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    delay : float
        Magnitude of the delay. [s]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_sensor(rng, site), {"delay": float(delay) * draw_sign(rng)}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Delay the channel, in hammer tests and passages.

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
        delay = p["delay"] * (1.0 + 0.02 * float(rng.normal()))
        return lambda x, rate: delay_signal(x, rate, delay)

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("time_offset", "sensor", tuple(np.geomspace(5e-5, 4e-3, 7)), draw, act)
