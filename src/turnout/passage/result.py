"""Hold the results of one passage: sensors, speed, and the passage itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from turnout.constants import KMH, Z95
from turnout.passage.kinematics import Motion
from turnout.passage.train_type import TypeFinding
from turnout.records import Rejection


@dataclass(frozen=True)
class PassageSensor:
    """A channel of a passage: ``name``, the ``section`` that it monitors and its ``position`` [m].

    ``track`` is "main", "diverging" or "both": the trains that it measures. ``panel`` is that of the section, "" where
    it is not known.
    """

    name: str
    section: str
    position: float
    track: str = "both"
    panel: str = ""


@dataclass(frozen=True, repr=False)
class SpeedFinding:
    """``speed`` [m/s] with ``se``, and ``acceleration`` [m/s²] with its error.

    ``time`` [s] is halfway between the passing times of the first and the last axle at the origin of the motion: the
    speed is that moment's.

    ``source`` is "sensors", "axle spacing", "both" or "bogie" (a guess from an unknown train's bogies).
    ``disagreement`` is the difference of sensors and axle spacing in standard errors, None without both.
    """

    speed: float
    se: float
    acceleration: float
    acceleration_se: float
    source: str
    disagreement: float | None = None
    time: float = 0.0

    def __repr__(self) -> str:
        return f"SpeedFinding({self.speed:.2f} ± {Z95 * self.se:.2f} m/s (95 %), from {self.source})"

    def at(self, time: float) -> float:
        """Speed at another time. [m/s]

        Parameters
        ----------
        time : float
            Time after the start of the recording. [s]

        Returns
        -------
        float
            Speed at that time. [m/s]
        """
        return self.speed + self.acceleration * (time - self.time)

    def moved_to(self, time: float) -> SpeedFinding:
        """The speed at another time, with the error that the acceleration adds until then.

        Parameters
        ----------
        time : float
            Time after the start of the recording. [s]

        Returns
        -------
        SpeedFinding
            With that ``time``.

        Examples
        --------
        >>> SpeedFinding(20.0, 0.03, -0.5, 0.02, "sensors", time=4.0).moved_to(6.0)
        SpeedFinding(19.00 ± 0.10 m/s (95 %), from sensors)
        """
        se = float(np.hypot(self.se, self.acceleration_se * (time - self.time)))
        return replace(self, speed=self.at(time), se=se, time=time)


@dataclass(frozen=True)
class Passage:
    """One train found in a recording.

    ``offsets`` (n_axle,) [m] behind the first axle, ``times`` (n_axle,) [s] when they pass the turnout's origin.
    The origin of ``motion`` is position 0, or the sensor nearest to it where it is not among the sensors.
    ``at_sensor`` maps a channel to (n_axle,) [s], for channels that recorded the train; ``audible_sensors`` names them.
    ``status`` is "accepted", "partly" or "rejected" with ``findings``; ``contrast`` of the axle count.
    """

    status: str
    findings: tuple[Rejection, ...]
    motion: Motion | None = None
    speed: SpeedFinding | None = None
    offsets: np.ndarray = field(default_factory=lambda: np.zeros(0))
    direction: str = "unknown"
    track: str = "unknown"
    type: TypeFinding | None = None
    at_sensor: dict[str, np.ndarray] = field(default_factory=dict)
    contrast: float = 0.0
    begin: float | None = None
    end: float | None = None
    drifting: dict = field(default_factory=dict)

    def __repr__(self) -> str:
        doubts = ", ".join(dict.fromkeys(f.reason for f in self.findings))
        if not self.n_axle or self.speed is None or self.type is None:
            return f"Passage({self.status}: {doubts or 'no train'})"
        speed = f"{KMH * self.speed.speed:.1f} ± {KMH * Z95 * self.speed.se:.1f} km/h"
        words = [f"{self.n_axle} axles", speed, f"type {self.type.type}", self.direction, f"track {self.track}"]
        return f"Passage({self.status}: {', '.join(words)}{f'; {doubts}' if doubts else ''})"

    @property
    def train_motion(self) -> Motion:
        """Motion of the train.

        Raises
        ------
        ValueError
            No train was found.
        """
        if self.motion is None:
            raise ValueError("no train was found in this recording")
        return self.motion

    @property
    def n_axle(self) -> int:
        """Number of axles."""
        return len(self.offsets)

    @property
    def times(self) -> np.ndarray:
        """(n_axle,) times at which the axles pass the turnout's origin; empty without a motion. [s]"""
        return self.motion.passing(self.offsets, 0.0) if self.motion else np.zeros(0)

    @property
    def audible_sensors(self) -> tuple[str, ...]:
        """Names of the channels that recorded the train."""
        return tuple(self.at_sensor)

    @property
    def reason(self) -> str | None:
        """Code of the first finding."""
        return self.findings[0].reason if self.findings else None
