"""Vehicle matrices and stand-in tracks as the march takes them."""

from itertools import pairwise

import numpy as np

from turnout.simulate.frequency import receptance
from turnout.simulate.state import VehicleArrays


def vehicle_arrays(vehicle, scheme, stand_in):
    """Inverse of s² M + s C + K of each block of coupled rows; ``stand_in`` is (mass, damping, stiffness)."""
    mass, damping, stiffness, weight = vehicle.matrices
    starts = vehicle.blocks
    size, count = int(np.max(np.diff(starts))), starts.size - 1
    kind = scheme.tau.dtype
    answer, by_v, by_z = (np.zeros((count, size, size), dtype=kind) for _ in range(3))
    by_weight = np.zeros(vehicle.n, dtype=kind)
    block_of = np.zeros(vehicle.n, dtype=np.int64)
    for b, (i, j) in enumerate(pairwise(starts)):
        part = np.s_[i:j, i:j]
        inverse = np.linalg.inv(scheme.s**2 * mass[part] + scheme.s * damping[part] + stiffness[part])
        n = j - i
        answer[b, :n, :n] = inverse
        by_v[b, :n, :n] = scheme.weight * scheme.s * inverse @ mass[part]
        by_z[b, :n, :n] = scheme.weight * inverse @ stiffness[part]
        by_weight[i:j] = scheme.weight * inverse @ weight[i:j]
        block_of[i:j] = b
    m, c, k = stand_in
    n_wheel = len(vehicle.wheels)
    scalar = np.full(n_wheel, 1.0 / (scheme.s**2 * m + scheme.s * c + k), dtype=kind)
    return VehicleArrays(
        starts, block_of, answer, by_v, by_z, by_weight, np.full(n_wheel, m), np.full(n_wheel, k), scalar
    )


def stand_in_of(prepared, place):
    """Mass, damping and stiffness of one oscillator that answers like the track at ``place``, 5-200 Hz.

    The stiffness is the static one, so that a wheel rolls on to the modelled track without a step; mass and
    damping are the least-squares fit of the dynamic stiffness.
    """
    rows, weights = prepared.matrices.rail_weights(place)
    compliance = weights @ prepared.static_response(rows, weights)[rows] + prepared.matrices.compliance(place)
    frequency = np.linspace(5.0, 200.0, 40)
    omega = 2.0 * np.pi * frequency
    dynamic = 1.0 / receptance(prepared.matrices, frequency, place, place)
    mass = float(np.sum(omega**2 * (1.0 / compliance - dynamic.real)) / np.sum(omega**4))
    damping = float(np.sum(omega * dynamic.imag) / np.sum(omega**2))
    return max(mass, 20.0), max(damping, 0.0), 1.0 / compliance
