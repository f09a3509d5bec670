"""A polygonal wheel.

Polygons grow at a fixed passing frequency, where vehicle and track resonate. Severe ones reach 1 mm peak to peak
(Nielsen and Johansson 2000; Tao, Wen, Jin and Yang 2020, section on fixed frequencies).
"""

import numpy as np

from turnout_blind.effect import Effect, draw_axle

POLYGON_FREQUENCIES = (60.0, 110.0)  # passing frequency at the mean speed of the train [Hz]


def draw(rng, site, amplitude):
    """Amplitude, order, angle."""
    where = draw_axle(rng, site)
    speed = np.mean([p.speed for p in site.passages if p.train == where["train"]])
    order = round(2.0 * np.pi * site.trains[where["train"]].radius * float(rng.uniform(*POLYGON_FREQUENCIES)) / speed)
    return where, {"amplitude": float(amplitude), "order": int(order), "angle": float(rng.uniform(0, 6.28))}


def act(world, site, where, p):
    """Add a wave round the tread."""

    def tread(x, phase, radius):
        return p["amplitude"] * np.cos(p["order"] * (np.asarray(x) / radius + phase + p["angle"]))

    world.treads.setdefault((where["train"], where["axle"]), []).append(tread)


EFFECT = Effect("out_of_round", "wheel", tuple(np.geomspace(5e-6, 5e-4, 7)), draw, act)
