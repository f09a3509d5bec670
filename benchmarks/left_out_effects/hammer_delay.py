"""A channel that lags in the hammer tests alone, with 2 % jitter from record to record."""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign
from turnout_blind.effects.time_offset import delay_signal


def draw(rng, site, delay):
    """The sensor and its delay [s]."""
    return draw_sensor(rng, site), {"delay": float(delay) * draw_sign(rng)}


def act(world, site, where, p):
    """Delay the channel in hammer tests alone."""

    def fault(recording_type, rng):
        delay = p["delay"] * (1.0 + 0.02 * float(rng.normal())) if recording_type == "hammer" else 0.0
        return lambda x, rate: delay_signal(x, rate, delay) if delay else x

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("hammer_delay", "sensor", tuple(np.geomspace(5e-5, 4e-3, 7)), draw, act)
