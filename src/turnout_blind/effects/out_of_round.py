"""A polygonal wheel.

Polygons grow at a fixed passing frequency, where vehicle and track resonate. Severe ones reach 1 mm peak to peak
(Nielsen and Johansson 2000; Tao, Wen, Jin and Yang 2020, section on fixed frequencies).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.effect import Effect, draw_axle

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

POLYGON_FREQUENCIES = (60.0, 110.0)  # passing frequency at the mean speed of the train [Hz]


def draw(rng: np.random.Generator, site: Site, amplitude: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Amplitude, order, angle.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    amplitude : float
        Amplitude of the polygon. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    where = draw_axle(rng, site)
    speed = np.mean([p.speed for p in site.passages if p.train == where["train"]])
    order = round(2.0 * np.pi * site.trains[where["train"]].radius * float(rng.uniform(*POLYGON_FREQUENCIES)) / speed)
    return where, {"amplitude": float(amplitude), "order": int(order), "angle": float(rng.uniform(0, 6.28))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add a wave round the tread.

    Parameters
    ----------
    world : World
        World that is changed.
    site : Site
        The site without the effect.
    where : mapping
        Where the effect is, from ``draw``.
    p : mapping
        Parameters, from ``draw``.
    """

    def tread(x: ArrayLike, phase: float, radius: float) -> np.ndarray:
        return p["amplitude"] * np.cos(p["order"] * (np.asarray(x) / radius + phase + p["angle"]))

    world.treads.setdefault((where["train"], where["axle"]), []).append(tread)


EFFECT = Effect("out_of_round", "wheel", tuple(np.geomspace(5e-6, 5e-4, 7)), draw, act)
