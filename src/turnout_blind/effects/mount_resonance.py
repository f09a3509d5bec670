"""A sensor on a loose mount: it resonates, with play-free but weak contact, above and below its resonance."""

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


EFFECT = Effect("mount_resonance", "sensor", (2000.0, 1300.0, 900.0, 620.0, 430.0, 290.0, 180.0), draw, act)
