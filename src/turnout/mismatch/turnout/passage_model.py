"""Fast simulation of passages for fits: coarse in time and mesh, with one factorised track for many trains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.matrix_cache import matrices_of
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.mismatch.turnout.campaign import PassageInput
    from turnout.physics.term import PhysicsTerm
    from turnout.simulate.run import Outcome, Probe
    from turnout.simulate.sensor import Sensor
    from turnout.simulate.track import Track
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.vehicle import Vehicle
    from turnout.simulate.wheel_path import Surfaces


@dataclass(frozen=True)
class Track1D:
    """Settings of the simulation used in fits; ``elements`` per bay, None: as in the track file."""

    rate: float = SIMULATION.rate
    scheme: str = "radau"
    elements: int | None = SIMULATION.elements_per_bay


class PassageSimulator:
    """Simulates passages on one track with one set of terms; they share one factorisation."""

    def __init__(self, turnout: TurnoutTrack, track: Track, terms: Sequence[PhysicsTerm], settings: Track1D):
        self.turnout, self.terms, self.settings = turnout, tuple(terms), settings
        if settings.elements and not track.pad_width:  # a wide pad needs the nodes beside its support
            track = track.with_(elements_per_bay=settings.elements)
        self.track = track
        matrices = matrices_of(track, self.terms)
        self.prepared = prepare(
            track, 1.0 / settings.rate, settings.scheme, self.terms, SIMULATION.decay_exponent, matrices
        )

    def __call__(
        self,
        passage: PassageInput,
        vehicle: Vehicle,
        speed: float,
        sensors: Sequence[Sensor],
        probes: Sequence[Probe] = (),
        surfaces: Surfaces | None = None,
        described: Sequence[Sensor] | None = None,
    ) -> np.ndarray:
        """(n_sensor + n_probe, n) signals of ``outcome``, with its parameters. [m/s², or as the probe]"""
        return self.outcome(passage, vehicle, speed, sensors, probes, surfaces, described, forces=False).signals

    def outcome(
        self,
        passage: PassageInput,
        vehicle: Vehicle,
        speed: float,
        sensors: Sequence[Sensor],
        probes: Sequence[Probe] = (),
        surfaces: Surfaces | None = None,
        described: Sequence[Sensor] | None = None,
        forces: bool = True,
    ) -> Outcome:
        """Signals and wheel forces over ``surfaces``, by default those of the file.

        At time 0 the first wheel is ``SIMULATION.lead_time`` before the first sensor, at its position in ``described``.

        Parameters
        ----------
        passage : PassageInput
            Its direction and route.
        vehicle : Vehicle
            The vehicle.
        speed : float
            Speed. [m/s]
        sensors : sequence of Sensor
            The sensors.
        probes : sequence of Probe
            Further signals.
        surfaces : tuple of tuple or None
            Running surfaces; None: those of the track file.
        described : sequence of Sensor or None
            Sensors at the positions of the file, which define time 0; None: ``sensors``.
        forces : bool
            Whether the forces of wheels are returned.

        Returns
        -------
        Outcome
            Its signals are those of the sensors and probes, at the rate of the simulation. [m/s², or as the probe]
        """
        for term in self.terms:
            vehicle = term.vehicle(vehicle)
        sign = 1 if passage.direction == "facing" else -1
        positions = sign * np.array([s.place for s in described or sensors])
        start = sign * (positions.min() - speed * SIMULATION.lead_time)
        distance = (
            np.ptp(positions)
            + float(vehicle.wheel_positions[-1])
            + speed * (SIMULATION.lead_time + 2.0 * SIMULATION.edge_time)
        )
        seats = [place_sensor(s, self.terms).probe(self.track) for s in sensors]
        drive = Drive(start, speed, sign, surfaces or self.turnout.surfaces(passage.route), path_step=0.01)
        return run(self.prepared, distance / speed, [*seats, *probes], vehicle, drive, forces=forces, tolerance=1e-3)


def place_sensor(sensor: Sensor, terms: Sequence[PhysicsTerm]) -> Sensor:
    """The sensor at the position that the terms give.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    terms : sequence of PhysicsTerm
        Some may move a sensor.

    Returns
    -------
    Sensor
    """
    for term in terms:
        sensor = term.sensor(sensor)
    return sensor
