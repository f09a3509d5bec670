"""The time integration again in plain numpy and LAPACK, written from the equations, to test the compiled one.

Slow (a few milliseconds a step) and without shortcuts: pivoted banded solves instead of LDL^T, whole columns of
the inverse instead of windows, one dense Newton system instead of clusters.
"""

import numpy as np
from scipy.linalg.lapack import zgbtrf, zgbtrs

from turnout.simulate.kernels import law_force
from turnout.simulate.march import CONVERGED, LEFT_TRACK, NEWTON
from turnout.simulate.port_system import locate_ports

ITERATIONS = 30


class _System:
    """(s² M + s C + K) rebuilt from the factors' matrix and solved with pivoting."""

    def __init__(self, track, half):
        n, width = track.n, track.lower.shape[1]
        d = 1.0 / track.inverse_pivot
        band = np.zeros((3 * width + 1, n), dtype=complex)
        lower = np.zeros((width + 1, n), dtype=complex)
        lower[0] = 1.0
        for k in range(width):
            lower[k + 1, : n - k - 1] = track.lower[k + 1 :, k]
        for i in range(width + 1):
            for j in range(width + 1):
                # column c of L times d[c]: contributes to row c + i, column c + j
                value = lower[i] * d * lower[j]
                columns = np.arange(n) + j
                inside = (columns < n) & (np.arange(n) + i < n)
                np.add.at(band, (2 * width + i - j, columns[inside]), value[inside])
        self.width = width
        self.lu, self.pivots, _ = zgbtrf(band, width, width)

    def solve(self, right):
        x, _ = zgbtrs(self.lu, self.width, self.width, np.asarray(right, dtype=complex), self.pivots)
        return x


def _times(diagonals, x):
    count, n = diagonals.shape
    half = count // 2
    padded = np.concatenate([np.zeros(half), x, np.zeros(half)])
    return sum(diagonals[k] * padded[k : k + n] for k in range(count))


def march_numpy(track, scheme, bodies, ports, run, motion, n_step, out, out_force):
    """Same arguments, results and effects as ``turnout.simulate.march.march``."""
    system = _System(track, track.lower.shape[1])
    stages, n_port, pad = scheme.node.size, ports.body.size, track.pad
    n = n_port * stages
    inner = np.s_[pad : pad + track.n]
    element = np.zeros(n_port, dtype=np.int64)
    x, local, share, dip = (np.zeros(n) for _ in range(4))
    rows, weights = np.zeros((n, 4), dtype=np.int64), np.zeros((n, 4))
    force = motion.force
    total = 0
    for step in range(n_step):
        u, v = motion.u[inner], motion.v[inner]
        right = scheme.weight * (scheme.s * _times(track.mass, v) - _times(track.stiffness, u))
        for k in range(len(run.pulse_rows)):
            amount = scheme.tau @ run.pulse_force[k, step]
            np.add.at(right, run.pulse_rows[k], amount * run.pulse_weights[k])
        lost = locate_ports(track, scheme, ports, run, step, element, x, rows, weights, local, share, dip)
        if lost >= 0:
            return LEFT_TRACK, step, lost, x[lost * stages], total
        b = np.zeros((n, track.n))
        for k in range(n):
            np.add.at(b[k], rows[k], weights[k])
        solved = system.solve(np.column_stack([right, b.T]))
        d, columns = solved[:, 0].copy(), solved[:, 1:]
        e, e_stand_in = _bodies_free(scheme, bodies, motion)
        d0 = _free(scheme, ports, motion, b, u, d, e, e_stand_in, share, dip)
        g = _flexibility(scheme, bodies, ports, b, columns, local, share, rows)
        status, count, where, worst, deformed = _newton(scheme, ports, g, d0, force, motion.deformation, run.tolerance)
        total += count
        if status != CONVERGED:
            return NEWTON, step, where, worst, total
        motion.deformation[:] = scheme.carry * motion.deformation + deformed.reshape(-1, stages) @ scheme.end
        if step < out_force.shape[1]:
            out_force[:, step] = force.reshape(-1, stages) @ scheme.quadrature
        amount = np.tile(scheme.tau, n_port) * force
        d += columns @ amount
        _bodies_forced(bodies, ports, amount, share, stages, e, e_stand_in)
        _record(scheme, run, u, v, d, step, out)
        for value, rate, z in ((u, v, d), (motion.z, motion.w, e), (motion.y, motion.x, e_stand_in)):
            value += scheme.scale * (scheme.delta * z).real
            rate[:] = scheme.carry * rate + scheme.scale * (scheme.delta * scheme.s * z).real
    return CONVERGED, n_step, -1, 0.0, total


def _bodies_free(scheme, bodies, motion):
    e = bodies.from_weight.copy()
    for k, (i, j) in enumerate(zip(bodies.block_start[:-1], bodies.block_start[1:], strict=True)):
        m = j - i
        if motion.z.size:
            e[i:j] += bodies.from_velocity[k, :m, :m] @ motion.w[i:j] - bodies.from_position[k, :m, :m] @ motion.z[i:j]
    e = e[: motion.z.size]
    wheels = motion.y.size
    rest = scheme.s * bodies.stand_in_mass[:wheels] * motion.x - bodies.stand_in_stiffness[:wheels] * motion.y
    return e, bodies.stand_in_response[:wheels] * scheme.weight * rest


def _free(scheme, ports, motion, b, u, d, e, e_stand_in, share, dip):
    stages = scheme.node.size
    t = np.tile(scheme.t, ports.body.size)
    body, wheel = np.repeat(ports.body, stages), np.repeat(ports.wheel, stages)
    d0 = -dip - b @ u - scheme.scale * (t * (b @ d)).real
    on = body >= 0
    d0[on] += motion.z[body[on]] + scheme.scale * (t[on] * e[body[on]]).real
    moved = motion.y[wheel[on]] + scheme.scale * (t[on] * e_stand_in[wheel[on]]).real
    d0[on] -= share[on] * moved
    return d0


def _flexibility(scheme, bodies, ports, b, columns, local, share, rows):
    stages, n = scheme.node.size, b.shape[0]
    body, wheel = np.repeat(ports.body, stages), np.repeat(ports.wheel, stages)
    h = (b @ columns).astype(complex)
    for p in range(n):
        for q in range(n):
            if body[p] >= 0 and body[q] >= 0 and bodies.block_of[body[p]] == bodies.block_of[body[q]]:
                block = bodies.block_of[body[p]]
                start = bodies.block_start[block]
                h[p, q] += bodies.response[block, body[p] - start, body[q] - start]
            if wheel[p] >= 0 and wheel[p] == wheel[q]:
                h[p, q] += share[p] * share[q] * bodies.stand_in_response[wheel[p]]
    t, tau = np.tile(scheme.t, n // stages), np.tile(scheme.tau, n // stages)
    g = scheme.scale * (t[:, None] * tau[None, :] * h).real
    stage = np.arange(n) % stages
    together = (stage[:, None] == stage[None, :]) & (wheel[:, None] == wheel[None, :]) & (wheel[:, None] >= 0)
    together &= rows[:, :1] == rows[:, 0]
    return g + np.where(together, np.sqrt(np.outer(local, local)), 0.0)


def _newton(scheme, ports, g, d0, force, before, tolerance):
    stages, n = scheme.node.size, d0.size
    deformed = d0
    if n == 0:
        return CONVERGED, 0, 0, 0.0, d0
    operator = np.kron(np.eye(n // stages), scheme.inverse) / scheme.dt
    for count in range(ITERATIONS):
        deformed = d0 - g @ force
        rate = operator @ (deformed - np.repeat(before, stages))
        values = np.array(
            [
                law_force(
                    ports.law_code[k // stages],
                    ports.numbers,
                    k // stages,
                    ports.table,
                    ports.table_start[k // stages],
                    ports.table_start[k // stages + 1],
                    deformed[k],
                    rate[k],
                )
                for k in range(n)
            ]
        )
        f, by_d, by_rate = values.T
        residual = force - f
        worst = np.max(np.abs(residual))
        if worst < tolerance:
            return CONVERGED, count, 0, worst, deformed
        jacobian = np.eye(n) + by_d[:, None] * g + by_rate[:, None] * (operator @ g)
        force -= np.linalg.solve(jacobian, residual)
    return NEWTON, ITERATIONS, int(np.argmax(np.abs(residual))) // stages, worst, deformed


def _bodies_forced(bodies, ports, amount, share, stages, e, e_stand_in):
    for k, a in enumerate(amount):
        body, wheel = ports.body[k // stages], ports.wheel[k // stages]
        if body >= 0:
            block = bodies.block_of[body]
            i, j = bodies.block_start[block], bodies.block_start[block + 1]
            e[i:j] -= a * bodies.response[block, : j - i, body - i]
            e_stand_in[wheel] += a * share[k] * bodies.stand_in_response[wheel]


def _record(scheme, run, u, v, d, step, out):
    for m in range(out.shape[0]):
        rows, weights = run.sensor_rows[m], run.sensor_weights[m]
        if run.sensor_order[m] == 2:
            change = (scheme.carry - 1.0) * v[rows] + scheme.scale * (scheme.delta * scheme.s * d[rows]).real
            out[m, step] = weights @ change / scheme.dt
        elif run.sensor_order[m] == 1:
            out[m, step] = weights @ (scheme.scale * (scheme.delta * d[rows]).real) / scheme.dt
        else:
            out[m, step] = weights @ (u[rows] + 0.5 * scheme.scale * (scheme.delta * d[rows]).real)
