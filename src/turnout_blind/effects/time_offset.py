"""A channel on another logger whose clock lags by a constant, with a jitter of 2 % from record to record."""

import numpy as np

from turnout_blind.effect import Effect, any_sensor, sign


def shifted(x, rate, delay):
    """``x`` (n,) as shown ``delay`` [s] later, by linear interpolation; at 60 kHz it is right to 1e-3 at 1 kHz."""
    time = np.arange(x.size) / rate
    return np.interp(time - delay, time, x, left=0.0, right=0.0)


def draw(rng, site, delay):
    """Lag of the channel."""
    return any_sensor(rng, site), {"delay": float(delay) * sign(rng)}


def act(world, site, where, p):
    """In hammer tests and passages alike."""

    def fault(kind, rng):
        delay = p["delay"] * (1.0 + 0.02 * float(rng.normal()))
        return lambda x, rate: shifted(x, rate, delay)

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("time_offset", "sensor", tuple(np.geomspace(5e-5, 4e-3, 7)), draw, act)
