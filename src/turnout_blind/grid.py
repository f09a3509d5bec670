"""The rail on a staggered finite-difference grid, with absorbing layers (sponges) at its ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Rail:
    """Timoshenko beam: ``bending`` EI [N m²], ``shear`` kappa G A [N], ``mass`` [kg/m], ``rotary`` rho I [kg m],
    ``damping`` of the transverse motion [N s/m²]."""

    bending: float = 6.378e6
    shear: float = 2.435e8
    mass: float = 60.2
    rotary: float = 0.2384
    damping: float = 30.0


@dataclass(frozen=True)
class Grid:
    """``n`` nodes from ``start`` [m], ``step`` [m] apart. Rotations and shear forces lie between the nodes.

    A ``sponge`` [m] at each end damps reflections, with a rate of up to ``sponge_rate`` [1/s].
    """

    start: float = -24.0
    n: int = 601
    step: float = 0.1
    sponge: float = 12.0
    sponge_rate: float = 400.0

    @property
    def end(self) -> float:
        """Position of the last node [m]."""
        return self.start + (self.n - 1) * self.step

    def rates(self, shift: float = 0.0) -> np.ndarray:
        """Damping rate at the nodes; it grows cubically into the sponge.

        Parameters
        ----------
        shift : float
            Distance from the nodes. [steps]

        Returns
        -------
        (n,) array of float
            Damping rate. [1/s]
        """
        distance = self.step * (np.arange(self.n) + shift)
        edge = np.minimum(distance, (self.n - 1) * self.step - distance)
        depth = np.clip(1.0 - edge / self.sponge, 0.0, 1.0) if self.sponge else np.zeros(self.n)
        return self.sponge_rate * depth**3


def spread(grid: Grid, positions: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the cubic B-spline at some positions: a load 4 steps wide.

    Parameters
    ----------
    grid : Grid
        Grid of the rail.
    positions : (n,) array of float
        Positions. [m]

    Returns
    -------
    (n,) array of int, (n, 4) array of float
        First of the four nodes, and weights.

    Examples
    --------
    >>> first, weights = spread(Grid(start=0.0, n=101), [5.05])
    >>> int(first[0]), round(float(weights[0].sum()), 12), round(float(weights[0] @ np.arange(4)), 12)
    (49, 1.0, 1.5)
    """
    coordinate = (np.atleast_1d(np.asarray(positions, dtype=float)) - grid.start) / grid.step
    node = np.floor(coordinate).astype(np.int64)
    s = coordinate - node
    weights = np.stack(
        [
            (1.0 - s) ** 3,
            3.0 * s**3 - 6.0 * s**2 + 4.0,
            -3.0 * s**3 + 3.0 * s**2 + 3.0 * s + 1.0,
            s**3,
        ],
        axis=1,
    )
    return node - 1, weights / 6.0


def interpolation_weights(grid: Grid, positions: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the cubic through the four nodes about some positions.

    Parameters
    ----------
    grid : Grid
        Grid of the rail.
    positions : (n,) array of float
        Positions. [m]

    Returns
    -------
    (n,) array of int, (n, 4) array of float
        First of the four nodes, and weights.
    """
    coordinate = (np.atleast_1d(np.asarray(positions, dtype=float)) - grid.start) / grid.step
    node = np.floor(coordinate).astype(np.int64)
    s = coordinate - node
    weights = np.stack(
        [
            -s * (s - 1.0) * (s - 2.0) / 6.0,
            (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
            -(s + 1.0) * s * (s - 2.0) / 2.0,
            (s + 1.0) * s * (s - 1.0) / 6.0,
        ],
        axis=1,
    )
    return node - 1, weights


def lost_compliance(grid: Grid, rail: Rail) -> float:
    r"""Compliance that a point load loses because it is spread over four steps, as is the response [m/N].

    .. math:: l = \frac{E|\xi - \xi'|}{2\,\kappa G A}, \qquad E|\xi - \xi'| = 0.6556\,h

    with two positions drawn from the B-spline. In shear the rail deflects like a rope, :math:`|x| / 2 \kappa GA`. The
    loss in bending is of higher order in h and neglected. 0.6556 is the quadrature of the spline of order seven, the
    convolution of both.

    Parameters
    ----------
    grid : Grid
        Grid of the rail.
    rail : Rail
        Profile of the rail.

    Returns
    -------
    float
        Compliance. [m/N]
    """
    return 0.6556 * grid.step / (2.0 * rail.shear)
