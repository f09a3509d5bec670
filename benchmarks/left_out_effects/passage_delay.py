"""A channel that lags in the passages alone, with 2 % jitter from record to record."""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign
from turnout_blind.effects.time_offset import delay_signal


def draw(rng, site, delay):
    """The sensor and its delay [s]."""
    return draw_sensor(rng, site), {"delay": float(delay) * draw_sign(rng)}


def act(world, site, where, p):
    """Delay the channel in passages alone."""

    def fault(recording_type, rng):
        delay = p["delay"] * (1.0 + 0.02 * float(rng.normal())) if recording_type == "passage" else 0.0
        return lambda x, rate: delay_signal(x, rate, delay) if delay else x

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("passage_delay", "sensor", tuple(np.geomspace(2e-4, 4e-3, 7)), draw, act)
