"""A common gain error of all channels in passages: heavier trains would give the same recordings."""

from turnout_blind.effect import Effect


def draw(rng, site, change):
    """Common factor."""
    return {}, {"gain": float(1.0 + change)}


def act(world, site, where, p):
    """Multiply all channels in passages only: hammer tests have another logger."""

    def fault(recording_type, rng):
        return lambda x, rate: p["gain"] * x if recording_type == "passage" else x

    for name in site.names():
        world.channels.setdefault(name, []).append(fault)


EFFECT = Effect("common_gain", "condition", (0.06, 0.09, 0.12, 0.15), draw, act, "unidentifiable")
