"""The small nonlinear system of the ports in a time step, compiled: positions, mutual flexibility, Newton's method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.kernel_cache import inline_kernel, inner_kernel
from turnout.simulate.kernels import law_force, path_at, rail_weights, ramp_at, solve_dense, window_product

OPEN_GAP = 3e-3  # m; a force of 100 kN moves wheel and rail by less than 0.5 mm, in a step by less still

if TYPE_CHECKING:
    from turnout.simulate.state import PortArrays, RunArrays, SchemeArrays, TrackArrays, VehicleArrays


@inline_kernel
def locate_ports(
    track: TrackArrays,
    scheme: SchemeArrays,
    ports: PortArrays,
    run: RunArrays,
    step: int,
    element: np.ndarray,
    x: np.ndarray,
    rows: np.ndarray,
    weights: np.ndarray,
    local: np.ndarray,
    share: np.ndarray,
    dip: np.ndarray,
) -> int:
    """Rows, weights, local compliance, stand-in share and dip of every port and stage.

    Parameters
    ----------
    track : TrackArrays
        Factorised track.
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    ports : PortArrays
        Wheel contacts and ports of terms.
    run : RunArrays
        Paths, given forces and sensors of this run.
    step : int
        Number of the step.
    element : (n_port,) array of int
        Element of each port at the last step; updated.
    x : (n_stage,) array of float
        Overwritten with the position of each port stage. [m]
    rows : (n_stage, 4) array of int
        Overwritten with the rows of the rail under each port stage.
    weights : (n_stage, 4) array of float
        Overwritten with the weights of these rows.
    local : (n_stage,) array of float
        Overwritten with the local compliance of the element. [m/N]
    share : (n_stage,) array of float
        Overwritten with the share of the stand-in track.
    dip : (n_stage,) array of float
        Overwritten with the dip of the path, or the gap of a fixed port. [m]

    Returns
    -------
    int
        -1, or the first port that is off the track.
    """
    stages, n_port = scheme.node.size, ports.body.size
    # Local names here and below: taking an array out of a tuple counts a reference, which is slow inside a loop.
    body, start, fixed_rows, fixed_weights, gap = ports.body, ports.place, ports.rows, ports.weights, ports.gap
    node, first_row, last_row, shear_ratio = track.node, track.first_row, track.last_row, track.shear_ratio
    flexible, shear_flexible = track.flexibility, track.shear_flexibility
    time, path, path_index, ramp, last = scheme.node, run.path, ports.path, run.ramp, track.node.size - 2
    line = ports.line
    first_position, last_position = node[0], node[last + 1]
    for i in range(n_port):
        for a in range(stages):
            k = i * stages + a
            if body[i] < 0:
                x[k], local[k], share[k], dip[k] = start[i], 0.0, 0.0, gap[i]
                for j in range(4):
                    rows[k, j], weights[k, j] = fixed_rows[i, j], fixed_weights[i, j]
                continue
            position = start[i] + run.speed * (step + time[a]) * scheme.dt
            x[k] = position
            dip[k] = path_at(path, path_index[i], run.path_start, run.path_step, position)
            r, share[k] = ramp_at(ramp, run.stand_in, position)
            local[k] = 0.0
            for j in range(4):
                weights[k, j] = 0.0
            if r == 0.0:
                continue
            if position < first_position or position > last_position:
                return i
            e = element[i]
            while e > 0 and position < node[e]:
                e -= 1
            while e < last and position >= node[e + 1]:
                e += 1
            element[i] = e
            local[k] = rail_weights(
                node, first_row, last_row, shear_ratio, flexible, shear_flexible, line[i], e, position, r, k,
                rows, weights,
            )  # fmt: skip
    return -1


@inner_kernel
def flexibility(
    track: TrackArrays,
    scheme: SchemeArrays,
    bodies: VehicleArrays,
    ports: PortArrays,
    rows: np.ndarray,
    weights: np.ndarray,
    local: np.ndarray,
    share: np.ndarray,
    d0: np.ndarray,
    is_first: bool,
    fixed_response: np.ndarray,
    g: np.ndarray,
) -> None:
    """Fill ``g``: by how much a unit force at port stage b reduces the deformation of port stage a.

    That between ports at fixed points, and the response of the track to them, are those of the first step. It is 0 for
    wheels more than ``OPEN_GAP`` above a surface, which no force of one step can close.

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
    rows : (n_stage, 4) array of int
        Rows of the rail under each port stage.
    weights : (n_stage, 4) array of float
        Weights of these rows.
    local : (n_stage,) array of float
        Local compliance of the element at each port stage. [m/N]
    share : (n_stage,) array of float
        Share of the stand-in track at each port stage.
    d0 : (n_stage,) array of float
        Deformation of each port stage without port forces. [m]
    is_first : bool
        Whether this is the first step.
    fixed_response : (n_port, n) array
        Displacement of the track per force at each port at a fixed point; filled in the first step. [m/N]
    g : (n_stage, n_stage) array of float
        Overwritten. [m/N]
    """
    stages, n_port, pad = scheme.node.size, ports.body.size, track.pad
    body, wheel, window, t, tau = ports.body, ports.wheel, track.window, scheme.t, scheme.tau
    block_of, block_start, response = bodies.block_of, bodies.block_start, bodies.response
    stand_in_response = bodies.stand_in_response
    if is_first:
        for j in range(n_port):
            if body[j] < 0:
                fill_response(window, pad, rows[j * stages], weights[j * stages], fixed_response[j])
    for i in range(n_port):
        i_open = wheel[i] >= 0 and d0[i * stages] < -OPEN_GAP and d0[(i + 1) * stages - 1] < -OPEN_GAP
        for j in range(i, n_port):
            if body[i] < 0 and body[j] < 0 and not is_first:
                continue
            if i_open or (wheel[j] >= 0 and d0[j * stages] < -OPEN_GAP and d0[(j + 1) * stages - 1] < -OPEN_GAP):
                for p in range(i * stages, (i + 1) * stages):
                    for q in range(j * stages, (j + 1) * stages):
                        g[p, q] = g[q, p] = 0.0
                continue
            body_response = 0.0 * tau[0]
            if body[i] >= 0 and body[j] >= 0 and block_of[body[i]] == block_of[body[j]]:
                block = block_of[body[i]]
                body_response += response[block, body[i] - block_start[block], body[j] - block_start[block]]
            same_wheel = wheel[i] >= 0 and wheel[i] == wheel[j]
            to_fixed = body[i] >= 0 and body[j] < 0
            for a in range(stages):
                p = i * stages + a
                p_is_away = weights[p, 0] == 0.0 and weights[p, 2] == 0.0
                at_fixed = 0.0 * tau[0]
                if to_fixed:
                    for k in range(4):
                        at_fixed += weights[p, k] * fixed_response[j, rows[p, k]]
                for b in range(stages):
                    q = j * stages + b
                    value = body_response
                    if to_fixed:
                        value += at_fixed
                    elif abs(rows[p, 0] - rows[q, 0]) <= pad + 8 and not (
                        p_is_away or (weights[q, 0] == 0.0 and weights[q, 2] == 0.0)
                    ):
                        value += window_product(window, pad, rows, weights, p, q)
                    if same_wheel:
                        value += share[p] * share[q] * stand_in_response[wheel[i]]
                    g[p, q] = scheme.scale * (t[a] * tau[b] * value).real
                    g[q, p] = scheme.scale * (t[b] * tau[a] * value).real
                    if a == b and i == j:
                        g[p, q] += local[p]
                    elif a == b and same_wheel and rows[p, 0] == rows[q, 0]:
                        shared = np.sqrt(local[p] * local[q])
                        g[p, q] += shared
                        g[q, p] += shared


@inner_kernel
def fill_response(window: np.ndarray, pad: int, rows: np.ndarray, weights: np.ndarray, response: np.ndarray) -> None:
    """Response of the track to a unit force at a fixed point.

    Parameters
    ----------
    window : (n, 2 pad + 1) array
        Windows of the inverse.
    pad : int
        Half width of the windows.
    rows : (4,) array of int
        Rows of the point.
    weights : (4,) array of float
        Weights of these rows.
    response : (n,) array
        Overwritten; 0 beyond the windows. [m/N]
    """
    for r in range(response.size):
        response[r] = 0.0
        for j in range(4):
            column = pad - r + rows[j]
            if 0 <= column <= 2 * pad:
                response[r] += weights[j] * window[r, column]


@inner_kernel
def evaluate(
    scheme: SchemeArrays,
    ports: PortArrays,
    n: int,
    g: np.ndarray,
    d0: np.ndarray,
    force: np.ndarray,
    previous: np.ndarray,
    d: np.ndarray,
    f: np.ndarray,
    by_d: np.ndarray,
    by_rate: np.ndarray,
) -> tuple[float, int]:
    """Deformations and law forces of all port stages.

    Parameters
    ----------
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    ports : PortArrays
        Wheel contacts and ports of terms.
    n : int
        Number of port stages.
    g : (n_stage, n_stage) array of float
        Flexibility from ``flexibility``. [m/N]
    d0 : (n_stage,) array of float
        Deformation without port forces. [m]
    force : (n_stage,) array of float
        Assumed force of each port stage. [N]
    previous : (n_port,) array of float
        Deformation at the start of the step. [m]
    d : (n_stage,) array of float
        Overwritten with the deformations. [m]
    f : (n_stage,) array of float
        Overwritten with the forces of the laws. [N]
    by_d : (n_stage,) array of float
        Overwritten with their derivatives by deformation. [N/m]
    by_rate : (n_stage,) array of float
        Overwritten with their derivatives by rate. [N s/m]

    Returns
    -------
    (float, int)
        Largest difference between force and law [N], and its port.
    """
    stages, inverse = scheme.node.size, scheme.inverse
    law_code, numbers, table, table_start = ports.law_code, ports.numbers, ports.table, ports.table_start
    for k in range(n):
        value = d0[k]
        for m in range(n):
            value -= g[k, m] * force[m]
        d[k] = value
    worst, worst_port = 0.0, 0
    for i in range(n // stages):
        first, last = table_start[i], table_start[i + 1]
        for a in range(stages):
            rate = 0.0
            for b in range(stages):
                rate += inverse[a, b] * (d[i * stages + b] - previous[i]) / scheme.dt
            k = i * stages + a
            f[k], by_d[k], by_rate[k] = law_force(law_code[i], numbers, i, table, first, last, d[k], rate)
            residual = abs(force[k] - f[k])
            if not residual <= worst:
                worst, worst_port = residual, i
    return worst, worst_port


@inner_kernel
def newton_update(
    scheme: SchemeArrays,
    ports: PortArrays,
    order: np.ndarray,
    x: np.ndarray,
    cut: float,
    g: np.ndarray,
    force: np.ndarray,
    f: np.ndarray,
    by_d: np.ndarray,
    by_rate: np.ndarray,
    change: np.ndarray,
    matrix: np.ndarray,
    right: np.ndarray,
    active: np.ndarray,
) -> None:
    """One Newton step for each cluster of neighbouring ports; the iteration resolves the coupling of distant ports.

    Parameters
    ----------
    scheme : SchemeArrays
        Coefficients of the integration scheme.
    ports : PortArrays
        Wheel contacts and ports of terms.
    order : (n_port,) array of int
        Ports in order of their positions.
    x : (n_stage,) array of float
        Position of each port stage. [m]
    cut : float
        Distance from which neighbouring ports are in different clusters. [m]
    g : (n_stage, n_stage) array of float
        Flexibility. [m/N]
    force : (n_stage,) array of float
        Force of each port stage; updated. [N]
    f : (n_stage,) array of float
        Force of each law. [N]
    by_d : (n_stage,) array of float
        Derivative of each law by deformation. [N/m]
    by_rate : (n_stage,) array of float
        Derivative of each law by rate. [N s/m]
    change : (n_stage,) array of float
        Overwritten with the change of each force. [N]
    matrix : (n_stage, n_stage) array of float
        Workspace of the linear system.
    right : (n_stage,) array of float
        Workspace of its right-hand side.
    active : (n_stage,) array of int
        Workspace: port stages whose force depends on the deformation.
    """
    stages, inverse = scheme.node.size, scheme.inverse
    n_port = order.size
    first = 0
    while first < n_port:
        last = first + 1
        while last < n_port and x[order[last] * stages] - x[order[last - 1] * stages] < cut:
            last += 1
        n = 0
        for o in range(first, last):
            for a in range(stages):
                k = order[o] * stages + a
                change[k] = f[k] - force[k]
                if by_d[k] != 0.0 or by_rate[k] != 0.0:
                    active[n] = k
                    n += 1
        for row in range(n):
            k = active[row]
            i, a = k // stages, k % stages
            right[row] = change[k]
            for o in range(first, last):
                for b in range(stages):
                    m = order[o] * stages + b
                    if by_d[m] == 0.0 and by_rate[m] == 0.0 and change[m] == 0.0:
                        continue
                    value = by_d[k] * g[k, m]
                    if by_rate[k] != 0.0:
                        for c in range(stages):
                            value += by_rate[k] * inverse[a, c] / scheme.dt * g[i * stages + c, m]
                    if by_d[m] == 0.0 and by_rate[m] == 0.0:
                        right[row] -= value * change[m]
                        continue
                    column = 0
                    while active[column] != m:
                        column += 1
                    matrix[row, column] = value + (1.0 if m == k else 0.0)
        solve_dense(matrix, right, n)
        for row in range(n):
            change[active[row]] = right[row]
        first = last
    for k in range(change.size):
        force[k] += change[k]
