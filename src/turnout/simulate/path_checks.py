"""Check the path of a wheel before a simulation: jumps, and parts that are too short for its grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.wheel_path import uniform_spline

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.wheel_path import PathPart

CHECK_STEP = 0.005  # m between the positions that are compared: the grid of the path
MAX_CHECK_JUMP = 1e-3  # m, largest jump between two of them that is not examined further
MAX_GRID_ERROR = 0.25  # of the depth of a part: waves of 12 mm have 0.3, waves of 15 mm 0.06, a flat of 10 mm 0.4
NO_DEPTH = 1e-9  # m, depth that no wheel notices


def check_path(path_parts: Sequence[PathPart], start: float, end: float) -> None:
    """Reject a path with a jump of more than ``MAX_CHECK_JUMP`` that remains on a grid 2000 times finer.

    A part that the grid of the path does not carry is rejected, too: the wheel would roll over another one, and over
    none if the part lies between two positions of the grid.

    Parameters
    ----------
    path_parts : sequence of path parts
        Parts of the path, each checked alone, on its own wheel.
    start : float
        First position. [m]
    end : float
        Last position. [m]

    Raises
    ------
    SimulationError
        For a jump, for a dip that is not a number, and for a part that the grid misses by ``MAX_GRID_ERROR`` of its
        depth or more.
    """
    x = np.arange(start, end + CHECK_STEP, 0.5 * CHECK_STEP)
    for path_part in path_parts:
        wheel = getattr(path_part, "wheel", None) or 0
        p = path_part(x, wheel)
        jumps = np.abs(np.diff(p[::2]))
        if not np.all(np.isfinite(p)):
            raise SimulationError(f"path {path_part!r}: not a number at {x[~np.isfinite(p)][0]:.3f} m.")
        for k in np.flatnonzero(jumps > MAX_CHECK_JUMP)[:50]:
            fine = np.linspace(x[2 * k], x[2 * k + 2], 2001)
            jump = np.max(np.abs(np.diff(path_part(fine, wheel))))
            if jump > 0.5 * jumps[k]:
                raise SimulationError(f"path {path_part!r} jumps by {jump * 1e3:.2f} mm at {x[2 * k]:.3f} m.")
        _check_grid(path_part, x, p)


def _check_grid(path_part: PathPart, x: np.ndarray, p: np.ndarray) -> None:
    """Compare a part with its spline through every other of its values ``p`` at ``x``, for both halves of them."""
    depth = float(np.ptp(p))
    for first in (0, 1):
        knots = p[first::2]
        covered = slice(first, first + 2 * knots.size - 2)
        error = np.abs(uniform_spline(knots, x[first], CHECK_STEP, x[covered]) - p[covered])
        worst = int(np.argmax(error))
        if error[worst] > max(MAX_GRID_ERROR * depth, NO_DEPTH):
            raise SimulationError(
                f"path {path_part!r}: its depth of {depth * 1e3:.3g} mm changes too quickly at "
                f"{x[covered][worst]:.3f} m: the grid of the path, {CHECK_STEP * 1e3:g} mm, misses "
                f"{error[worst] / depth:.0%} of it."
            )
