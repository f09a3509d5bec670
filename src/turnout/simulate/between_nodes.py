r"""Add the bending of a rail element under its loads to the signal of a sensor between two nodes.

.. math:: w(x, t) = N(x)^T u(t) + \sum_i l(x, x_i(t)) \, F_i(t)

with l of ``rail.local_compliance``, the same as for a wheel. It is 0 on a node and for loads in other elements.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.simulate.kernels import ramp_at
from turnout.simulate.rail import local_compliance

if TYPE_CHECKING:
    from turnout.simulate.matrices import TrackMatrices

NODE_TOLERANCE = 1e-9  # m from a node within which a position is on it; positions are rounded to this


@dataclass(frozen=True)
class RailLoads:
    """Forces on the rail: ``position`` [m] and ``force`` [N], both (n_load, n_step + 2).

    Columns are the middles of all steps, of one before the first and of one after the last. ``from_rest``: nothing
    moves before time 0. ``ramp`` has the positions where the modelled track fades in and out, None without.
    """

    position: np.ndarray
    force: np.ndarray
    from_rest: bool
    ramp: np.ndarray | None = None


def rail_loads(
    position: np.ndarray, speed: float, force: np.ndarray, dt: float, from_rest: bool, ramp: np.ndarray | None = None
) -> RailLoads:
    """``RailLoads`` of forces (n_load, n_step) [N] that roll from ``position`` (n_load,) [m] with ``speed`` [m/s].

    The forces are extrapolated linearly by one step after the end.

    Parameters
    ----------
    position : (n_load,) array of float
        Positions at time 0. [m]
    speed : float
        Speed of all loads, negative against growing x. [m/s]
    force : (n_load, n_step) array of float
        Mean over each step, down positive. [N]
    dt : float
        Time step. [s]
    from_rest : bool
        Whether nothing moves before time 0.
    ramp : (4,) array of float or None
        Positions where the modelled track fades in and out. [m]

    Returns
    -------
    RailLoads
        Positions and forces at the middles of the steps, with one step more at both ends.
    """
    force = np.column_stack([force[:, :1], force])
    force = np.column_stack([force, 2.0 * force[:, -1] - force[:, -2]])
    time = (np.arange(force.shape[1]) - 0.5) * dt
    return RailLoads(position[:, None] + speed * time, force, from_rest, ramp)


def is_between_nodes(matrices: TrackMatrices, point: float | tuple) -> bool:
    """Whether a point is on the rail between two nodes; it is a position [m] or the name of a degree of freedom.

    Parameters
    ----------
    matrices : TrackMatrices
        Matrices of the track.
    point : float or tuple
        Position on the rail [m] or name of a degree of freedom.

    Returns
    -------
    bool
        False for a named degree of freedom and within ``NODE_TOLERANCE`` of a node.
    """
    return not isinstance(point, tuple) and float(np.min(np.abs(matrices.node - point))) > NODE_TOLERANCE


def element_deflection(matrices: TrackMatrices, x: float, loads: RailLoads) -> np.ndarray:
    """(n_step + 2,) deflection [m] at ``x`` [m] of its element with both ends clamped, under the loads on it.

    Parameters
    ----------
    matrices : TrackMatrices
        Matrices of the track.
    x : float
        Position of the sensor. [m]
    loads : RailLoads
        Loads on the rail; those in other elements have no effect.

    Returns
    -------
    (n_step + 2,) array of float
        Deflection beside the motion of the nodes, down positive. [m]
    """
    e = matrices.element_at(x)
    first, last = matrices.node[e : e + 2]
    inside = np.flatnonzero((loads.position > first) & (loads.position < last))
    load_position, h, n = loads.position.ravel()[inside], last - first, loads.force.shape[1]
    deflection = (
        local_compliance((x - first) / h, (load_position - first) / h, h, matrices.rails[e])
        * loads.force.ravel()[inside]
    )
    if loads.ramp is not None and not loads.ramp[1] <= first < last <= loads.ramp[2]:
        deflection = deflection * np.array([ramp_at(loads.ramp, True, position)[0] for position in load_position])
    return np.bincount(inside % n, deflection, n)


def step_mean(deflection: np.ndarray, order: int, dt: float, from_rest: bool) -> np.ndarray:
    """(n_step,) means over each step of a deflection (n_step + 2,) [m]; ``order`` 1: its rate, 2: its acceleration.

    Parameters
    ----------
    deflection : (n_step + 2,) array of float
        Deflection at the middles of the steps. [m]
    order : int
        0 for the deflection itself, 1 for its rate, 2 for its acceleration.
    dt : float
        Time step. [s]
    from_rest : bool
        Whether the rate before time 0 is 0.

    Returns
    -------
    (n_step,) array of float
        [m], [m/s] or [m/s²].
    """
    if order == 0:
        return deflection[1:-1]
    ends = np.diff(deflection) / dt if order == 2 else 0.5 * (deflection[1:] + deflection[:-1])
    if from_rest:
        ends[0] = 0.0
    return np.diff(ends) / dt
