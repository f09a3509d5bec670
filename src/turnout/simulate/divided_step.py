r"""March a run to its end, and divide a step in which Newton's iteration fails.

A damper that is lost within micrometres of deformation lets the force of its support change against the motion. In a
long step Newton's iteration can then alternate between two states for ever. The flexibility of the track within a step,
some :math:`\Delta t^2 / m`, falls with the step, and with it the product with the slope of any law without a jump. So
the equations of a short enough step have one solution, which is found. A step that fails is therefore halved until its
parts converge. All other steps are the same as without this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.march import CONVERGED, LEFT_TRACK, NEWTON
from turnout.simulate.preparation import Prepared, prepare
from turnout.simulate.state import VehicleArrays, vehicle_arrays
from turnout.simulate.statics import law_forces
from turnout.simulate.vehicle import lone_wheels

if TYPE_CHECKING:
    from turnout.simulate.state import Motion, PortArrays, RunArrays
    from turnout.simulate.vehicle import Vehicle

Pulse = Callable[[np.ndarray], np.ndarray]  # force [N] of time [s]
MAX_DIVISIONS = 6  # halvings of a step, to 1/64 of it


@dataclass(frozen=True)
class Course:
    """What happens in a run, for time steps of any size.

    ``vehicle`` None: no wheels. ``stand_in`` mass, damping and stiffness of the stand-in track. ``ports`` at time 0
    with the ``labels`` of them. ``run`` for the steps of the run, ``pulses`` the given forces of it. ``halved`` caches
    the track for steps of other sizes.
    """

    vehicle: Vehicle | None
    stand_in: tuple[float, float, float]
    ports: PortArrays
    labels: Sequence[str]
    run: RunArrays
    pulses: Sequence[tuple[float | tuple, Pulse]]
    marcher: Callable[..., tuple[int, int, int, float, int]]
    halved: dict[float, Prepared] = field(default_factory=dict, compare=False, repr=False)


def march_to_end(
    course: Course, prepared: Prepared, motion: Motion, n_step: int, n_force: int, start: float = 0.0, divided: int = 0
) -> tuple[np.ndarray, np.ndarray, int]:
    """March ``n_step`` steps of the size of ``prepared``, divided where Newton's iteration fails.

    Parameters
    ----------
    course : Course
        The run.
    prepared : Prepared
        The track, for the size of the steps.
    motion : Motion
        State at ``start``; overwritten with that at the end.
    n_step : int
        Number of time steps.
    n_force : int
        Number of steps of which the port forces are returned: all or none.
    start : float
        Time of the first step. [s]
    divided : int
        How often the steps of the run are halved.

    Returns
    -------
    ((n_probe, n_step) array, (n_port, n_force) array, int)
        Signals; mean force of each port over each step [N]; Newton iterations in total. Those of a divided step are
        the means of its parts.

    Raises
    ------
    SimulationError
        Where a wheel leaves the track, or a step fails that was halved ``MAX_DIVISIONS`` times.
    """
    bodies = _bodies(course, prepared)
    signals = np.zeros((course.run.sensor_order.size, n_step))
    forces = np.zeros((course.ports.body.size, n_force))
    first = total = 0
    while first < n_step:
        out, out_force = np.zeros_like(signals[:, first:]), np.zeros_like(forces[:, first:])
        time = start + first * prepared.dt
        ports, run = _later(course, prepared, time, n_step - first)
        status, step, port, residual, iterations = course.marcher(
            prepared.arrays, prepared.scheme, bodies, ports, run, motion, n_step - first, out, out_force
        )
        signals[:, first : first + step], forces[:, first : first + step] = out[:, :step], out_force[:, :step]
        first, total, time = first + step, total + iterations, time + step * prepared.dt
        if status == CONVERGED:
            break
        if status != NEWTON or divided == MAX_DIVISIONS:
            raise_failure(prepared, course.ports, course.labels, status, time, port, residual)
        motion.force[:] = np.repeat(law_forces(ports, motion.deformation)[0], prepared.scheme.node.size)
        half = _at_half_step(course, prepared)
        half_motion = _with_padding_of(motion, prepared, half)
        halves = march_to_end(course, half, half_motion, 2, 2 * (n_force > 0), time, divided + 1)
        motion.u[:], motion.v[:] = _with_padding_of(half_motion, half, prepared)[:2]
        signals[:, first], total = halves[0].mean(axis=1), total + halves[2]
        if n_force:
            forces[:, first] = halves[1].mean(axis=1)
        first += 1
    return signals, forces, total


def raise_failure(
    prepared: Prepared, ports: PortArrays, labels: Sequence[str], status: int, time: float, port: int, value: float
) -> NoReturn:
    """Raise the error of a march that stopped.

    Parameters
    ----------
    prepared : Prepared
        The track.
    ports : PortArrays
        Wheel contacts and ports of terms at time 0.
    labels : sequence of str
        Name of each port.
    status : int
        ``LEFT_TRACK`` or ``NEWTON``.
    time : float
        Time at which it stopped. [s]
    port : int
        Port that stopped it.
    value : float
        Position of the port [m], or its residual [N].

    Raises
    ------
    SimulationError
        With time, port and value.
    """
    if status == LEFT_TRACK:
        a, b = prepared.matrices.node[[0, -1]]
        raise SimulationError(
            f"{labels[port]} leaves the track at {time:.4f} s: it is at {value:.3f} m, "
            f"the track goes from {a:.3f} m to {b:.3f} m."
        )
    position = f"{'which started at ' if ports.wheel[port] >= 0 else ''}{ports.place[port]:.3f} m"
    raise SimulationError(
        f"Newton's iteration did not converge at {time:.6f} s: residual {value:.3g} N at {labels[port]}, {position}. "
        f"It fails in a step of {prepared.dt:.3g} s, too. Use a law whose force has no jump, or a smaller time step."
    )


def pulse_forces(
    pulses: Sequence[tuple[float | tuple, Pulse]], prepared: Prepared, n_step: int, start: float = 0.0
) -> np.ndarray:
    """Given forces at the stages of each step.

    Parameters
    ----------
    pulses : sequence of (point, callable)
        Given forces [N] as functions of time [s].
    prepared : Prepared
        The track, for the size of the steps.
    n_step : int
        Number of time steps.
    start : float
        Time of the first step. [s]

    Returns
    -------
    (n_pulse, n_step, n_stage) array of float
        Forces. [N]

    Raises
    ------
    SimulationError
        For a force that is not a number.
    """
    node = prepared.scheme.node
    forces = np.zeros((len(pulses), n_step if len(pulses) else 1, node.size))
    for row, (_, pulse) in zip(forces, pulses):
        time = start + (np.arange(n_step)[:, None] + node) * prepared.dt
        row[:] = pulse(time)
        if not np.all(is_finite := np.isfinite(row)):
            raise SimulationError(f"the given force is not a number at {time[~is_finite][0]:.6f} s.")
    return forces


def _bodies(course: Course, prepared: Prepared) -> VehicleArrays:
    if course.vehicle is not None:
        return vehicle_arrays(course.vehicle, prepared.scheme, course.stand_in)
    # arrays of the right types for the kernels, but no block of bodies that moves
    bodies = vehicle_arrays(lone_wheels(1.0), prepared.scheme, course.stand_in)
    return bodies._replace(block_start=bodies.block_start[:1])


def _later(course: Course, prepared: Prepared, time: float, n_step: int) -> tuple[PortArrays, RunArrays]:
    """Ports and run as seen from ``time``, which is time 0 of the march, with the given forces of steps of its size."""
    travelled = np.where(course.ports.body >= 0, course.run.speed * time, 0.0)
    forces = pulse_forces(course.pulses, prepared, n_step, time)
    return course.ports._replace(place=course.ports.place + travelled), course.run._replace(pulse_force=forces)


def _at_half_step(course: Course, prepared: Prepared) -> Prepared:
    """The same track for steps of half the size."""
    dt = 0.5 * prepared.dt
    if dt not in course.halved:
        course.halved[dt] = prepare(
            prepared.track, dt, prepared.scheme_name, prepared.terms, matrices=prepared.matrices
        )
    return course.halved[dt]


def _with_padding_of(motion: Motion, source: Prepared, target: Prepared) -> Motion:
    """The motion with the padding of another size of step; all arrays but those of the track are the same ones."""
    n, pads = source.arrays.n, (source.arrays.pad, target.arrays.pad)
    u, v = (np.pad(a[pads[0] : pads[0] + n], pads[1]) for a in (motion.u, motion.v))
    return motion._replace(u=u, v=v)
