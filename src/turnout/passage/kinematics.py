"""Describe the motion of a train past the sensors: constant acceleration, in either direction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Motion:
    r"""Position of the first axle: :math:`u(t) = v (t - t_0) + \tfrac12 a (t - t_0)^2` from the turnout's origin.

    ``speed`` [m/s] above 0 and ``acceleration`` [m/s²] at ``start`` [s], when the first axle passes the origin;
    ``direction`` is +1 where the train runs towards larger positions (facing: from the switch to the crossing),
    -1 against them. An axle ``d`` metres behind the first passes the position ``x`` when u = d + direction * x.
    """

    speed: float
    start: float = 0.0
    acceleration: float = 0.0
    direction: int = 1

    def time(self, distance) -> np.ndarray:
        """Time at which the first axle is ``distance`` [m] past the origin; negative ``distance`` before it. [s]

        >>> float(Motion(10.0, 1.0, 2.0).time(24.0))
        3.0
        """
        distance = np.asarray(distance, dtype=float)
        speed_squared = np.maximum(self.speed**2 + 2.0 * self.acceleration * distance, 1e-6)
        # rationalised root: no cancellation as the acceleration goes to 0
        return self.start + 2.0 * distance / (self.speed + np.sqrt(speed_squared))

    def distance(self, time) -> np.ndarray:
        """Distance that the first axle has travelled from the origin at ``time``: the inverse of ``time()``. [m]"""
        elapsed = np.asarray(time, dtype=float) - self.start
        return self.speed * elapsed + 0.5 * self.acceleration * elapsed**2

    def passing(self, offsets, position: float) -> np.ndarray:
        """Times at which axles ``offsets`` [m] behind the first pass ``position`` [m]. [s]"""
        return self.time(np.asarray(offsets, dtype=float) + self.direction * position)

    def speed_at(self, time) -> np.ndarray:
        """Speed at ``time`` [s]. [m/s]"""
        return self.speed + self.acceleration * (np.asarray(time) - self.start)

    def relative_to_axle(self, distance: float) -> Motion:
        """The same motion relative to an axle ``distance`` metres behind the first."""
        start = float(self.time(distance))
        return replace(self, speed=float(self.speed_at(start)), start=start)
