"""Simulate a given world under hammer impacts or under a train: rail accelerations at the rate of the time step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.grid import interpolation_weights, lost_compliance
from turnout_blind.march import TIME_STEP, march
from turnout_blind.march_inputs import Hammer, WheelMotion
from turnout_blind.vehicle import cars_of, no_train, wheels_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike

    from turnout_blind.true_site import World
    from turnout_blind.vehicle import Train

PATH_STEP = 5e-3
ENGAGE_LENGTH = 4.0  # length over which a wheel engages the rail gradually [m]
GRID_MARGIN = 1.0  # smallest distance of a wheel in contact from the ends of the grid [m]
NO_HAMMER = Hammer(1, np.zeros(4), 0.0, 0.0, 0.0, np.zeros(0), np.zeros(0))
NO_MOTION = WheelMotion(0.0, 0.0, 0.0, 1.0, 2.0, 3.0)


def accelerations(velocity: np.ndarray, dt: float) -> np.ndarray:
    """Accelerations from velocities half a step after each whole step.

    Parameters
    ----------
    velocity : (n, n_sensor) array of float
        Velocities. [m/s]
    dt : float
        Time step. [s]

    Returns
    -------
    (n_sensor, n) array of float
        Accelerations; sample k is at k dt. [m/s²]
    """
    return np.diff(velocity, axis=0, prepend=0.0).T / dt


def simulate_impacts(
    world: World,
    sensor_positions: ArrayLike,
    hammer_position: float,
    times: ArrayLike,
    velocities: ArrayLike,
    duration: float,
    temperature: float | None = None,
    mass: float = 5.5,
    tip: float = 1.5e9,
    loss: float = 0.1,
    dt: float = TIME_STEP,
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """Hammer impacts at one position.

    Parameters
    ----------
    world : World
        True state of the site.
    sensor_positions : (n_sensor,) array of float
        True positions of the sensors. [m]
    hammer_position : float
        Position of the impacts. [m]
    times : (n_impact,) array of float
        Time of each impact; a second one is a double impact. [s]
    velocities : (n_impact,) array of float
        Speed of the hammer at each. [m/s]
    duration : float
        Duration of the march. [s]
    temperature : float or None
        Rail temperature [°C]; None: the reference.
    mass : float
        Mass of the hammer. [kg]
    tip : float
        Constant k of the tip force k d^1.5 (1 + loss d'). [N/m^1.5]
    loss : float
        Constant loss of the tip force. [s/m]
    dt : float
        Time step. [s]

    Returns
    -------
    ((n,) array, (n_sensor, n) array, tuple of arrays)
        Force [N], accelerations [m/s²], last state.
    """
    first, weights = interpolation_weights(world.grid, hammer_position)
    hammer = Hammer(int(first[0]), weights[0], mass, tip, loss, np.asarray(times, float), np.asarray(velocities, float))
    cars, wheels = no_train()
    sensors = interpolation_weights(world.grid, sensor_positions)
    velocity, force, _, state = march(
        round(duration / dt), dt, world.grid.start, world.beam(), world.supports(temperature),
        world.attached_mass_inputs(), cars, wheels, NO_MOTION, hammer, *sensors, 1, world.blade_inputs(),
    )  # fmt: skip
    return force, accelerations(velocity, dt), state


def wheel_paths(
    world: World, train: Train, roughness: Callable[[int, np.ndarray], np.ndarray] | None, phase: float
) -> np.ndarray:
    """Dips that each wheel meets along the grid, from the start of the grid.

    Parameters
    ----------
    world : World
        True state of the site.
    train : Train
        The train.
    roughness : callable or None
        Wheel and positions [m] -> dips [m].
    phase : float
        Rotation of all wheels at the start. [rad]

    Returns
    -------
    (n_wheel, m) array of float
        Dips, in steps of ``PATH_STEP``. [m]
    """
    x = np.arange(world.grid.start, world.grid.end, PATH_STEP)
    rail_dips = sum((dip(x) for dip in world.surface), np.zeros(x.size))
    dips = np.tile(rail_dips, (train.axles().size, 1))
    for i in range(dips.shape[0]):
        if roughness is not None:
            dips[i] += roughness(i, x)
        for tread in world.treads.get((train.name, i + 1), ()):
            dips[i] += tread(x, phase, train.radius)
    return dips


def simulate_passage(
    world: World,
    train: Train,
    speed: float,
    sensor_positions: Sequence[float],
    duration: float,
    lead: float,
    temperature: float | None = None,
    roughness: Callable[[int, np.ndarray], np.ndarray] | None = None,
    phase: float = 0.0,
    n_passages: float = 0.0,
    dt: float = TIME_STEP,
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """A passage of a train.

    Parameters
    ----------
    world : World
        True state of the site.
    train : Train
        The train.
    speed : float
        Speed of the train. [m/s]
    sensor_positions : sequence of float
        True positions of the sensors. [m]
    duration : float
        Duration of the march. [s]
    lead : float
        Time until the first wheel reaches the first sensor. [s]
    temperature : float or None
        Rail temperature [°C]; None: the reference.
    roughness : callable or None
        Wheel and positions [m] -> dips [m].
    phase : float
        Rotation of all wheels at the start. [rad]
    n_passages : float
        Passages before this one, which have worn the supports.
    dt : float
        Time step. [s]

    Returns
    -------
    ((n_sensor, n) array, (n_wheel, m) array, tuple of arrays)
        Accelerations [m/s²], wheel forces [N], last state.
    """
    local_compliance = lost_compliance(world.grid, world.rail)
    path = wheel_paths(world, train, roughness, phase)
    blade_path = None
    if world.blade is not None:
        x = np.arange(world.grid.start, world.grid.end, PATH_STEP)
        on_stock, on_blade = world.blade.paths(x, train)
        path, blade_path = path + on_stock, path + on_blade
    factor = world.wheel_mass.get(train.name, 1.0)
    wheels = wheels_of(train, path, world.grid.start, PATH_STEP, local_compliance, factor, blade_path)
    low, high = world.grid.start + GRID_MARGIN, world.grid.end - GRID_MARGIN
    motion = WheelMotion(
        min(sensor_positions) - speed * lead, speed, low, low + ENGAGE_LENGTH, high - ENGAGE_LENGTH, high
    )
    sensors = interpolation_weights(world.grid, sensor_positions)
    velocity, _, force, state = march(
        round(duration / dt), dt, world.grid.start, world.beam(), world.supports(temperature, n_passages),
        world.attached_mass_inputs(), cars_of(train), wheels, motion, NO_HAMMER, *sensors, 60, world.blade_inputs(),
    )  # fmt: skip
    return accelerations(velocity, dt), force.T, state
