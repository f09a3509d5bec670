"""A sleeper with a gap that no train closes: missing ballast would give the same recordings."""

from turnout_blind.effect import Effect, draw_sleeper


def draw(rng, site, gap):
    """A gap larger than every deflection."""
    return draw_sleeper(rng, site), {"gap": float(gap)}


def act(world, site, where, p):
    """Open the gap: the ballast never reacts."""
    world.gap[where["sleeper"]], world.close[where["sleeper"]] = p["gap"], 0.2 * p["gap"]


EFFECT = Effect("bottomless_void", "place", (0.01, 0.012, 0.015, 0.02), draw, act, "unidentifiable")
