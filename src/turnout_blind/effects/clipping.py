"""An amplifier that saturates softly, one side before the other."""

import numpy as np

from turnout_blind.effect import Effect, any_sensor


def draw(rng, site, limit):
    """Largest value shown upward; downward it is 15 % less."""
    return any_sensor(rng, site), {"limit": float(limit)}


def act(world, site, where, p):
    """Follows up to 80 % of the limit, then bends over."""

    def fault(kind, rng):
        def bent(x, rate):
            limit = np.where(x > 0.0, p["limit"], 0.85 * p["limit"])
            size, knee = np.abs(x), 0.8 * limit
            over = np.maximum(size - knee, 0.0)
            return np.sign(x) * (np.minimum(size, knee) + 0.2 * limit * np.tanh(over / (0.2 * limit)))

        return bent

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("clipping", "sensor", (150.0, 90.0, 55.0, 32.0, 19.0, 11.0, 6.0), draw, act)
