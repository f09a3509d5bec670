"""A sleeper that hangs so high that no train closes the gap: no ballast at all would show the same."""

from turnout_blind.effect import Effect, sleeper_near


def draw(rng, site, gap):
    """Gap beyond every deflection."""
    return sleeper_near(rng, site), {"gap": float(gap)}


def act(world, site, where, p):
    """No reaction."""
    world.gap[where["sleeper"]], world.close[where["sleeper"]] = p["gap"], 0.2 * p["gap"]


EFFECT = Effect("bottomless_void", "place", (0.01, 0.012, 0.015, 0.02), draw, act, "unidentifiable")
