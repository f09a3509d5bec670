"""A lag of one channel of the passages' logger, all trains at one speed: a misplaced sensor would show the same."""

from turnout_blind.effect import Effect, any_sensor, sign
from turnout_blind.effects.time_offset import shifted


def draw(rng, site, delay):
    """Lag of the channel."""
    return any_sensor(rng, site), {"delay": float(delay) * sign(rng)}


def act(world, site, where, p):
    """Only when trains pass: the hammer tests have a logger of their own."""

    def fault(kind, rng):
        return (lambda x, rate: shifted(x, rate, p["delay"])) if kind == "passage" else (lambda x, rate: x)

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("one_speed_lag", "sensor", (1e-3, 2e-3, 3e-3, 5e-3), draw, act, "unidentifiable", {"one_speed": True})
