"""Traction current in a channel: a line at 50 Hz with a third harmonic, at another phase in each recording."""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor


def draw(rng, site, level):
    """The sensor and its amplitude [m/s²]."""
    return draw_sensor(rng, site), {"level": float(level)}


def act(world, site, where, p):
    """Add the fault to the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        phase = float(rng.uniform(0.0, 2.0 * np.pi))

        def record(x, rate):
            turns = 50.0 * np.arange(x.size) / rate
            line = np.sin(2.0 * np.pi * turns + phase) + 0.2 * np.sin(6.0 * np.pi * turns + 3.0 * phase)
            return x + p["level"] * line

        return record

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("hum", "sensor", tuple(np.geomspace(0.1, 12.0, 7)), draw, act)
