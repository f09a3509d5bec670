"""Choose the speed at which a recorded train is simulated: that of the recording, or that of its axle distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import KMH, Z95

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.result import Passage, PassageSensor
    from turnout.simulate.vehicle import Vehicle


@dataclass(frozen=True)
class SimulatedSpeed:
    """``speed`` and its ``se`` [m/s] while the train passes the sensors, and whether the vehicle's axles gave it.

    ``recorded`` and ``recorded_se`` [m/s] are those of the recording, ``recorded_se`` is None where it has no error.
    """

    speed: float
    se: float | None
    is_from_axles: bool
    recorded: float
    recorded_se: float | None

    @property
    def note(self) -> str:
        """Which speed is simulated, and why."""
        recorded = speed_text(self.recorded, self.recorded_se)
        if not self.is_from_axles:
            return f"speed {recorded} from the recording: the axle distances of the vehicle file give it less exactly"
        return (
            f"speed {speed_text(self.speed, self.se)} from the axle distances of the vehicle file; recorded {recorded}"
        )


def speed_text(speed: float, se: float | None) -> str:
    """A speed with its 95 % error, where it has one.

    Parameters
    ----------
    speed : float
        Speed. [m/s]
    se : float or None
        Standard error. [m/s]

    Returns
    -------
    str
        In km/h.

    Examples
    --------
    >>> speed_text(40.0, 0.1), speed_text(40.0, None)
    ('144.0 ± 0.7 km/h (95 %)', '144.0 km/h')
    """
    return f"{KMH * speed:.1f} km/h" if se is None else f"{KMH * speed:.1f} ± {KMH * Z95 * se:.1f} km/h (95 %)"


def speed_at_sensors(passage: Passage, sensors: Sequence[str]) -> float:
    """Mean speed of the train while its axles pass the ``sensors``, by least squares. [m/s]

    The motion has the speed of the first axle at position 0. A train that brakes is slower later.

    Parameters
    ----------
    passage : Passage
        The train.
    sensors : sequence of str
        Names of channels that recorded it.

    Returns
    -------
    float
        That of the motion for a single axle.
    """
    x = passage.offsets - np.mean(passage.offsets)
    times = [passage.at_sensor[name] - np.mean(passage.at_sensor[name]) for name in sensors]
    if len(x) < 2 or not times:
        return passage.train_motion.speed
    return float(np.mean([(x @ x) / (t @ x) for t in times]))


def simulated_speed(
    passage: Passage, vehicle: Vehicle, speed: float, recorded: float, place_error: float
) -> SimulatedSpeed:
    """The more exact one of both speeds.

    A recorded speed that rests on axle distances alone has those of a template. The simulation has the vehicle's.

    Parameters
    ----------
    passage : Passage
        The train.
    vehicle : Vehicle
        With its axles in the order of the recorded ones.
    speed : float
        Speed that its axle distances give. [m/s]
    recorded : float
        Recorded speed at the sensors. [m/s]
    place_error : float
        Least standard deviation of a recorded axle. [m]

    Returns
    -------
    SimulatedSpeed
        The recorded speed for fewer than three axles: their scatter is not known.
    """
    x = np.asarray(vehicle.wheel_positions) - np.mean(vehicle.wheel_positions)
    recorded_se = None if passage.speed is None else passage.speed.se
    if len(x) < 3:
        return SimulatedSpeed(recorded, recorded_se, False, recorded, recorded_se)
    residual = (passage.offsets - np.mean(passage.offsets)) * speed / recorded - x
    scatter = max(float(np.sqrt(residual @ residual / (len(x) - 2))), place_error)
    se = speed * scatter / float(np.sqrt(x @ x))
    is_of_template = passage.speed is not None and passage.speed.source == "axle spacing"
    if recorded_se is None or is_of_template or se < recorded_se:
        return SimulatedSpeed(speed, se, True, recorded, recorded_se)
    return SimulatedSpeed(recorded, recorded_se, False, recorded, recorded_se)


def recorded_times(
    time: np.ndarray, simulated_axles: np.ndarray, passage: Passage, sensor: PassageSensor, speed: float
) -> np.ndarray:
    """When the recorded train was where the simulated one, at a steady speed, is at ``time``.

    Parameters
    ----------
    time : (n,) array of float
        Times of the simulation. [s]
    simulated_axles : (n_axle,) array of float
        When its axles pass the sensor. [s]
    passage : Passage
        The recorded train, which may brake.
    sensor : PassageSensor
        A sensor that recorded it.
    speed : float
        Recorded speed at the sensors, which belongs to the recorded axle distances. [m/s]

    Returns
    -------
    (n,) array of float
        Times of the recording: the mean time of the axles is the recorded one. [s]
    """
    motion = passage.train_motion
    at, axles = (motion.passing(speed * (t - simulated_axles[0]), sensor.position) for t in (time, simulated_axles))
    return at + np.mean(passage.at_sensor[sensor.name]) - np.mean(axles)
