r"""Which rail wheels press in a switch: the stock rail, then both, then the blade.

While a wheel touches both rails, their deflections and those of the contacts must agree. Of tops with dips
:math:`p_s, p_b` (down positive) the blade carries the share

.. math:: w = \frac{p_s - p_b + P (C_{ss} - C_{sb} + c)}{P\,C}, \quad C = C_{ss} + C_{bb} - 2 C_{sb} + 2 c

within 0..1, with P the load, :math:`C_{ij}` static receptances of both rails and c that of a contact. To first order
the wheel then follows :math:`(1 - a) d_s + a d_b` with :math:`a = (C_{ss} - C_{sb} + c) / C`, where d is the dip of a
top plus the deflection of its rail. The difference of both moves load from one rail to the other: :math:`(d_s - d_b)/C`
more on the blade, as much less on the stock rail. So a small change of a top shifts the place of the change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import SIMULATION
from turnout.simulate.blade import is_on_blade, transfer_position
from turnout.simulate.frequency_response import responses

if TYPE_CHECKING:
    from turnout.simulate.blade import Blade
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.vehicle import Vehicle
    from turnout.simulate.wheel_path import Surfaces


@dataclass(frozen=True)
class LoadTransfer:
    """Change of a wheel from the stock rail to the blade.

    It touches both rails between ``start`` and ``end`` [m], seen in ``direction`` from the toe to the heel (1 or -1).
    There the blade takes ``share`` of a further force, and ``flexibility`` [m/N] is that of a pair of opposite forces
    on both rails.
    """

    start: float
    end: float
    share: float
    flexibility: float
    direction: int = 1

    def blade_weight(self, x: np.ndarray) -> np.ndarray:
        """Share of a small force that the blade takes.

        Parameters
        ----------
        x : (n,) array of float
            Positions of the wheel. [m]

        Returns
        -------
        (n,) array of float
            0 before the change, ``share`` in it, 1 behind it.
        """
        from_toe = self.direction * np.asarray(x, dtype=float)
        start, end = sorted((self.direction * self.start, self.direction * self.end))
        return np.where(from_toe < start, 0.0, np.where(from_toe < end, self.share, 1.0))

    def mean_blade_weight(self, x: np.ndarray, spacing: float) -> np.ndarray:
        """``blade_weight`` about points of a grid, averaged with the triangle by which they share a force between them.

        Parameters
        ----------
        x : (n,) array of float
            Positions. [m]
        spacing : float
            Distance of two points of the grid. [m]

        Returns
        -------
        (n,) array of float
        """
        offset = np.linspace(-1.0, 1.0, 2 * SIMULATION.transfer_samples + 1)[1:-1]
        weight = 1.0 - np.abs(offset)
        return self.blade_weight(np.asarray(x)[:, None] + spacing * offset) @ (weight / weight.sum())

    def positions(self) -> tuple[np.ndarray, float]:
        """Midpoints of equal intervals of the change, and their length [m]."""
        length = abs(self.end - self.start) / SIMULATION.transfer_samples
        return min(self.start, self.end) + length * (np.arange(SIMULATION.transfer_samples) + 0.5), length


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


def top(surfaces: Surfaces, x: np.ndarray, on_blade: bool) -> np.ndarray:
    """Dip of the surface on the blade, or of that on the stock rail.

    Parameters
    ----------
    surfaces : tuple of tuple of path parts
        Surfaces of a route with both.
    x : (n,) array of float
        Positions. [m]
    on_blade : bool
        Which of them.

    Returns
    -------
    (n,) array of float
        Down positive. [m]
    """
    surface = next(s for s in surfaces if is_on_blade(s) is on_blade)
    return np.asarray(sum((component(x, 0) for component in surface), 0.0 * x))


def load_transfer(
    matrices: TrackMatrices, blade: Blade | None, surfaces: Surfaces, vehicle: Vehicle
) -> LoadTransfer | None:
    """Where the wheels of a vehicle change to the blade, and how stiff both rails are there.

    Parameters
    ----------
    matrices : TrackMatrices
        Of the track.
    blade : Blade or None
        That of the track.
    surfaces : tuple of tuple of path parts
        Surfaces of the route.
    vehicle : Vehicle
        Its mean wheel load counts.

    Returns
    -------
    LoadTransfer or None
        None where no wheel changes to a blade.
    """
    position = None if blade is None else transfer_position(surfaces, blade)
    if blade is None or position is None:
        return None
    load = float(np.mean(vehicle.static_loads))
    contact = 1.0 / vehicle.wheel_values("contact")[0].tangent(0.5 * load)
    stock_stock, stock_blade, blade_blade = static_compliances(matrices, position)
    flexibility = stock_stock + blade_blade - 2.0 * stock_blade + 2.0 * contact
    share = (stock_stock - stock_blade + contact) / flexibility
    x = np.linspace(blade.toe, blade.heel, int(abs(blade.heel - blade.toe) / SIMULATION.transfer_step))
    height = top(surfaces, x, False) - top(surfaces, x, True)  # of the blade over the stock rail
    carried = height / (load * flexibility) + share
    touches, alone = np.flatnonzero(carried > 0.0), np.flatnonzero(carried > 1.0)
    last = alone[0] if alone.size else x.size - 1
    return LoadTransfer(float(x[touches[0]]), float(x[last]), share, flexibility, blade.direction)


def static_compliances(matrices: TrackMatrices, position: float) -> tuple[float, float, float]:
    """Static deflection per force of stock rail, of either rail under a force on the other, and of the blade.

    Parameters
    ----------
    matrices : TrackMatrices
        Of a track with a blade.
    position : float
        On the blade; values are interpolated between the nodes beside it. [m]

    Returns
    -------
    (float, float, float)
        [m/N]
    """
    names = {row: name for name, row in matrices.index.items() if name[0] == "blade"}
    last = matrices.blade_start + len(matrices.blade_rows) - 1
    behind = int(np.clip(np.searchsorted(matrices.node, position), matrices.blade_start + 1, last))
    nodes = [n for n in (behind - 1, behind) if matrices.blade_rows[n - matrices.blade_start] in names]
    pairs = []
    for node in nodes:
        rows = [int(matrices.node_index[node]), int(matrices.blade_rows[node - matrices.blade_start])]
        h = responses(matrices, [0.0], [float(matrices.node[node]), names[rows[1]]], rows)[0].real
        pairs.append((h[0, 0], h[0, 1], h[1, 1]))
    means = [np.interp(position, matrices.node[nodes], values) for values in zip(*pairs)]
    return float(means[0]), float(means[1]), float(means[2])


def blade_rows(matrices: TrackMatrices) -> np.ndarray:
    """Row of the deflection of the blade at each node of the rail; that of the rail where there is no blade.

    Parameters
    ----------
    matrices : TrackMatrices
        Of the track.

    Returns
    -------
    (n_node,) array of int
    """
    rows = matrices.node_index.copy()
    if matrices.blade_rails:
        rows[matrices.blade_start : matrices.blade_start + len(matrices.blade_rows)] = matrices.blade_rows
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
