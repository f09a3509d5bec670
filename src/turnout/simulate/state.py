"""Arrays of the time march in the groups that the compiled code uses, with those of vehicles and stand-in tracks."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from turnout.simulate.frequency_response import receptance

if TYPE_CHECKING:
    from turnout.simulate.preparation import Prepared
    from turnout.simulate.vehicle import Vehicle


class TrackArrays(NamedTuple):
    """Factorised track; vectors carry ``pad`` zeros at both ends. ``window`` (n, 2 pad + 1) of the inverse.

    ``lower_back`` ... ``middle`` are for the solution from both ends, ``middle`` (0, 0) where it cannot be used.
    ``first_row`` to ``shear_flexibility`` (2, n_element) are those of the rail and of the line that changes to the
    blade.
    """

    n: int
    pad: int
    lower: np.ndarray
    upper: np.ndarray
    inverse_pivot: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    window: np.ndarray
    lower_back: np.ndarray
    upper_back: np.ndarray
    pivot_back: np.ndarray
    middle: np.ndarray
    node: np.ndarray
    first_row: np.ndarray
    last_row: np.ndarray
    shear_ratio: np.ndarray
    flexibility: np.ndarray
    shear_flexibility: np.ndarray


class SchemeArrays(NamedTuple):
    """Numbers of the scheme, see ``Scheme``; ``s`` is rate over time step."""

    dt: float
    s: complex
    t: np.ndarray
    tau: np.ndarray
    weight: complex
    delta: complex
    carry: float
    node: np.ndarray
    quadrature: np.ndarray
    inverse: np.ndarray
    scale: float
    end: np.ndarray


class VehicleArrays(NamedTuple):
    """Blocks of coupled bodies: E = from_velocity v - from_position z + from_weight; ``response`` is the inverse.

    ``stand_in_*`` are the scalar oscillators that carry a wheel outside the modelled track, (n_wheel,).
    """

    block_start: np.ndarray
    block_of: np.ndarray
    response: np.ndarray
    from_velocity: np.ndarray
    from_position: np.ndarray
    from_weight: np.ndarray
    stand_in_mass: np.ndarray
    stand_in_stiffness: np.ndarray
    stand_in_response: np.ndarray


class PortArrays(NamedTuple):
    """Ports in order of their position; ``body`` -1: between track and ground, else a wheel on path ``path`` of
    the ``line`` 0, the rail, or 1, the line that changes to the blade.

    ``place`` [m] at time 0, ``rows``, ``weights`` (n, 4) for fixed ports, ``gap`` [m]; ``law_code`` and ``numbers``
    (n, 3) of the force law, ``table_start`` (n + 1,) into the three table columns.
    """

    body: np.ndarray
    wheel: np.ndarray
    path: np.ndarray
    line: np.ndarray
    place: np.ndarray
    rows: np.ndarray
    weights: np.ndarray
    gap: np.ndarray
    law_code: np.ndarray
    numbers: np.ndarray
    table_start: np.ndarray
    table: np.ndarray


class RunArrays(NamedTuple):
    """Arrays of one run. ``ramp`` are the four positions where the modelled track fades in and out [m].

    ``path`` (n_path, n_piece, 4) are cubics in steps of ``path_step`` from ``path_start``. ``pulse_force``
    (n_pulse, n_step, n_stage) acts at ``pulse_rows``. Sensors have rows, weights and ``sensor_order``:
    2 acceleration, 1 velocity, 0 displacement.
    """

    speed: float
    ramp: np.ndarray
    stand_in: bool
    path_start: float
    path_step: float
    path: np.ndarray
    pulse_rows: np.ndarray
    pulse_weights: np.ndarray
    pulse_force: np.ndarray
    sensor_rows: np.ndarray
    sensor_weights: np.ndarray
    sensor_order: np.ndarray
    tolerance: float
    cut: float


class Motion(NamedTuple):
    """Padded ``u``, ``v`` of the track, ``z``, ``w`` of the bodies, ``y``, ``x`` of the stand-ins, ``force``."""

    u: np.ndarray
    v: np.ndarray
    z: np.ndarray
    w: np.ndarray
    y: np.ndarray
    x: np.ndarray
    force: np.ndarray
    deformation: np.ndarray


def vehicle_arrays(vehicle: Vehicle, scheme: SchemeArrays, stand_in: tuple[float, float, float]) -> VehicleArrays:
    """Inverse of s² M + s C + K of each block of coupled rows.

    Parameters
    ----------
    vehicle : Vehicle
        The train.
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    stand_in : (float, float, float)
        Mass [kg], damping [N s/m] and stiffness [N/m] of the stand-in track of each wheel.

    Returns
    -------
    VehicleArrays
        Inverses and the factors of the state.
    """
    mass, damping, stiffness, weight = vehicle.matrices
    starts = vehicle.blocks
    size, count = int(np.max(np.diff(starts))), starts.size - 1
    dtype = scheme.tau.dtype
    response, by_v, by_z = (np.zeros((count, size, size), dtype=dtype) for _ in range(3))
    by_weight = np.zeros(vehicle.n, dtype=dtype)
    block_of = np.zeros(vehicle.n, dtype=np.int64)
    for b, (i, j) in enumerate(pairwise(starts)):
        block = np.s_[i:j, i:j]
        inverse = np.linalg.inv(scheme.s**2 * mass[block] + scheme.s * damping[block] + stiffness[block])
        n = j - i
        response[b, :n, :n] = inverse
        by_v[b, :n, :n] = scheme.weight * scheme.s * inverse @ mass[block]
        by_z[b, :n, :n] = scheme.weight * inverse @ stiffness[block]
        by_weight[i:j] = scheme.weight * inverse @ weight[i:j]
        block_of[i:j] = b
    m, c, k = stand_in
    n_wheel = len(vehicle.wheels)
    scalar = np.full(n_wheel, 1.0 / (scheme.s**2 * m + scheme.s * c + k), dtype=dtype)
    return VehicleArrays(
        starts, block_of, response, by_v, by_z, by_weight, np.full(n_wheel, m), np.full(n_wheel, k), scalar
    )


def stand_in_of(prepared: Prepared, position: float) -> tuple[float, float, float]:
    """Mass, damping and stiffness of one oscillator that responds like the track at ``position``, 5-200 Hz.

    The stiffness is the static one, so that a wheel rolls onto the modelled track without a step. Mass and damping are
    fitted to the dynamic stiffness by least squares.

    Parameters
    ----------
    prepared : Prepared
        The factorised track.
    position : float
        Position on the rail. [m]

    Returns
    -------
    (float, float, float)
        Mass, at least 20 kg; damping [N s/m]; stiffness [N/m].
    """
    rows, weights = prepared.matrices.rail_weights(position)
    compliance = weights @ prepared.static_response(rows, weights)[rows] + prepared.matrices.compliance(position)
    frequency = np.linspace(5.0, 200.0, 40)
    omega = 2.0 * np.pi * frequency
    dynamic = 1.0 / receptance(prepared.matrices, frequency, position, position)
    mass = float(np.sum(omega**2 * (1.0 / compliance - dynamic.real)) / np.sum(omega**4))
    damping = float(np.sum(omega * dynamic.imag) / np.sum(omega**2))
    return max(mass, 20.0), max(damping, 0.0), 1.0 / compliance
