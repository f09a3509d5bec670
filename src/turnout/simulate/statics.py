"""Compute the static equilibrium of train and track, the initial state of a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.force_laws import POWER
from turnout.simulate.kernels import law_force
from turnout.simulate.state import Motion

if TYPE_CHECKING:
    from turnout.simulate.preparation import Prepared
    from turnout.simulate.state import PortArrays
    from turnout.simulate.vehicle import Vehicle


def motion_at_rest(prepared: Prepared, ports: PortArrays, vehicle: Vehicle | None = None) -> Motion:
    """Motion of a track at rest without any force; ``vehicle`` is at its zero position without contact.

    Parameters
    ----------
    prepared : Prepared
        The factorised track.
    ports : PortArrays
        Wheel contacts and ports of terms.
    vehicle : Vehicle or None
        The train; None: no bodies.

    Returns
    -------
    Motion
        All zero, but the deformation of a port is minus its gap.
    """
    t, n_port = prepared.arrays, ports.body.size
    wide = t.n + 2 * t.pad
    n, wheels = (vehicle.n, len(vehicle.wheels)) if vehicle else (0, 0)
    stages = prepared.scheme.node.size
    return Motion(
        np.zeros(wide),
        np.zeros(wide),
        np.zeros(n),
        np.zeros(n),
        np.zeros(wheels),
        np.zeros(wheels),
        np.zeros(n_port * stages),
        -ports.gap.copy(),
    )


TOLERANCE = 1e-7  # N, largest residual of an equilibrium; it grows with the largest load above 100 kN


def equilibrium(
    prepared: Prepared,
    vehicle: Vehicle,
    ports: PortArrays,
    initial_ports: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    stand_in_stiffness: float,
) -> Motion:
    """Motion in static equilibrium under the weight of ``vehicle``, all velocities 0.

    Newton's method on all port forces and wheel positions.

    Parameters
    ----------
    prepared : Prepared
        The factorised track.
    vehicle : Vehicle
        The train.
    ports : PortArrays
        Wheel contacts and ports of terms.
    initial_ports : tuple of (n_port, ...) arrays
        Rows, weights, local compliance, stand-in share and dip of every port at time 0.
    stand_in_stiffness : float
        Stiffness of the stand-in track. [N/m]

    Returns
    -------
    Motion
        State at rest with its port forces.

    Raises
    ------
    SimulationError
        If the residual is not below ``TOLERANCE`` after 50 steps, or if these diverge.
    """
    rows, weights, local, share, dip = initial_ports
    n_port = ports.body.size
    columns = np.zeros((n_port, prepared.arrays.n))
    for k in np.flatnonzero(np.any(weights != 0.0, axis=1)):
        columns[k] = prepared.static_response(rows[k], weights[k])
    flexibility = np.array([[weights[i] @ columns[j][rows[i]] for j in range(n_port)] for i in range(n_port)])
    flexibility = flexibility.reshape(n_port, n_port)
    same_wheel = (ports.wheel[:, None] == ports.wheel[None, :]) & (ports.wheel[:, None] >= 0)
    same_element = rows[:, :1] == rows[:, 0]
    flexibility += np.where(
        same_wheel,
        np.outer(share, share) / stand_in_stiffness + np.where(same_element, np.sqrt(np.outer(local, local)), 0.0),
        0.0,
    )
    on_level_rail = vehicle.static_loads
    stiff, load, touches = _wheel_stiffness(vehicle, ports)
    force = touches.T @ on_level_rail / np.maximum(touches.sum(0), 1.0)
    wheel_z = _first_guess(ports, touches, flexibility, force, dip)
    n = n_port + wheel_z.size
    for _ in range(50):
        d = touches.T @ wheel_z - flexibility @ force - dip
        f, slope = law_forces(ports, d)
        residual = np.concatenate([force - f, stiff @ wheel_z - load + touches @ force])
        if np.max(np.abs(residual)) < TOLERANCE * max(1.0, np.max(np.abs(load), initial=0.0) / 1e5):
            return _motion(prepared, vehicle, ports, force, wheel_z, columns, share, stand_in_stiffness, d)
        jacobian = np.zeros((n, n))
        jacobian[:n_port, :n_port] = np.eye(n_port) + slope[:, None] * flexibility
        jacobian[:n_port, n_port:] = -slope[:, None] * touches.T
        jacobian[n_port:, :n_port], jacobian[n_port:, n_port:] = touches, stiff
        # Least squares: the position of a wheel with a given force is not determined.
        try:
            change = np.linalg.lstsq(jacobian, residual, rcond=1e-15)[0]
        except np.linalg.LinAlgError:  # the steps diverge, to numbers too large for it
            break
        force, wheel_z = force - change[:n_port], wheel_z - change[n_port:]
    worst = int(np.argmax(np.abs(residual)))
    raise SimulationError(
        f"static equilibrium at time 0 s not found: residual {residual[worst]:.3g} N at port {worst} of {n_port}, "
        f"{ports.place[min(worst, n_port - 1)]:.3f} m."
    )


def _wheel_stiffness(vehicle: Vehicle, ports: PortArrays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffness and load of the wheels with the sprung rows eliminated; matrix of the ports of each wheel."""
    _, _, stiffness, weight = vehicle.matrices
    wheels = vehicle.wheel_rows
    sprung = np.setdiff1d(np.arange(vehicle.n), wheels)
    touches = (np.arange(len(wheels))[:, None] == ports.wheel[None, :]).astype(float)
    inner = np.linalg.solve(
        stiffness[np.ix_(sprung, sprung)], np.column_stack([stiffness[np.ix_(sprung, wheels)], weight[sprung]])
    )
    across = stiffness[np.ix_(wheels, sprung)]
    stiff = stiffness[np.ix_(wheels, wheels)] - across @ inner[:, :-1]
    return stiff, weight[wheels] - across @ inner[:, -1], touches


def _first_guess(
    ports: PortArrays, touches: np.ndarray, flexibility: np.ndarray, force: np.ndarray, dip: np.ndarray
) -> np.ndarray:
    below = flexibility @ force + dip
    approach = np.zeros_like(force)
    for k in np.flatnonzero(ports.wheel >= 0):
        stiffness, exponent, preload = ports.numbers[k]
        if ports.law_code[k] == POWER:
            approach[k] = (abs(force[k]) / stiffness) ** (1.0 / exponent)
        elif stiffness > 0.0:
            approach[k] = (force[k] - preload) / stiffness
    with np.errstate(invalid="ignore"):
        return np.array([np.min((below + approach)[row > 0.0]) for row in touches])


def law_forces(ports: PortArrays, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces of all ports at rest.

    Parameters
    ----------
    ports : PortArrays
        Wheel contacts and ports of terms.
    d : (n_port,) array of float
        Deformations. [m]

    Returns
    -------
    ((n_port,) array, (n_port,) array)
        Forces [N] and their derivatives by deformation [N/m].
    """
    f, slope = np.zeros(d.size), np.zeros(d.size)
    for k in range(d.size):
        first, last = ports.table_start[k], ports.table_start[k + 1]
        f[k], slope[k], _ = law_force(ports.law_code[k], ports.numbers, k, ports.table, first, last, d[k], 0.0)
    return f, slope


def _motion(
    prepared: Prepared,
    vehicle: Vehicle,
    ports: PortArrays,
    force: np.ndarray,
    wheel_z: np.ndarray,
    columns: np.ndarray,
    share: np.ndarray,
    stand_in_stiffness: float,
    d: np.ndarray,
) -> Motion:
    motion = motion_at_rest(prepared, ports, vehicle)
    pad, n = prepared.arrays.pad, prepared.arrays.n
    motion.u[pad : pad + n] = force @ columns
    _, _, stiffness, weight = vehicle.matrices
    wheels = vehicle.wheel_rows
    sprung = np.setdiff1d(np.arange(vehicle.n), wheels)
    motion.z[wheels] = wheel_z
    if sprung.size:
        right = weight[sprung] - stiffness[np.ix_(sprung, wheels)] @ wheel_z
        motion.z[sprung] = np.linalg.solve(stiffness[np.ix_(sprung, sprung)], right)
    for k in np.flatnonzero(ports.wheel >= 0):
        motion.y[ports.wheel[k]] += share[k] * force[k] / stand_in_stiffness
    motion.force[:] = np.repeat(force, prepared.scheme.node.size)
    motion.deformation[:] = d
    return motion
