"""A lag of a channel that no blow was recorded on, all trains at one speed: a misplaced sensor shows the same.

A sensor d further on hears a wheel d / v later; blows would tell, for they reach it without a train.
"""

import numpy as np

from turnout_blind.effect import Effect, any_sensor, sign
from turnout_blind.effects.time_offset import shifted


def draw(rng, site, delay):
    """Lag of the channel."""
    return any_sensor(rng, site), {"delay": float(delay) * sign(rng)}


def act(world, site, where, p):
    """Nothing but the logger's noise when the hammer strikes."""

    def fault(kind, rng):
        return (
            (lambda x, rate: shifted(x, rate, p["delay"])) if kind == "passage" else (lambda x, rate: np.zeros_like(x))
        )

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("one_speed_lag", "sensor", (1e-3, 2e-3, 3e-3, 5e-3), draw, act, "unidentifiable", {"one_speed": True})
