"""A channel whose clock is off by a share that differs a little from recording to recording, as with temperature."""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor, draw_sign


def draw(rng, site, drift):
    """The sensor and its relative error of the rate."""
    return draw_sensor(rng, site), {"drift": float(drift) * draw_sign(rng)}


def act(world, site, where, p):
    """Add the fault to the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        drift = p["drift"] * (1.0 + 0.05 * float(rng.normal()))

        def record(x, rate):
            time = np.arange(x.size)
            return np.interp(time * (1.0 + drift), time, x, right=0.0)

        return record

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("clock_drift", "sensor", tuple(np.geomspace(5e-5, 4e-3, 7)), draw, act)
