"""Simulate a given world under hammer impacts or under a train: rail accelerations at the rate of the time step."""

import numpy as np

from turnout_blind.grid import lost_compliance, read
from turnout_blind.march import STEP, march
from turnout_blind.march_inputs import Blow, Roll
from turnout_blind.vehicle import cars_of, no_train, wheels_of

PATH_STEP = 5e-3
RAMP = 4.0  # length over which a wheel engages the rail gradually [m]
MARGIN = 1.0  # smallest distance of a wheel in contact from the ends of the grid [m]
STILL = Blow(1, np.zeros(4), 0.0, 0.0, 0.0, np.zeros(0), np.zeros(0))
REST = Roll(0.0, 0.0, 0.0, 1.0, 2.0, 3.0)


def accelerations(velocity, dt):
    """(n_sensor, n) accelerations [m/s²] from velocities half a step after each whole step; sample k is at k dt."""
    return np.diff(velocity, axis=0, prepend=0.0).T / dt


def strike(world, places, at, times, velocities, duration, temperature=None, mass=5.5, tip=1.5e9, loss=0.1, dt=STEP):
    """(force (n,) [N], accelerations (n_sensor, n) [m/s²], last state) of hammer impacts at ``hammer_position`` [m].

    ``tip`` and ``loss`` are the constants of k d^1.5 (1 + loss d') [N/m^1.5, s/m]. A second time is a double hit.
    """
    first, weights = read(world.grid, at)
    blow = Blow(int(first[0]), weights[0], mass, tip, loss, np.asarray(times, float), np.asarray(velocities, float))
    cars, wheels = no_train()
    sensors = read(world.grid, places)
    out, hammer, _, state = march(
        round(duration / dt), dt, world.grid.start, world.beam(), world.supports(temperature),
        world.hung(), cars, wheels, REST, blow, *sensors, 1,
    )  # fmt: skip
    return hammer, accelerations(out, dt), state


def paths(world, train, roughness, phase):
    """(n_wheel, m) dips that each wheel meets along the grid [m], from the start of the grid."""
    x = np.arange(world.grid.start, world.grid.end, PATH_STEP)
    rail = sum((make(x) for make in world.surface), np.zeros(x.size))
    made = np.tile(rail, (train.axles().size, 1))
    for i in range(made.shape[0]):
        if roughness is not None:
            made[i] += roughness(i, x)
        for tread in world.treads.get((train.name, i + 1), ()):
            made[i] += tread(x, phase, train.radius)
    return made


def roll(world, train, speed, places, duration, lead, temperature=None, roughness=None, phase=0.0, grown=0.0, dt=STEP):
    """(accelerations (n_sensor, n) [m/s²], wheel forces (n_wheel, m) [N], last state) of a passage.

    The first wheel reaches the first of ``sensor_positions`` [m] after ``lead`` [s]. ``roughness`` is a function
    (wheel, positions) -> dips. ``phase`` [rad] is the rotation of all wheels at the start. ``n_passages`` before this
    one have worn the supports.
    """
    local = lost_compliance(world.grid, world.rail)
    path = paths(world, train, roughness, phase)
    wheels = wheels_of(train, path, world.grid.start, PATH_STEP, local, world.wheel_mass.get(train.name, 1.0))
    low, high = world.grid.start + MARGIN, world.grid.end - MARGIN
    way = Roll(min(places) - speed * lead, speed, low, low + RAMP, high - RAMP, high)
    sensors = read(world.grid, places)
    out, _, force, state = march(
        round(duration / dt), dt, world.grid.start, world.beam(), world.supports(temperature, grown),
        world.hung(), cars_of(train), wheels, way, STILL, *sensors, 60,
    )  # fmt: skip
    return accelerations(out, dt), force.T, state
