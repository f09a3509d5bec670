"""A flat on one wheel, its edges rounded by rolling: 1.5 times as long as its chord."""

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


def draw(rng: np.random.Generator, site: Site, length: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Chord of the fresh flat and its angle on the tread.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site without the effect.
    length : float
        Chord of the fresh flat. [m]

    Returns
    -------
    (dict, dict)
        Where the effect is, and its parameters.
    """
    return draw_axle(rng, site), {"length": float(length), "angle": float(rng.uniform(0.0, 2.0 * np.pi))}


def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
    """Add a cosine-shaped dip of depth l^2 / 16 R to the tread.

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
        depth, half = p["length"] ** 2 / (16.0 * radius), 0.75 * p["length"]
        angle = np.mod(np.asarray(x) / radius + phase + p["angle"] + np.pi, 2.0 * np.pi) - np.pi
        distance = np.clip(angle * radius / half, -1.0, 1.0)
        return 0.5 * depth * (1.0 + np.cos(np.pi * distance))

    world.treads.setdefault((where["train"], where["axle"]), []).append(tread)


EFFECT = Effect("flat", "wheel", tuple(np.geomspace(0.006, 0.08, 7)), draw, act)
