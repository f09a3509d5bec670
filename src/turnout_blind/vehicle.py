"""Trains of cars with a body on two bogies of two wheelsets; simulated is the half on one rail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.march_inputs import Cars, Wheels

if TYPE_CHECKING:
    from collections.abc import Callable

GRAVITY = 9.81


@dataclass(frozen=True)
class Car:
    """A whole car, both rails: masses [kg], inertias [kg m²], suspension per axle and per bogie, lengths [m]."""

    body: float
    body_inertia: float
    bogie: float
    bogie_inertia: float
    wheelset: float
    primary: float
    primary_damping: float
    secondary: float
    secondary_damping: float
    base: float
    pivots: float
    length: float

    @property
    def axle_load(self) -> float:
        """Static load of an axle [N]."""
        return GRAVITY * (0.25 * self.body + 0.5 * self.bogie + self.wheelset)


@dataclass(frozen=True)
class Train:
    """``name`` of the vehicle file, ``cars`` from the front, wheel ``radius`` [m] and Hertz constant ``contact``."""

    name: str
    cars: tuple[Car, ...]
    radius: float = 0.46
    contact: float = 9.3e10

    def axles(self) -> np.ndarray:
        """Distances of the axles from the front end [m]."""
        positions, front = [], 0.0
        for car in self.cars:
            for pivot in (-0.5, 0.5):
                centre = front + 0.5 * car.length + pivot * car.pivots
                positions += [centre - 0.5 * car.base, centre + 0.5 * car.base]
            front += car.length
        return np.array(positions)

    @property
    def axle_load(self) -> float:
        """Mean static load of an axle [N]."""
        return float(np.mean([c.axle_load for c in self.cars]))


def cars_of(train: Train) -> Cars:
    """Inputs of the march: half of every car.

    Parameters
    ----------
    train : Train
        The train.

    Returns
    -------
    Cars
        Values of each car.
    """

    def per_car(quantity: Callable[[Car], float]) -> np.ndarray:
        return np.array([float(quantity(c)) for c in train.cars])

    return Cars(
        per_car(lambda c: 0.5 * c.body), per_car(lambda c: 0.5 * c.body_inertia), per_car(lambda c: 0.5 * c.bogie),
        per_car(lambda c: 0.5 * c.bogie_inertia), per_car(lambda c: 0.5 * c.primary),
        per_car(lambda c: 0.5 * c.primary_damping), per_car(lambda c: 0.5 * c.secondary),
        per_car(lambda c: 0.5 * c.secondary_damping), per_car(lambda c: 0.5 * c.base),
        per_car(lambda c: 0.5 * c.pivots),
    )  # fmt: skip


def wheels_of(
    train: Train,
    path: np.ndarray,
    path_start: float,
    path_step: float,
    local: float,
    factor: float = 1.0,
    blade_path: np.ndarray | None = None,
) -> Wheels:
    """Inputs of the march: wheels with their paths.

    Parameters
    ----------
    train : Train
        The train.
    path : (n_wheel, m) array of float
        Dips that each wheel meets. [m]
    path_start : float
        Position of the first dip. [m]
    path_step : float
        Distance of two dips. [m]
    local : float
        Compliance of the rail that the grid lacks. [m/N]
    factor : float
        Factor on the unsprung mass.
    blade_path : (n_wheel, m) array of float or None
        Dips on a second rail. [m]

    Returns
    -------
    Wheels
        Values of each wheel.
    """
    mass = np.repeat([0.5 * factor * c.wheelset for c in train.cars], 4)
    sprung = np.repeat([0.125 * c.body + 0.25 * c.bogie for c in train.cars], 4)
    axles = train.axles()
    contact = np.full(mass.size, train.contact)
    second = np.zeros((0, 8)) if blade_path is None else blade_path
    load = GRAVITY * (mass + sprung)
    return Wheels(mass, load, axles - axles[0], contact, local, path, path_start, path_step, second)


def no_train() -> tuple[Cars, Wheels]:
    """Inputs of the march without a train."""
    none = np.zeros(0)
    return Cars(*([none] * 10)), Wheels(none, none, none, none, 0.0, np.zeros((0, 8)), 0.0, 1.0, np.zeros((0, 8)))


RAILCAR = Car(33e3, 1.2e6, 4400.0, 3800.0, 1500.0, 2.3e6, 20e3, 0.95e6, 48e3, 2.7, 16.6, 23.6)
LOCOMOTIVE = Car(52e3, 1.15e6, 8600.0, 12e3, 3700.0, 4.6e6, 60e3, 2.6e6, 120e3, 3.0, 9.5, 19.0)
LOADED_WAGON = Car(64e3, 0.9e6, 2000.0, 1500.0, 1300.0, 6.0e6, 90e3, 30e6, 150e3, 1.8, 10.7, 15.74)
