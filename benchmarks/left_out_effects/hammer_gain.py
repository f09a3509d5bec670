"""A channel with a wrong sensitivity in the hammer tests alone."""

from turnout_blind.effect import Effect
from turnout_blind.effects import gain


def draw(rng, site, change):
    """The sensor and its gain [-]."""
    return gain.draw(rng, site, change)


def act(world, site, where, p):
    """Multiply the channel in hammer tests alone."""

    def fault(recording_type, rng):
        factor = p["gain"] if recording_type == "hammer" else 1.0
        return lambda x, rate: factor * x

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("hammer_gain", "sensor", gain.EFFECT.ladder, draw, act)
