"""A bad pad too far from all sensors to be observed: no effect at all gives the same recordings."""

from turnout_blind.effect import Effect

DISTANCE_FROM_SENSORS = 13.0  # distance of the sleeper from the nearest sensor [m]


def draw(rng, site, factor):
    """Factor on the stiffness of a pad before the first sensor or behind the last."""
    before = rng.random() < 0.5
    j = site.world.nearest(
        min(site.sensors) - DISTANCE_FROM_SENSORS if before else max(site.sensors) + DISTANCE_FROM_SENSORS
    )
    return {"sleeper": j, "position": float(site.world.position[j])}, {"factor": float(factor)}


def act(world, site, where, p):
    """Multiply stiffness by the factor and damping by its square root."""
    world.pad[where["sleeper"]] *= p["factor"]
    world.pad_damping[where["sleeper"]] *= p["factor"] ** 0.5


EFFECT = Effect("beyond_reach", "place", (0.5, 0.36, 0.25, 0.16), draw, act, "unidentifiable")
