"""Integrate the equations of motion in time; compiled.

Each step: free motion, the small system of all ports, their response, sensor records, the state at the end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.kernel_cache import borrowing_kernel
from turnout.simulate.port_system import evaluate, flexibility, locate_ports, newton_update
from turnout.simulate.time_step import add_port_forces, advance, free_deformation, free_motion, record
from turnout.simulate.workspace import new_workspace

if TYPE_CHECKING:
    from turnout.simulate.state import Motion, PortArrays, RunArrays, SchemeArrays, TrackArrays, VehicleArrays
    from turnout.simulate.workspace import Workspace

MAX_ITERATIONS = 60  # Newton iterations of a step
UNCHECKED_ITERATIONS = 12  # iterations before the residual is checked for progress
ROUNDING_TOLERANCE = 1000.0  # tolerances; stuck friction is so steep that rounded velocities do not determine it better
CONVERGED, NEWTON, LEFT_TRACK = range(3)


@borrowing_kernel
def _march_steps(
    track: TrackArrays,
    scheme: SchemeArrays,
    bodies: VehicleArrays,
    ports: PortArrays,
    run: RunArrays,
    motion: Motion,
    n_step: int,
    out: np.ndarray,
    out_force: np.ndarray,
    work: Workspace,
) -> tuple[int, int, int, float, int]:
    """``march`` in a given workspace. Were ``march`` compiled, too, all of this would be compiled once more in it."""
    stages, n_port = scheme.node.size, ports.body.size
    n = n_port * stages
    d, e, e_stand_in, x, order = work.d, work.e, work.e_stand_in, work.x, work.order
    rows, weights, local, share, dip = work.rows, work.weights, work.local, work.share, work.dip
    g, d0, deformed, f, by_d, by_rate = work.g, work.d0, work.deformed, work.f, work.by_d, work.by_rate
    force, change = motion.force, work.change
    iterations = 0
    for step in range(n_step):
        free_motion(track, scheme, bodies, run, motion, step, d, e, e_stand_in, work.mass_v, work.stiff_u)
        lost_port = locate_ports(track, scheme, ports, run, step, work.element, x, rows, weights, local, share, dip)
        if lost_port >= 0:
            return LEFT_TRACK, step, lost_port, x[lost_port * stages], iterations
        free_deformation(track, scheme, ports, motion, d, e, e_stand_in, rows, weights, share, dip, d0)
        flexibility(track, scheme, bodies, ports, rows, weights, local, share, d0, step == 0, work.fixed_response, g)
        for k in range(1, n_port):
            o, m = order[k], k
            while m > 0 and x[order[m - 1] * stages] > x[o * stages]:
                order[m] = order[m - 1]
                m -= 1
            order[m] = o
        converged, previous = n == 0, np.inf
        for trial in range(MAX_ITERATIONS):
            if n == 0:
                break
            worst, worst_port = evaluate(scheme, ports, n, g, d0, force, motion.deformation, deformed, f, by_d, by_rate)
            if worst < run.tolerance or (trial > UNCHECKED_ITERATIONS and worst < ROUNDING_TOLERANCE * run.tolerance):
                converged = True
                break
            iterations += 1
            if (
                trial > UNCHECKED_ITERATIONS and worst > 0.99 * previous
            ):  # oscillation about a kink: halve the last change
                for i in range(n):
                    change[i] *= 0.5
                    force[i] -= change[i]
                continue
            previous = worst
            newton_update(
                scheme, ports, order, x, run.cut, g, force, f, by_d, by_rate, change,
                work.matrix, work.right, work.active,
            )  # fmt: skip
        if not converged:
            return NEWTON, step, worst_port, worst, iterations
        for i in range(n_port):
            value = scheme.carry * motion.deformation[i]
            for a in range(stages):
                value += scheme.end[a] * deformed[i * stages + a]
            motion.deformation[i] = value
            if out_force.shape[1] > step:
                mean = 0.0
                for a in range(stages):
                    mean += scheme.quadrature[a] * force[i * stages + a]
                out_force[i, step] = mean
        add_port_forces(track, scheme, bodies, ports, force, rows, weights, share, d, e, e_stand_in)
        record(track, scheme, run, motion, d, step, out)
        advance(scheme, motion, d, e, e_stand_in)
    return CONVERGED, n_step, -1, 0.0, iterations


def march(
    track: TrackArrays,
    scheme: SchemeArrays,
    bodies: VehicleArrays,
    ports: PortArrays,
    run: RunArrays,
    motion: Motion,
    n_step: int,
    out: np.ndarray,
    out_force: np.ndarray,
) -> tuple[int, int, int, float, int]:
    """March ``n_step`` steps.

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
    run : RunArrays
        Paths, given forces and sensors of this run.
    motion : Motion
        State at the start; overwritten with that at the end.
    n_step : int
        Number of time steps.
    out : (n_sensor, n_step) array of float
        Overwritten with the sensor signals.
    out_force : (n_port, n_step) array of float
        Overwritten with the mean force of each port over each step [N]; not if it has no columns.

    Returns
    -------
    (int, int, int, float, int)
        Status (``CONVERGED``, ``NEWTON`` or ``LEFT_TRACK``); step and port where the march stopped; residual [N] or
        position [m] there; Newton iterations in total.
    """
    work = new_workspace(motion.u.size, track.n, motion.z.size, motion.y.size, ports.body.size, scheme.tau)
    return _march_steps(track, scheme, bodies, ports, run, motion, n_step, out, out_force, work)
