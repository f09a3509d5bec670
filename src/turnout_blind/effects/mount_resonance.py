"""A sensor on a weak mount without play, which adds a resonance.

It comes in series with the mount of every sensor (2.5 to 4.5 kHz). At 5 kHz both together are still a good mount.
"""

import numpy as np

from turnout_blind.effect import Effect, draw_sensor
from turnout_blind.instrument import mounting_response


def draw(rng, site, frequency):
    """Frequency and quality factor of the mount."""
    return draw_sensor(rng, site), {"frequency": float(frequency), "quality": float(rng.uniform(4.0, 14.0))}


def act(world, site, where, p):
    """Filter the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        return lambda x, rate: mounting_response(x, rate, p["frequency"], p["quality"])

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("mount_resonance", "sensor", tuple(np.geomspace(5000.0, 180.0, 7)), draw, act)
