"""Simulate a given world under hammer impacts or under a train: rail accelerations at the rate of the time step."""

import numpy as np

from turnout_blind.grid import interpolation_weights, lost_compliance
from turnout_blind.march import TIME_STEP, march
from turnout_blind.march_inputs import Hammer, WheelMotion
from turnout_blind.vehicle import cars_of, no_train, wheels_of

PATH_STEP = 5e-3
ENGAGE_LENGTH = 4.0  # length over which a wheel engages the rail gradually [m]
GRID_MARGIN = 1.0  # smallest distance of a wheel in contact from the ends of the grid [m]
NO_HAMMER = Hammer(1, np.zeros(4), 0.0, 0.0, 0.0, np.zeros(0), np.zeros(0))
NO_MOTION = WheelMotion(0.0, 0.0, 0.0, 1.0, 2.0, 3.0)


def accelerations(velocity, dt):
    """(n_sensor, n) accelerations [m/s²] from velocities half a step after each whole step; sample k is at k dt."""
    return np.diff(velocity, axis=0, prepend=0.0).T / dt


def simulate_impacts(
    world,
    sensor_positions,
    hammer_position,
    times,
    velocities,
    duration,
    temperature=None,
    mass=5.5,
    tip=1.5e9,
    loss=0.1,
    dt=TIME_STEP,
):
    """(force (n,) [N], accelerations (n_sensor, n) [m/s²], last state) of hammer impacts at ``hammer_position`` [m].

    ``tip`` and ``loss`` are the constants of k d^1.5 (1 + loss d') [N/m^1.5, s/m]. A second time is a double hit.
    """
    first, weights = interpolation_weights(world.grid, hammer_position)
    hammer = Hammer(int(first[0]), weights[0], mass, tip, loss, np.asarray(times, float), np.asarray(velocities, float))
    cars, wheels = no_train()
    sensors = interpolation_weights(world.grid, sensor_positions)
    velocity, force, _, state = march(
        round(duration / dt), dt, world.grid.start, world.beam(), world.supports(temperature),
        world.attached_mass_inputs(), cars, wheels, NO_MOTION, hammer, *sensors, 1,
    )  # fmt: skip
    return force, accelerations(velocity, dt), state


def wheel_paths(world, train, roughness, phase):
    """(n_wheel, m) dips that each wheel meets along the grid [m], from the start of the grid."""
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
    world,
    train,
    speed,
    sensor_positions,
    duration,
    lead,
    temperature=None,
    roughness=None,
    phase=0.0,
    n_passages=0.0,
    dt=TIME_STEP,
):
    """(accelerations (n_sensor, n) [m/s²], wheel forces (n_wheel, m) [N], last state) of a passage.

    The first wheel reaches the first of ``sensor_positions`` [m] after ``lead`` [s]. ``roughness`` is a function
    (wheel, positions) -> dips. ``phase`` [rad] is the rotation of all wheels at the start. ``n_passages`` before this
    one have worn the supports.
    """
    local_compliance = lost_compliance(world.grid, world.rail)
    path = wheel_paths(world, train, roughness, phase)
    wheels = wheels_of(
        train, path, world.grid.start, PATH_STEP, local_compliance, world.wheel_mass.get(train.name, 1.0)
    )
    low, high = world.grid.start + GRID_MARGIN, world.grid.end - GRID_MARGIN
    motion = WheelMotion(
        min(sensor_positions) - speed * lead, speed, low, low + ENGAGE_LENGTH, high - ENGAGE_LENGTH, high
    )
    sensors = interpolation_weights(world.grid, sensor_positions)
    velocity, _, force, state = march(
        round(duration / dt), dt, world.grid.start, world.beam(), world.supports(temperature, n_passages),
        world.attached_mass_inputs(), cars_of(train), wheels, motion, NO_HAMMER, *sensors, 60,
    )  # fmt: skip
    return accelerations(velocity, dt), force.T, state
