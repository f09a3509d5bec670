"""A polygonal wheel, five to nine waves round its tread (Nielsen and Johansson 2000: long waves move a rail little)."""

import numpy as np

from turnout_blind.effect import Effect, any_axle


def draw(rng, site, amplitude):
    """Amplitude, order, angle."""
    order = int(rng.integers(5, 10))
    return any_axle(rng, site), {"amplitude": float(amplitude), "order": order, "angle": float(rng.uniform(0, 6.28))}


def act(world, site, where, p):
    """A wave round the tread."""

    def tread(x, phase, radius):
        return p["amplitude"] * np.cos(p["order"] * (np.asarray(x) / radius + phase + p["angle"]))

    world.treads.setdefault((where["train"], where["axle"]), []).append(tread)


EFFECT = Effect("out_of_round", "wheel", tuple(np.geomspace(1e-5, 4e-4, 7)), draw, act)
