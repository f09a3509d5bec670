"""A blind world whose closed forms are known: equal supports on plain track."""

import numpy as np

from turnout_blind.grid import Grid, Rail
from turnout_blind.true_site import SPACING, World


def uniform_world(
    length: float = 60.0,
    step: float = 0.1,
    pad: float = 3e8,
    pad_damping: float = 2e4,
    mass: float = 140.0,
    ballast: float = 1e8,
    ballast_damping: float = 6e4,
    rail: Rail | None = None,
    sponge: float = 12.0,
) -> World:
    """A world of equal supports every ``SPACING`` [m] about 0; lengths in m, all else in SI units."""
    rail = rail or Rail()
    grid = Grid(-0.5 * length, round(length / step) + 1, step, sponge)
    half = int(0.5 * length / SPACING) - 1
    position = SPACING * np.arange(-half, half + 1)
    values = {
        "pad": pad, "pad_damping": pad_damping, "mass": mass, "ballast": ballast, "ballast_damping": ballast_damping,
    }  # fmt: skip
    arrays = {name: np.full(position.size, float(v)) for name, v in values.items()}
    return World(grid, rail, position, **arrays)
