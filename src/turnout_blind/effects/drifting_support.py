"""Wet ballast that loses stiffness during a passage and recovers partly before the next."""

from turnout_blind.effect import Effect, draw_sleeper


def draw(rng, site, loss):
    """Share of stiffness lost per second of a record, and factor from passage to passage."""
    return draw_sleeper(rng, site), {"loss": float(loss), "factor": float(rng.uniform(0.85, 0.95))}


def act(world, site, where, p):
    """Change three sleepers."""
    for j in range(where["sleeper"] - 1, where["sleeper"] + 2):
        world.drift[j] = -p["loss"]
        world.wear_per_passage[j] = (0.0, p["factor"])


EFFECT = Effect("drifting_support", "place", (0.08, 0.14, 0.2, 0.26), draw, act, "outside")
