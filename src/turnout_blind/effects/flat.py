"""A flat on one wheel, its edges rounded by rolling: 1.5 times as long as its chord."""

import numpy as np

from turnout_blind.effect import Effect, draw_axle


def draw(rng, site, length):
    """Chord of the fresh flat and its angle on the tread."""
    return draw_axle(rng, site), {"length": float(length), "angle": float(rng.uniform(0.0, 2.0 * np.pi))}


def act(world, site, where, p):
    """Add a cosine-shaped dip of depth l^2 / 16 R to the tread."""

    def tread(x, phase, radius):
        depth, half = p["length"] ** 2 / (16.0 * radius), 0.75 * p["length"]
        angle = np.mod(np.asarray(x) / radius + phase + p["angle"] + np.pi, 2.0 * np.pi) - np.pi
        distance = np.clip(angle * radius / half, -1.0, 1.0)
        return 0.5 * depth * (1.0 + np.cos(np.pi * distance))

    world.treads.setdefault((where["train"], where["axle"]), []).append(tread)


EFFECT = Effect("flat", "wheel", tuple(np.geomspace(0.006, 0.08, 7)), draw, act)
