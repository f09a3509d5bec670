"""A sensor whose sensitivity differs from the one in its file."""

from turnout_blind.effect import Effect, draw_sensor


def draw(rng, site, change):
    """Factor on the signal."""
    return draw_sensor(rng, site), {"gain": float(1.0 + change if rng.random() < 0.5 else 1.0 / (1.0 + change))}


def act(world, site, where, p):
    """Multiply the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        return lambda x, rate: p["gain"] * x

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("gain", "sensor", (0.02, 0.04, 0.07, 0.12, 0.2, 0.32, 0.5), draw, act)
