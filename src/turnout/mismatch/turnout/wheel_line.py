r"""Which rail wheels press in a switch: the stock rail, then the blade.

Linear responses need the rail under a wheel, and the surface that carries it. While both surfaces are touched, the
contacts share the force. Of two tops with dips :math:`p_s` that of the higher one carries more:

.. math:: w_s = \frac{e^{-p_s/\delta}}{\sum_r e^{-p_r/\delta}}

with :math:`\delta` the approach of wheel and rail. Without a blade every surface has the weight 1, as at a nose.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import SIMULATION
from turnout.simulate.blade import is_on_blade, transfer_position

if TYPE_CHECKING:
    from turnout.simulate.blade import Blade
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.wheel_path import Surfaces


def has_blade(surfaces: Surfaces) -> bool:
    """Whether wheels change between a stock rail and a blade on these surfaces.

    Parameters
    ----------
    surfaces : tuple of tuple of path parts
        Surfaces of a route.

    Returns
    -------
    bool
    """
    return len({is_on_blade(surface) for surface in surfaces}) > 1


def dips(surfaces: Surfaces, x: np.ndarray) -> np.ndarray:
    """Dip of each surface.

    Parameters
    ----------
    surfaces : tuple of tuple of path parts
        Surfaces of a route.
    x : (n,) array of float
        Positions. [m]

    Returns
    -------
    (n_surface, n) array of float
        Down positive. [m]
    """
    return np.array([sum((component(x, 0) for component in surface), 0.0 * x) for surface in surfaces])


def carrying_weights(surfaces: Surfaces, x: np.ndarray) -> np.ndarray:
    """Weight with which each surface carries wheels.

    Parameters
    ----------
    surfaces : tuple of tuple of path parts
        Surfaces of a route.
    x : (n,) array of float
        Positions. [m]

    Returns
    -------
    (n_surface, n) array of float
        0 to 1. They add up to 1 in a switch, and are 1 without a blade.
    """
    if not has_blade(surfaces):
        return np.ones((len(surfaces), x.size))
    tops = dips(surfaces, x)
    height = (tops.min(axis=0) - tops) / SIMULATION.contact_approach
    weights = np.exp(np.maximum(height, -50.0))
    return weights / weights.sum(axis=0)


def rows_under_wheels(matrices: TrackMatrices, blade: Blade, surfaces: Surfaces) -> np.ndarray:
    """Row of the deflection of the rail that wheels press at each node.

    Parameters
    ----------
    matrices : TrackMatrices
        Of the track.
    blade : Blade
        That of the track.
    surfaces : tuple of tuple of path parts
        Surfaces of the route.

    Returns
    -------
    (n_node,) array of int
        Those of the blade from where its top is the higher one.
    """
    rows = matrices.node_index.copy()
    transfer = transfer_position(surfaces, blade)
    if transfer is None:
        return rows
    nodes = slice(matrices.blade_start, matrices.blade_start + len(matrices.blade_rows))
    is_behind = blade.direction * (matrices.node[nodes] - transfer) >= 0.0
    rows[nodes] = np.where(is_behind, matrices.blade_rows, rows[nodes])
    return rows


def points_of_rows(matrices: TrackMatrices, rows: np.ndarray) -> list[float | tuple]:
    """Points of unit forces on the deflections of nodes.

    Parameters
    ----------
    matrices : TrackMatrices
        Of the track.
    rows : (n,) array of int
        Rows of deflections of the rail or of the blade.

    Returns
    -------
    list of float or tuple
        Position on the rail [m], or name of a degree of freedom of the blade.
    """
    position = dict(zip(matrices.node_index.tolist(), matrices.node.tolist()))
    name = {row: key for key, row in matrices.index.items() if key[0] == "blade"}
    return [position[row] if row in position else name[row] for row in rows.tolist()]
