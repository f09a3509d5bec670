"""The parts of one time step; compiled: free motion, response to port forces, sensor records, state at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.kernel_cache import inner_kernel
from turnout.simulate.band_matrix import momentum_minus_force, multiply
from turnout.simulate.band_solution import solve, solve6_from_both_ends, solve_from_both_ends

if TYPE_CHECKING:
    from turnout.simulate.state import Motion, PortArrays, RunArrays, SchemeArrays, TrackArrays, VehicleArrays


@inner_kernel
def free_motion(
    track: TrackArrays,
    scheme: SchemeArrays,
    bodies: VehicleArrays,
    run: RunArrays,
    motion: Motion,
    step: int,
    d: np.ndarray,
    e: np.ndarray,
    e_stand_in: np.ndarray,
    mass_v: np.ndarray,
    stiff_u: np.ndarray,
) -> None:
    """Right-hand sides and solution of the step with all ports free.

    Parameters
    ----------
    track : TrackArrays
        Factorised track.
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    bodies : VehicleArrays
        Inverse matrices of the bodies and of the stand-in tracks.
    run : RunArrays
        Paths, given forces and sensors of this run.
    motion : Motion
        State at the start of the step.
    step : int
        Number of the step.
    d : (n_padded,) array
        Stage increment of the track; overwritten. [m]
    e : (n_body_row,) array
        Stage increment of the bodies; overwritten. [m]
    e_stand_in : (n_wheel,) array
        Stage increment of the stand-in tracks; overwritten. [m]
    mass_v : (n,) array of float
        Workspace for M v. [kg m/s]
    stiff_u : (n,) array of float
        Workspace for K u. [N]
    """
    pad, n = track.pad, track.n
    by_v, by_u = scheme.weight * scheme.s, scheme.weight
    if track.mass.shape[0] == 9 or track.mass.shape[0] == 13:
        momentum_minus_force(track.mass, track.stiffness, motion.v, motion.u, by_v, by_u, pad, d, n)
    else:
        multiply(track.mass, motion.v, pad, mass_v, n)
        multiply(track.stiffness, motion.u, pad, stiff_u, n)
        inner = d[pad : pad + n]
        for i in range(n):
            inner[i] = by_v * mass_v[i] - by_u * stiff_u[i]
    for k in range(run.pulse_rows.shape[0]):
        for a in range(scheme.node.size):
            f = scheme.tau[a] * run.pulse_force[k, step, a]
            for i in range(4):
                d[pad + run.pulse_rows[k, i]] += f * run.pulse_weights[k, i]
    back = track.lower_back, track.upper_back, track.pivot_back
    if track.middle.shape[0] == 4:
        solve_from_both_ends(track.lower, track.upper, track.inverse_pivot, *back, track.middle, d, pad, n)
    elif track.middle.shape[0] == 6:
        solve6_from_both_ends(track.lower, track.upper, track.inverse_pivot, *back, track.middle, d, pad, n)
    else:
        solve(track.lower, track.upper, track.inverse_pivot, d, pad, n)
    for block in range(bodies.block_start.size - 1):
        start, stop = bodies.block_start[block], bodies.block_start[block + 1]
        for i in range(start, stop):
            value = bodies.from_weight[i]
            for j in range(start, stop):
                value += bodies.from_velocity[block, i - start, j - start] * motion.w[j]
                value -= bodies.from_position[block, i - start, j - start] * motion.z[j]
            e[i] = value
    for i in range(motion.y.size):
        momentum = scheme.s * bodies.stand_in_mass[i] * motion.x[i]
        free_force = momentum - bodies.stand_in_stiffness[i] * motion.y[i]
        e_stand_in[i] = bodies.stand_in_response[i] * scheme.weight * free_force


@inner_kernel
def free_deformation(
    track: TrackArrays,
    scheme: SchemeArrays,
    ports: PortArrays,
    motion: Motion,
    d: np.ndarray,
    e: np.ndarray,
    e_stand_in: np.ndarray,
    rows: np.ndarray,
    weights: np.ndarray,
    share: np.ndarray,
    dip: np.ndarray,
    d0: np.ndarray,
) -> None:
    """Deformation of every port stage without any port force.

    Parameters
    ----------
    track : TrackArrays
        Factorised track.
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    ports : PortArrays
        Wheel contacts and ports of terms.
    motion : Motion
        State at the start of the step.
    d : (n_padded,) array
        Stage increment D of the track. [m]
    e : (n_body_row,) array
        Stage increment of the bodies. [m]
    e_stand_in : (n_wheel,) array
        Stage increment of the stand-in tracks. [m]
    rows : (n_stage, 4) array of int
        Rows of the rail under each port stage.
    weights : (n_stage, 4) array of float
        Weights of these rows.
    share : (n_stage,) array of float
        Share of the stand-in track at each port stage.
    dip : (n_stage,) array of float
        Dip or gap at each port stage. [m]
    d0 : (n_stage,) array of float
        Overwritten with the deformations. [m]
    """
    stages, pad, t = scheme.node.size, track.pad, scheme.t
    u, z, y, bodies_of, wheels = motion.u, motion.z, motion.y, ports.body, ports.wheel
    for i in range(bodies_of.size):
        body, wheel = bodies_of[i], wheels[i]
        for a in range(stages):
            k = i * stages + a
            value = -dip[k]
            for j in range(4):
                r = pad + rows[k, j]
                value -= weights[k, j] * (u[r] + scheme.scale * (t[a] * d[r]).real)
            if body >= 0:
                value += z[body] + scheme.scale * (t[a] * e[body]).real
                if share[k] != 0.0:
                    value -= share[k] * (y[wheel] + scheme.scale * (t[a] * e_stand_in[wheel]).real)
            d0[k] = value


@inner_kernel
def add_port_forces(
    track: TrackArrays,
    scheme: SchemeArrays,
    bodies: VehicleArrays,
    ports: PortArrays,
    force: np.ndarray,
    rows: np.ndarray,
    weights: np.ndarray,
    share: np.ndarray,
    d: np.ndarray,
    e: np.ndarray,
    e_stand_in: np.ndarray,
) -> None:
    """Add the response to the port forces to the free motion, through windows of the inverse.

    Parameters
    ----------
    track : TrackArrays
        Factorised track.
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    bodies : VehicleArrays
        Inverse matrices of the bodies and of the stand-in tracks.
    ports : PortArrays
        Wheel contacts and ports of terms.
    force : (n_stage,) array of float
        Force of each port stage. [N]
    rows : (n_stage, 4) array of int
        Rows of the rail under each port stage.
    weights : (n_stage, 4) array of float
        Weights of these rows.
    share : (n_stage,) array of float
        Share of the stand-in track at each port stage.
    d : (n_padded,) array
        Stage increment of the track, to which the response is added. [m]
    e : (n_body_row,) array
        Stage increment of the bodies, to which the response is added. [m]
    e_stand_in : (n_wheel,) array
        Stage increment of the stand-in tracks, to which the response is added. [m]
    """
    stages, tau, window, width = scheme.node.size, scheme.tau, track.window, 2 * track.pad + 1
    body_of, wheel_of, response, stand_in_response = ports.body, ports.wheel, bodies.response, bodies.stand_in_response
    block_of, block_start = bodies.block_of, bodies.block_start
    for i in range(body_of.size):
        total, first = 0.0 * tau[0], i * stages
        same = stages == 2 and rows[first, 0] == rows[first + 1, 0] and rows[first, 3] == rows[first + 1, 3]
        for a in range(stages):
            k = first + a
            amount = tau[a] * force[k]
            total += amount
            if share[k] != 0.0:
                e_stand_in[wheel_of[i]] += amount * share[k] * stand_in_response[wheel_of[i]]
            if same and a == 0:
                continue
            for j in range(4):
                c, r = amount * weights[k, j], rows[k, j]
                if same:
                    c += tau[0] * force[first] * weights[first, j]
                if c != 0.0:
                    add_window(d, window, r, width, c)
        body = body_of[i]
        if body >= 0:
            block = block_of[body]
            start = block_start[block]
            for j in range(start, block_start[block + 1]):
                e[j] -= total * response[block, j - start, body - start]


@inner_kernel
def add_window(d: np.ndarray, window: np.ndarray, r: int, width: int, c: complex) -> None:
    """``d[r:r+width]`` += c times row ``r`` of the windows.

    Parameters
    ----------
    d : (n_padded,) array
        Vector that is changed.
    window : (n, width) array
        Windows of the inverse.
    r : int
        Row of the window, and index of its first entry in ``d``.
    width : int
        Width of the windows.
    c : complex
        Factor; real for the midpoint rule.
    """
    near, row = d[r : r + width], window[r]
    for m in range(width):
        near[m] += c * row[m]


@inner_kernel
def record(
    track: TrackArrays, scheme: SchemeArrays, run: RunArrays, motion: Motion, d: np.ndarray, step: int, out: np.ndarray
) -> None:
    """Sensor signals of the current step: mean acceleration, mean velocity or mid-step displacement.

    Parameters
    ----------
    track : TrackArrays
        Factorised track.
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    run : RunArrays
        Paths, given forces and sensors of this run.
    motion : Motion
        State at the start of the step.
    d : (n_padded,) array
        Stage increment D of the track. [m]
    step : int
        Number of the step.
    out : (n_sensor, n_step) array of float
        Its column ``step`` is overwritten.
    """
    for m in range(out.shape[0]):
        value = 0.0
        for j in range(4):
            r = track.pad + run.sensor_rows[m, j]
            if run.sensor_order[m] == 2:
                rise = (scheme.carry - 1.0) * motion.v[r]
                change = (rise + scheme.scale * (scheme.delta * scheme.s * d[r]).real) / scheme.dt
            elif run.sensor_order[m] == 1:
                change = scheme.scale * (scheme.delta * d[r]).real / scheme.dt
            else:
                change = motion.u[r] + 0.5 * scheme.scale * (scheme.delta * d[r]).real
            value += run.sensor_weights[m, j] * change
        out[m, step] = value


@inner_kernel
def advance(scheme: SchemeArrays, motion: Motion, d: np.ndarray, e: np.ndarray, e_stand_in: np.ndarray) -> None:
    """End of the step: u + scale Re(δ D) and R v + scale Re(δ s D) for track, bodies and stand-ins.

    Parameters
    ----------
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    motion : Motion
        Overwritten with the state at the end of the step.
    d : (n_padded,) array
        Stage increment D of the track. [m]
    e : (n_body_row,) array
        Stage increment of the bodies. [m]
    e_stand_in : (n_wheel,) array
        Stage increment of the stand-in tracks. [m]
    """
    by_d, by_s = scheme.delta, scheme.delta * scheme.s
    for i in range(motion.u.size):
        motion.u[i] += scheme.scale * (by_d * d[i]).real
        motion.v[i] = scheme.carry * motion.v[i] + scheme.scale * (by_s * d[i]).real
    for i in range(motion.z.size):
        motion.z[i] += scheme.scale * (by_d * e[i]).real
        motion.w[i] = scheme.carry * motion.w[i] + scheme.scale * (by_s * e[i]).real
    for i in range(motion.y.size):
        motion.y[i] += scheme.scale * (by_d * e_stand_in[i]).real
        motion.x[i] = scheme.carry * motion.x[i] + scheme.scale * (by_s * e_stand_in[i]).real
