"""Run one simulation: put a train or a hammer on a prepared track, integrate in time, return the signals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.between_nodes import element_deflection, is_between_nodes, rail_loads, step_mean
from turnout.simulate.blade import is_on_blade
from turnout.simulate.divided_step import Course, Pulse, march_to_end, pulse_forces, raise_failure
from turnout.simulate.march import LEFT_TRACK, march
from turnout.simulate.number_checks import check_number
from turnout.simulate.port_system import locate_ports
from turnout.simulate.ports import contact_ports, fixed_ports, port_arrays
from turnout.simulate.state import Motion, PortArrays, RunArrays, stand_in_of
from turnout.simulate.statics import equilibrium, motion_at_rest
from turnout.simulate.wheel_path import PathPart, Surfaces, spline_pieces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.between_nodes import RailLoads
    from turnout.simulate.preparation import Prepared
    from turnout.simulate.vehicle import Vehicle

MAX_STEPS = 1e8  # 80 minutes at 20 kHz; a signal needs 0.8 GB
CLUSTER_CUT = 0.9  # ports closer than this [m] share one Newton system, the others couple by iteration


@dataclass(frozen=True)
class Probe:
    """A signal to record: ``place`` is the rail at x [m] or a named degree of freedom.

    ``order`` is 2 for acceleration, 1 for velocity, 0 for displacement.
    """

    place: float | tuple
    order: int = 2


@dataclass(frozen=True)
class Outcome:
    """Result of a run: ``time`` (n_step,) mid-step [s] and ``signals`` (n_probe, n_step).

    ``force`` (n_wheel, n_step) is the mean over the step [N] of each wheel, front wheel first; ``surface_force`` is
    (n_wheel, n_surface, n_step). ``port_force`` is that of the ports of terms, ``iterations`` those of Newton per step,
    ``motion`` the state at the end.
    """

    time: np.ndarray
    signals: np.ndarray
    force: np.ndarray
    surface_force: np.ndarray
    port_force: np.ndarray
    iterations: float
    motion: Motion


@dataclass(frozen=True)
class Drive:
    """How a vehicle moves: front wheel at ``start`` [m] at time 0, ``speed`` [m/s], ``direction`` +1 or -1.

    ``surfaces``: the parts of the path on each rail surface that a wheel can touch. ``entry`` [m] is the length over
    which wheels change from their stand-in tracks to the modelled track, 0: all wheels stay on the modelled track.
    ``free_fall`` = (clearance [m], velocity [m/s]) starts a body above the rail instead of in equilibrium.
    """

    start: float
    speed: float
    direction: int = 1
    surfaces: Surfaces = ((),)
    entry: float = 6.0
    margin: float = 3.0
    path_step: float = 0.005
    free_fall: tuple[float, float] | None = None


STANDING = Drive(0.0, 0.0)  # where there is no vehicle


def run(
    prepared: Prepared,
    duration: float,
    probes: Sequence[Probe] = (),
    vehicle: Vehicle | None = None,
    drive: Drive | None = None,
    pulses: Sequence[tuple[float | tuple, Pulse]] = (),
    forces: bool = True,
    tolerance: float = 1e-6,
    marcher: Callable[..., tuple[int, int, int, float, int]] = march,
) -> Outcome:
    """March for ``duration`` [s].

    Parameters
    ----------
    prepared : Prepared
        The track.
    duration : float
        Duration of the march. [s]
    probes : sequence of Probe
        Signals to record.
    vehicle, drive : Vehicle, Drive or None
        The vehicle on the track and its motion.
    pulses : sequence of (point, callable)
        Given forces [N] as functions of time [s], down positive.
    forces : bool
        Whether the forces of ports are returned; without them, and without probes between nodes, none are stored.
    tolerance : float
        Largest residual of a port force in Newton's iteration. [N]
    marcher : callable
        ``march`` (compiled) or the reference implementation in numpy.

    Returns
    -------
    Outcome

    Raises
    ------
    SimulationError
        Where a wheel leaves the track or Newton's iteration fails, with time, position and value.
    """
    check_number("duration", duration, "s", above=0.5 * prepared.dt)
    n_step = round(duration / prepared.dt)
    check_number("number of time steps", n_step, below=MAX_STEPS)
    if vehicle and drive is None:
        raise SimulationError("a vehicle needs a drive: where it starts, and how fast it is.")
    drive = drive or STANDING
    contacts = contact_ports(vehicle, drive.surfaces, drive.start, drive.direction) if vehicle else []
    fixed = fixed_ports(prepared)
    paths, path_of, path_start = (
        _wheel_paths(prepared, vehicle, drive, n_step) if vehicle else (np.zeros((1, 1, 4)), {}, 0.0)
    )
    ports, order = port_arrays(prepared, contacts, fixed, path_of)
    use_stand_in = bool(vehicle) and drive.entry > 0.0
    stand_in = _stand_in(prepared, drive) if use_stand_in else (1.0, 0.0, 1.0)
    labels = [f"wheel {wheel}" for _, _, wheel, *_ in contacts] + [f"port {port.label!r}" for port in fixed]
    labels = [labels[k] for k in order]
    arrays = _run_arrays(prepared, drive, use_stand_in, paths, path_start, probes, pulses, n_step, tolerance)
    motion = _initial_motion(prepared, vehicle, drive, ports, labels, arrays, stand_in)
    between_nodes = [
        (k, probe.place, probe.order)
        for k, probe in enumerate(probes)
        if not isinstance(probe.place, tuple) and is_between_nodes(prepared.matrices, probe.place)
    ]
    course = Course(vehicle, stand_in, ports, labels, arrays, pulses, marcher)
    n_force = n_step if forces or between_nodes else 0
    signals, port_forces, iterations = march_to_end(course, prepared, motion, n_step, n_force)
    by_port = np.zeros((len(order), port_forces.shape[1]))
    by_port[order] = port_forces
    time = (np.arange(n_step) + 0.5) * prepared.dt
    shape = (len(vehicle.wheels), len(drive.surfaces)) if vehicle else (0, 1)
    surface = by_port[: len(contacts)].reshape(*shape, port_forces.shape[1])
    force = surface.sum(axis=1)
    on_rail = force - _blade_force(prepared, vehicle, drive, surface, arrays.speed) if between_nodes else force
    for loads in _applied_loads(prepared, vehicle, drive, pulses, arrays, on_rail) if between_nodes else ():
        for k, position, derivative in between_nodes:
            deflection = element_deflection(prepared.matrices, position, loads)
            signals[k] += step_mean(deflection, derivative, prepared.dt, loads.from_rest)
    return Outcome(time, signals, force, surface, by_port[len(contacts) :], iterations / n_step, motion)


def _stand_in(prepared: Prepared, drive: Drive) -> tuple[float, float, float]:
    """Stand-in of the track at the end where the train enters."""
    inward, cache = drive.margin + drive.entry, prepared.stand_ins
    first, last = float(prepared.matrices.node[0]), float(prepared.matrices.node[-1])
    position = first + inward if drive.direction > 0 else last - inward
    if position not in cache:
        cache[position] = stand_in_of(prepared, position)
    return cache[position]


def _wheel_paths(
    prepared: Prepared, vehicle: Vehicle, drive: Drive, n_step: int
) -> tuple[np.ndarray, dict[tuple[int, int], int], float]:
    """Cubic pieces of every distinct path, and the path of each wheel on each surface."""
    distance = drive.speed * n_step * prepared.dt
    length = float(vehicle.wheel_positions[-1])
    ends = (drive.start - drive.direction * length, drive.start + drive.direction * distance)
    low, high = min(ends) - 0.1, max(ends) + 0.1
    rolls = drive.free_fall is None  # the paths of wheels do not apply to a hammer
    term_parts = (
        [path_part for term in prepared.terms for path_part in term.paths(prepared.track, vehicle)] if rolls else []
    )
    pieces: list[np.ndarray] = []
    piece_index: dict[tuple, int] = {}
    path_of: dict[tuple, int] = {}
    for wheel in range(len(vehicle.wheels)):
        for surface, surface_parts in enumerate(drive.surfaces):
            wheel_parts = [
                p
                for p in (*surface_parts, *_on_surface(term_parts, surface_parts))
                if getattr(p, "wheel", None) in (None, wheel)
            ]
            wheel_specific = any(
                getattr(p, "wheel", None) is not None or getattr(p, "per_wheel", False) for p in wheel_parts
            )
            key = (surface, wheel if wheel_specific else None)
            if key not in piece_index:
                piece_index[key] = len(pieces)
                pieces.append(spline_pieces(wheel_parts, wheel, low, high, drive.path_step))
            path_of[wheel, surface] = piece_index[key]
    return np.array(pieces), path_of, low


def _on_surface(of_terms: Sequence[PathPart], surface: Sequence[PathPart]) -> list[PathPart]:
    """Components of terms that lie on a surface: those of the blade on no other, all others on every surface."""
    return [component for component in of_terms if is_on_blade(surface) or not is_on_blade([component])]


def _run_arrays(
    prepared: Prepared,
    drive: Drive,
    use_stand_in: bool,
    paths: np.ndarray,
    path_start: float,
    probes: Sequence[Probe],
    pulses: Sequence[tuple[float | tuple, Pulse]],
    n_step: int,
    tolerance: float,
) -> RunArrays:
    matrices = prepared.matrices
    rows, weights = np.zeros((len(probes), 4), dtype=np.int64), np.zeros((len(probes), 4))
    for k, probe in enumerate(probes):
        r, w = matrices.weights(probe.place)
        rows[k, : r.size], weights[k, : r.size] = r, w
    pulse_rows, pulse_weights = np.zeros((len(pulses), 4), dtype=np.int64), np.zeros((len(pulses), 4))
    for k, (point, _) in enumerate(pulses):
        r, w = matrices.weights(point)
        pulse_rows[k, : r.size], pulse_weights[k, : r.size] = r, w
    ramp = np.zeros(4)
    if use_stand_in:
        first, last = matrices.node[0] + drive.margin, matrices.node[-1] - drive.margin
        ramp = np.array([first, first + drive.entry, last - drive.entry, last])
    return RunArrays(
        float(drive.direction * drive.speed),
        ramp,
        use_stand_in,
        float(path_start),
        float(drive.path_step),
        paths,
        pulse_rows,
        pulse_weights,
        pulse_forces(pulses, prepared, n_step),
        rows,
        weights,
        np.array([probe.order for probe in probes], dtype=np.int64),
        float(tolerance),
        CLUSTER_CUT,
    )


def _blade_force(
    prepared: Prepared, vehicle: Vehicle | None, drive: Drive, surface_force: np.ndarray, speed: float
) -> np.ndarray:
    """(n_wheel, n_step) forces [N] of wheels on the blade, from ``surface_force`` (n_wheel, n_surface, n_step)."""
    total = np.zeros((surface_force.shape[0], surface_force.shape[2]))
    if vehicle is None or not prepared.matrices.blade_rails:
        return total
    time = (np.arange(total.shape[1]) + 0.5) * prepared.dt
    position = drive.start - drive.direction * np.asarray(vehicle.wheel_positions)[:, None] + speed * time
    on_blade = prepared.matrices.is_on_blade(position)
    for surface, components in enumerate(drive.surfaces):
        if is_on_blade(components):
            total += on_blade * surface_force[:, surface]
    return total


def _applied_loads(
    prepared: Prepared,
    vehicle: Vehicle | None,
    drive: Drive,
    pulses: Sequence[tuple[float | tuple, Pulse]],
    arrays: RunArrays,
    force: np.ndarray,
) -> list[RailLoads]:
    """Loads on the rail itself: wheels, and pulses that do not act on a named degree of freedom."""
    loads = []
    if vehicle is not None:
        position = drive.start - drive.direction * np.asarray(vehicle.wheel_positions)
        ramp = arrays.ramp if arrays.stand_in else None
        loads.append(rail_loads(position, arrays.speed, force, prepared.dt, drive.free_fall is not None, ramp))
    on_rail = {k: float(point) for k, (point, _) in enumerate(pulses) if not isinstance(point, tuple)}
    if on_rail:
        position = np.array([*on_rail.values()])
        pulse_force = arrays.pulse_force[[*on_rail]] @ prepared.scheme.quadrature
        loads.append(rail_loads(position, 0.0, pulse_force, prepared.dt, True))
    return loads


def _initial_motion(
    prepared: Prepared,
    vehicle: Vehicle | None,
    drive: Drive,
    ports: PortArrays,
    labels: Sequence[str],
    arrays: RunArrays,
    stand_in: tuple[float, float, float],
) -> Motion:
    if vehicle is None:
        return motion_at_rest(prepared, ports)
    if drive.free_fall is not None:
        motion = motion_at_rest(prepared, ports, vehicle)
        clearance, velocity = drive.free_fall
        motion.z[:], motion.w[:] = -clearance, velocity
        motion.deformation[ports.wheel >= 0] = -clearance
        return motion
    return equilibrium(prepared, vehicle, ports, _initial_ports(prepared, ports, labels, arrays), stand_in[2])


def _initial_ports(
    prepared: Prepared, ports: PortArrays, labels: Sequence[str], arrays: RunArrays
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, weights, local compliance, stand-in share and dip of every port at time 0."""
    n = ports.body.size
    x, local, share, dip = (np.zeros(n) for _ in range(4))
    rows, weights = np.zeros((n, 4), dtype=np.int64), np.zeros((n, 4))
    start = prepared.scheme._replace(node=np.zeros(1))
    lost_port = locate_ports(
        prepared.arrays, start, ports, arrays, 0, np.zeros(n, dtype=np.int64), x, rows, weights, local, share, dip
    )
    if lost_port >= 0:
        raise_failure(prepared, ports, labels, LEFT_TRACK, 0.0, lost_port, x[lost_port])
    return rows, weights, local, share, dip
