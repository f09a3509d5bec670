"""Predictions of passages: simulated signals, and responses of the track that passages share, in caches."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from turnout.mismatch.turnout import passage_band
from turnout.mismatch.turnout.campaign import PassageInput
from turnout.mismatch.turnout.passage_model import PassageSimulator, Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.predictions import Terms, Values
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.pseudo_forces import probes
from turnout.mismatch.turnout.site import Site
from turnout.mismatch.turnout.site_model import SiteModel, drop_oldest
from turnout.mismatch.turnout.track_parameters import track_value_key, track_with, vehicle_with
from turnout.physics.term import PhysicsTerm
from turnout.simulate.run import Outcome, Probe
from turnout.simulate.sensor import Sensor
from turnout.simulate.wheel_path import PathPart, Surfaces


class PassagePredictor(SiteModel):
    """Predicts the passages of a site."""

    def __init__(self, site: Site, solver: Track1D, rail: Values | None = None):
        super().__init__(site, solver, rail)
        self._signals: OrderedDict[Hashable, np.ndarray] = OrderedDict()
        self._signals_with_probes: OrderedDict[Hashable, np.ndarray] = OrderedDict()
        self._simulators: OrderedDict[Hashable, PassageSimulator] = OrderedDict()
        self._transfers: OrderedDict[Hashable, Any] = OrderedDict()
        # difference quotients of passages, each with the values on which it depends
        self.differences: OrderedDict[Hashable, tuple[dict[Hashable, float], np.ndarray]] = OrderedDict()

    def predict_passage(
        self, values: Values, terms: Terms, aligned: AlignedPassage, with_probes: bool = True
    ) -> np.ndarray:
        """Predicted signals of a passage, one sensor after the other.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.
        with_probes : bool
            Whether a simulation also records the probes that derivatives need. One beside the point of the
            derivatives need not, and must not displace theirs in the cache.

        Returns
        -------
        (n_sensor * n_time,) array of float
            Acceleration. [m/s²]
        """
        signals = self.sensor_signals(values, terms, aligned, with_probes)
        return np.concatenate(
            [self.channel_output(values, terms, aligned, s, row) for s, row in zip(aligned.sensors, signals)]
        )

    def channel_output(
        self, values: Values, terms: Terms, aligned: AlignedPassage, sensor: Sensor, signal: np.ndarray
    ) -> np.ndarray:
        """Output of the channel of a sensor for the simulated signal ``signal``, at the times of the recording.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.
        sensor : Sensor
            A sensor.
        signal : (n,) array of float
            Simulated acceleration. [m/s²]

        Returns
        -------
        (n_time,) array of float
            Acceleration. [m/s²]
        """
        signal = self.through_channel(values, terms, aligned, sensor, signal)
        return self.at_recorded_times(values, aligned, sensor, aligned.limit_band(signal, 4.0 * self.solver.rate))

    def through_channel(
        self, values: Values, terms: Terms, aligned: AlignedPassage, sensor: Sensor, signal: np.ndarray
    ) -> np.ndarray:
        """A simulated signal with the effects of its channel, at the rate of ``signal`` and without limit to its band.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.
        sensor : Sensor
            A sensor.
        signal : (n,) array of float
            Simulated acceleration. [m/s²]

        Returns
        -------
        (n,) array of float
            [m/s²]
        """
        start = _start_time(values, aligned)
        conditions = {"name": aligned.name, "start": start, "hum_lines": aligned.hum_lines}
        for term in terms:
            if term.effect_type == "channel" and "passage" in term.recording_types:
                signal = term.under_conditions(conditions).channel(signal, 4.0 * self.solver.rate, sensor)
        return signal

    def at_recorded_times(
        self, values: Values, aligned: AlignedPassage, sensor: Sensor, signal: np.ndarray
    ) -> np.ndarray:
        """A signal within its band, with the gain of its channel, at the times of the recording.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.
        sensor : Sensor
            A sensor.
        signal : (n,) array of float
            At four times the rate of the simulation. [m/s²]

        Returns
        -------
        (n_time,) array of float
            [m/s²]
        """
        time = aligned.time - _start_time(values, aligned)
        return (1.0 + values[f"gain_{sensor.name}"]) * passage_band.read_at(signal, 4.0 * self.solver.rate, time)

    def sensor_signals(
        self, values: Values, terms: Terms, aligned: AlignedPassage, with_probes: bool = True
    ) -> np.ndarray:
        """Simulated signals of the sensors before their channels, at four times the rate of the simulation; cached.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.
        with_probes : bool
            Whether a simulation also records the probes.

        Returns
        -------
        (n_sensor, n) array of float
            Acceleration. [m/s²]
        """
        passage_terms, key = self._terms_and_key(values, terms, aligned)
        if key not in self._signals:
            self._simulate(values, terms, aligned, passage_terms, key, with_probes)
        return passage_band.upsample(self._signals[key])

    def signals_with_probes(self, values: Values, terms: Terms, aligned: AlignedPassage) -> np.ndarray:
        """Simulated signals of the sensors and of ``probes`` at the rate of the simulation; the latest are cached.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.

        Returns
        -------
        (n_sensor + n_probe, n) array of float
            Acceleration of the sensors, then of the probes. [m/s²]
        """
        passage_terms, key = self._terms_and_key(values, terms, aligned)
        if key not in self._signals_with_probes:
            self._simulate(values, terms, aligned, passage_terms, key)
        return self._signals_with_probes[key]

    def _terms_and_key(
        self, values: Values, terms: Terms, aligned: AlignedPassage
    ) -> tuple[tuple[PhysicsTerm, ...], Hashable]:
        """(terms under the conditions of a passage, cache key of its simulation)."""
        passage_terms = tuple(
            t.under_conditions(aligned.conditions) for t in terms if t.effect_type != "channel" or _moves_sensor(t)
        )
        path = self.waves.path(values)
        shape, surfaces = path[0].dip.tobytes() if path else b"", self.surface.surfaces(aligned.passage.route, values)
        seats = tuple(values.get(f"seat_{s.name}", 0.0) for s in aligned.sensors)
        return passage_terms, (
            aligned.name,
            track_value_key(self.zone, values),
            _train_values(values, aligned),
            seats,
            shape,
            surfaces,
            repr(passage_terms),
        )

    def _simulate(
        self,
        values: Values,
        terms: Terms,
        aligned: AlignedPassage,
        passage_terms: Terms,
        key: Hashable,
        with_probes: bool = True,
    ) -> None:
        """Simulate a passage and cache it. Probe signals are large: their cache is small."""
        probe_points = probes(self, values, terms, aligned) if with_probes else []
        signals = self._outcome(values, aligned, passage_terms, probe_points).signals
        self._signals[key] = signals[: len(aligned.sensors)].copy()
        drop_oldest(self._signals, SIMULATION.signal_cache_size)
        if with_probes:
            self._signals_with_probes[key] = signals
            drop_oldest(self._signals_with_probes, 2 * len(self.aligned_passages) + SIMULATION.probe_cache_spare)

    def _outcome(
        self,
        values: Values,
        aligned: AlignedPassage,
        passage_terms: Terms,
        probe_points: Sequence[Probe] = (),
        further_path: Sequence[PathPart] = (),
        forces: bool = False,
    ) -> Outcome:
        """Simulate a passage, with ``further_path`` added to every running surface."""
        self.site.count.n += 1
        _, speed, load = _train_values(values, aligned)
        vehicle = vehicle_with(aligned.passage.vehicle, values, aligned.train, load)
        simulator, path = self.passage_simulator(values, passage_terms, aligned.passage), self.waves.path(values)
        sensors = [replace(s, place=s.place + values.get(f"seat_{s.name}", 0.0)) for s in aligned.sensors]
        surfaces: Surfaces = tuple(
            (*surface, *path, *further_path) for surface in self.surface.surfaces(aligned.passage.route, values)
        )
        return simulator.outcome(
            aligned.passage, vehicle, aligned.speed * (1.0 + speed), sensors, probe_points, surfaces, aligned.sensors,
            forces,
        )  # fmt: skip

    def predict_over(
        self, values: Values, aligned: AlignedPassage, further_path: Sequence[PathPart]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Signals and wheel forces of a passage whose wheels meet a further path, without terms; not cached.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        aligned : AlignedPassage
            A passage with its time shift, speed and load.
        further_path : sequence of path parts
            Added to every running surface.

        Returns
        -------
        signals : (n_sensor * n_time,) array of float
            One sensor after the other. [m/s²]
        forces : (n_wheel, n) array of float
            At the rate of the simulation. [N]
        """
        outcome = self._outcome(values, aligned, (), (), further_path, forces=True)
        signals = passage_band.upsample(outcome.signals)
        rows = [self.channel_output(values, (), aligned, s, row) for s, row in zip(aligned.sensors, signals)]
        return np.concatenate(rows), outcome.force

    def track_transfer(self, key: Hashable, compute: Callable[[], Any]) -> Any:
        """A response of the track that passages under the same conditions share; the latest are cached.

        Parameters
        ----------
        key : hashable
            All that the response depends on, beside this predictor.
        compute : callable
            () -> the response, of arrays that nobody changes.

        Returns
        -------
        Any
            What ``compute`` returns, or has returned for this key.
        """
        if key not in self._transfers:
            self._transfers[key] = compute()
            drop_oldest(self._transfers, SIMULATION.transfer_cache_size)
        return self._transfers[key]

    def passage_simulator(self, values: Values, terms: Terms, passage: PassageInput) -> PassageSimulator:
        """``PassageSimulator`` of a passage's route with these terms, cached.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        passage : PassageInput
            A train passage.

        Returns
        -------
        PassageSimulator
        """
        key = passage.route, track_value_key(self.zone, values), repr(terms)
        if key not in self._simulators:
            track = track_with(self.track(passage.route, terms), self.zone, values)
            self._simulators[key] = PassageSimulator(self.zone.turnout, track, terms, self.solver)
            drop_oldest(self._simulators, SIMULATION.simulator_cache_size)
        return self._simulators[key]


def _start_time(values: Values, aligned: AlignedPassage) -> float:
    """Time of the recording at which the simulation starts [s]."""
    return aligned.reference + values[f"time@{aligned.name}"] - SIMULATION.lead_time


def _train_values(values: Values, aligned: AlignedPassage) -> tuple[float, float, float]:
    """Unsprung mass, speed and load of a passage."""
    return values[f"wheels_{aligned.train}"], values[f"speed@{aligned.name}"], values[f"load@{aligned.name}"]


def _moves_sensor(term: PhysicsTerm) -> bool:
    """Whether a channel term changes the simulation itself, by the position of the sensor."""
    return type(term).sensor is not PhysicsTerm.sensor
