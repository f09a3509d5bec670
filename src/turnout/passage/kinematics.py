"""Describe the motion of a train past the sensors: constant acceleration, in either direction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class Motion:
    r"""Travel of the first axle: :math:`u(t) = v (t - t_0) + \tfrac12 a (t - t_0)^2` from the origin.

    ``speed`` [m/s] above 0 and ``acceleration`` [m/s²] at ``start`` [s], when the first axle passes the ``origin``, a
    position [m]. ``direction`` is +1 where the train runs towards larger positions (facing: from the switch to the
    crossing), -1 against them. An axle ``d`` metres behind the first passes the position ``x`` when
    u = d + direction * (x - origin).
    """

    speed: float
    start: float = 0.0
    acceleration: float = 0.0
    direction: int = 1
    origin: float = 0.0

    def time(self, distance: float | np.ndarray) -> np.ndarray:
        """Time at which the first axle is ``distance`` [m] past the origin; negative ``distance`` before it. [s]

        Parameters
        ----------
        distance : float or (...) array of float
            Distance past the origin. [m]

        Returns
        -------
        (...) array of float
            Of the shape of ``distance``. [s]

        Examples
        --------
        >>> float(Motion(10.0, 1.0, 2.0).time(24.0))
        3.0
        """
        return _time_at(self.speed, self.start, self.acceleration, np.asarray(distance, dtype=float))

    def distance(self, time: float | np.ndarray) -> np.ndarray:
        """Distance that the first axle has travelled from the origin at ``time``: the inverse of ``time()``. [m]

        Parameters
        ----------
        time : float or (...) array of float
            Time after the start of the recording. [s]

        Returns
        -------
        (...) array of float
            Of the shape of ``time``. [m]
        """
        elapsed = np.asarray(time, dtype=float) - self.start
        return self.speed * elapsed + 0.5 * self.acceleration * elapsed**2

    def passing(self, offsets: np.ndarray, position: float) -> np.ndarray:
        """Times at which axles ``offsets`` [m] behind the first pass ``position`` [m]. [s]

        Parameters
        ----------
        offsets : (...) array of float
            Distances of the axles behind the first. [m]
        position : float
            Position along the turnout. [m]

        Returns
        -------
        (...) array of float
            Of the shape of ``offsets``. [s]
        """
        return self.time(np.asarray(offsets, dtype=float) + self.direction * (position - self.origin))

    def speed_at(self, time: float | np.ndarray) -> np.ndarray:
        """Speed at ``time`` [s]. [m/s]

        Parameters
        ----------
        time : float or (...) array of float
            Time after the start of the recording. [s]

        Returns
        -------
        (...) array of float
            Of the shape of ``time``. [m/s]
        """
        return self.speed + self.acceleration * (np.asarray(time) - self.start)

    def relative_to_axle(self, distance: float) -> Motion:
        """The same motion relative to an axle ``distance`` metres behind the first.

        Parameters
        ----------
        distance : float
            Distance of the axle behind the first. [m]

        Returns
        -------
        Motion
            With that axle at the origin at its start.
        """
        start = float(self.time(distance))
        return replace(self, speed=float(self.speed_at(start)), start=start)

    def from_position(self, position: float) -> Motion:
        """The same motion with its origin at another position. [m]

        Parameters
        ----------
        position : float
            New origin, which the first axle passes at the new start. [m]

        Returns
        -------
        Motion
            ``passing`` gives the same times. The origin stays where the first axle never was at ``position``.

        Examples
        --------
        >>> Motion(10.0, 1.0, 2.0).from_position(24.0)
        Motion(speed=14.0, start=3.0, acceleration=2.0, direction=1, origin=24.0)
        >>> Motion(10.0, 1.0, 2.0).from_position(-30.0).origin
        0.0
        """
        distance = self.direction * (position - self.origin)
        if self.speed**2 + 2.0 * self.acceleration * distance <= 0.0:
            return self
        return replace(self.relative_to_axle(distance), origin=position)


def _time_at(
    speed: float | np.ndarray, start: float | np.ndarray, acceleration: float | np.ndarray, distance: np.ndarray
) -> np.ndarray:
    speed_squared = np.maximum(speed**2 + 2.0 * acceleration * distance, 1e-6)
    # rationalised root: no cancellation as the acceleration goes to 0
    return start + 2.0 * distance / (speed + np.sqrt(speed_squared))


def passing_times(motions: Sequence[Motion], offsets: np.ndarray, position: float) -> np.ndarray:
    """``Motion.passing`` of several motions. [s]

    Parameters
    ----------
    motions : sequence of Motion
        Motions, one for each row.
    offsets : (n_motion, n) array of float
        Distances of axles behind the first. [m]
    position : float
        Position along the turnout. [m]

    Returns
    -------
    (n_motion, n) array of float
        Times at which these axles pass the position. [s]
    """
    speed, start, acceleration, direction, origin = (
        np.array([[value] for value in values])
        for values in zip(*((m.speed, m.start, m.acceleration, m.direction, m.origin) for m in motions))
    )
    return _time_at(speed, start, acceleration, offsets + direction * (position - origin))
