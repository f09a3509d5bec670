"""A sensor on a loose mount: it resonates, with play-free but weak contact, above and below its resonance.

It yields beside the mount that every sensor has (2.5 to 4.5 kHz): at 5 kHz both together are a good mount still.
"""

import numpy as np

from turnout_blind.effect import Effect, any_sensor
from turnout_blind.instrument import mounting


def draw(rng, site, frequency):
    """Frequency and quality of the mount."""
    return any_sensor(rng, site), {"frequency": float(frequency), "quality": float(rng.uniform(4.0, 14.0))}


def act(world, site, where, p):
    """In hammer tests and passages alike."""

    def fault(kind, rng):
        return lambda x, rate: mounting(x, rate, p["frequency"], p["quality"])

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("mount_resonance", "sensor", tuple(np.geomspace(5000.0, 180.0, 7)), draw, act)
