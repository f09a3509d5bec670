"""A channel on another logger whose clock lags by a constant delay, with 2 % jitter from record to record."""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign


def delay_signal(x, rate, delay):
    """``x`` (n,) delayed by ``delay`` [s], by linear interpolation. At 60 kHz the error is 1e-3 at 1 kHz."""
    time = np.arange(x.size) / rate
    return np.interp(time - delay, time, x, left=0.0, right=0.0)


def draw(rng, site, delay):
    """Delay of the channel [s]."""
    return draw_sensor(rng, site), {"delay": float(delay) * draw_sign(rng)}


def act(world, site, where, p):
    """Delay the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        delay = p["delay"] * (1.0 + 0.02 * float(rng.normal()))
        return lambda x, rate: delay_signal(x, rate, delay)

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("time_offset", "sensor", tuple(np.geomspace(5e-5, 4e-3, 7)), draw, act)
