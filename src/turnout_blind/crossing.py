"""A crossing panel: bearers, the crossing casting, and the nose, which every wheel meets slightly differently.

Fixed crossings weigh two to three times the rail and are stiffer. Wheels pass from the wing rail to the nose over dips
of 0.5 to 2 mm (Palsson and Nielsen 2012, Vehicle System Dynamics 50; Andersson and Dahlberg 1998, Proc. IMechE F 212).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from turnout_blind.true_site import World
    from turnout_blind.vehicle import Train

CASTING_LENGTH, LENGTH_BEFORE_NOSE = 3.4, 1.5  # length of the casting, and of its part before the nose [m]
RAMP_LENGTH = 0.6  # length over which the rail section grows into that of the casting [m]
NOSE_ROUNDING = 0.015  # half of the length over which wear has rounded the nose [m]


@dataclass(frozen=True)
class Crossing:
    """Casting and nose. ``bending`` and ``mass`` of the casting are factors on the values of the rail.

    The surface at the ``nose`` [m] lies ``depth`` [m] low over a ``length`` [m], of which ``share`` lies before it.
    """

    nose: float
    bending: float
    mass: float
    depth: float
    length: float
    share: float

    @property
    def ends(self) -> tuple[float, float]:
        """Positions of the two ends of the casting, at half height of its ramps [m]."""
        return self.nose - LENGTH_BEFORE_NOSE, self.nose - LENGTH_BEFORE_NOSE + CASTING_LENGTH

    def dip(self, x: ArrayLike) -> np.ndarray:
        """Dip of the surface: wing and nose fall increasingly steeply to a rounded lowest point.

        Parameters
        ----------
        x : (n,) array of float
            Positions. [m]

        Returns
        -------
        (n,) array of float
            Dip, down positive. [m]
        """
        distance = np.asarray(x) - self.nose
        reach = np.where(distance < 0.0, self.share * self.length, (1.0 - self.share) * self.length)
        rounded = np.sqrt(distance**2 + NOSE_ROUNDING**2) - NOSE_ROUNDING
        return self.depth * np.clip(1.0 - rounded / reach, 0.0, None) ** 1.5

    def profile(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bending stiffness and mass as factors on the values of the rail.

        Parameters
        ----------
        x : (n,) array of float
            Positions. [m]

        Returns
        -------
        two (n,) arrays of float
            Factors of bending stiffness and mass. [-]
        """
        start, end = self.ends
        casting_share = np.clip(np.minimum(x - start, end - x) / RAMP_LENGTH + 0.5, 0.0, 1.0)
        return 1.0 + (self.bending - 1.0) * casting_share, 1.0 + (self.mass - 1.0) * casting_share


def draw_bearer_mass_ratio(rng: np.random.Generator) -> tuple[float, float]:
    """Half the mass of a bearer over half that of a sleeper.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.

    Returns
    -------
    (float, float)
        Nominal and true ratio.
    """
    nominal = float(rng.uniform(1.15, 1.5))
    return nominal, nominal * float(np.exp(0.03 * rng.normal()))


def draw_crossing(rng: np.random.Generator, boundary: float) -> tuple[Crossing, Crossing]:
    """Crossing with its nose 1 to 2.5 m behind the boundary.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    boundary : float
        Position where the bearers begin. [m]

    Returns
    -------
    (Crossing, Crossing)
        True and nominal crossing.
    """
    true = Crossing(
        boundary + float(rng.uniform(1.0, 2.5)), float(rng.uniform(1.4, 2.2)), float(rng.uniform(1.8, 2.8)),
        float(rng.uniform(4e-4, 1.6e-3)), float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.4, 0.6)),
    )  # fmt: skip

    def perturb(value: float, spread: float) -> float:
        return value * float(np.exp(spread * rng.normal()))

    nominal = Crossing(
        true.nose + 0.05 * float(rng.normal()), perturb(true.bending, 0.05), perturb(true.mass, 0.03),
        perturb(true.depth, 0.3), perturb(true.length, 0.15), 0.5,
    )  # fmt: skip
    return true, nominal


def add_crossing(rng: np.random.Generator, world: World, crossing: Crossing, trains: Mapping[str, Train]) -> None:
    """Add the crossing to the world: casting and nose.

    Each wheel meets the nose differently: sd of a tenth of its depth, and 2 cm of its position.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    world : World
        World that is changed.
    crossing : Crossing
        True crossing.
    trains : mapping
        Trains by name.
    """
    world.profile = crossing.profile(world.grid.start + world.grid.step * np.arange(world.grid.n))
    world.surface.append(crossing.dip)
    for train in trains.values():
        for axle in range(1, train.axles().size + 1):
            depth, nose = crossing.depth * (1.0 + 0.1 * rng.normal()), crossing.nose + 0.02 * rng.normal()
            wheel_crossing = replace(crossing, depth=float(depth), nose=float(nose))
            world.treads.setdefault((train.name, axle), []).append(
                lambda x, phase, radius, wheel_crossing=wheel_crossing: wheel_crossing.dip(x) - crossing.dip(x)
            )
