"""What an effect may add to a simulation. The simulation takes effects as a list and knows no single one."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any, Self

    import numpy as np

    from turnout.simulate.force_laws import Port
    from turnout.simulate.links import Link
    from turnout.simulate.sensor import Sensor
    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

EFFECT_TYPES = ("matrix", "port", "path", "channel", "vehicle")


class Effect:
    """Base class of effects. A subclass is a frozen dataclass; what it does not define changes nothing.

    Fields named ``sleeper``, ``support``, ``first`` and ``last`` are numbers of supports.

    Attributes
    ----------
    name : str
        Name of the effect in rows, track files and options.
    effect_type : str
        How it enters the simulation, one of ``EFFECT_TYPES``.
    recording_types : tuple of str
        Types of recordings in which a channel shows it, "hammer" and "passage".
    scales_track : bool
        Whether its links are a multiple of the track's springs; other effects then act on the result.
    """

    name: ClassVar[str] = ""
    effect_type: ClassVar[str] = ""
    recording_types: ClassVar[tuple[str, ...]] = ("hammer", "passage")
    scales_track: ClassVar[bool] = False

    def links(self, track: Track) -> Sequence[Link]:
        """Matrix entries that the effect adds. Naming a new degree of freedom creates it.

        Parameters
        ----------
        track : Track
            The track without the effect.

        Returns
        -------
        sequence of Link
        """
        return ()

    def ports(self, track: Track) -> Sequence[Port]:
        """Scalar forces that matrices cannot describe.

        Parameters
        ----------
        track : Track
            The track without the effect.

        Returns
        -------
        sequence of Port
        """
        return ()

    @property
    def withheld_share(self) -> float:
        """Share of the ballast of a sleeper that the ports of the effect remove."""
        return 0.0

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """Parts of a wheel's path.

        Parameters
        ----------
        track : Track
            The track under the wheels.
        vehicle : Vehicle
            The vehicle whose wheels follow the path.

        Returns
        -------
        sequence of callable
            (x, wheel) -> dip [m]. An attribute ``wheel`` restricts a part to one wheel; ``per_wheel = True`` has it
            evaluated for each wheel.
        """
        return ()

    def rail(self, track: Track) -> Track:
        """The track with changed rails; its supports are changed by links.

        Parameters
        ----------
        track : Track
            The track without the effect.

        Returns
        -------
        Track
            With other rails.
        """
        return track

    def sensor(self, sensor: Sensor) -> Sensor:
        """The sensor at its true position, if its description is wrong.

        Parameters
        ----------
        sensor : Sensor
            The sensor as it is described.

        Returns
        -------
        Sensor
            At its true position.
        """
        return sensor

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The same effect under the conditions of one recording.

        Parameters
        ----------
        conditions : mapping
            What is known of the recording: ``rail_temperature`` [°C], ``axle_loads`` [N], ``train``, ``name``,
            ``start`` [s].

        Returns
        -------
        Effect
            Of the same class.
        """
        return self

    def channel(self, signal: np.ndarray, rate: float, sensor: Sensor) -> np.ndarray:
        """Signal that the channel of a sensor records.

        Parameters
        ----------
        signal : (n,) array of float
            The true signal.
        rate : float
            Sampling rate. [Hz]
        sensor : Sensor
            The sensor of the channel.

        Returns
        -------
        (n,) array of float
        """
        return signal

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with the effect.

        Parameters
        ----------
        vehicle : Vehicle
            The vehicle without the effect.

        Returns
        -------
        Vehicle
            With other masses, springs or wheels.
        """
        return vehicle
