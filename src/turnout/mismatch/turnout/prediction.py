"""Predictions of the recordings of a turnout with caches: receptances of hammer tests and signals of passages."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Protocol, TypeAlias

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.case import Nuisance, Observation
from turnout.mismatch.turnout import passage_band, passage_model, receptance_model, receptance_observation, sensitivity
from turnout.mismatch.turnout.campaign import PassageInput
from turnout.mismatch.turnout.passage_model import PassageSimulator, Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.pseudo_forces import probes
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.receptance_model import ReceptanceModel
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.site import Site
from turnout.mismatch.turnout.track_parameters import (
    rail_on_grid,
    rail_sds,
    track_value_key,
    track_with,
    vehicle_with,
    with_rail,
)
from turnout.physics.term import PhysicsTerm
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import Track
from turnout.simulate.wheel_path import Surfaces

Values: TypeAlias = Mapping[str, float]  # nuisance parameters by name
Terms: TypeAlias = Sequence[PhysicsTerm]


class Predictions(Protocol):
    """What a case asks of a ``Predictor``, or of a cache around it."""

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Predictions of receptances and passages, (n,) per observation.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        observations : sequence of Observation
            Receptances and passages.

        Returns
        -------
        list[array]
            Predictions of receptances and passages, (n,) per observation.
        """

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Predictions with ``new`` terms, a small step from ``terms`` with known ``predictions``.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        new : Terms
            Terms that are added.
        observations : sequence of Observation
            Receptances and passages.
        predictions : sequence of array
            (n,) prediction of each observation with ``terms``.

        Returns
        -------
        list[array]
            Predictions with ``new`` terms, a small step from ``terms`` with known ``predictions``.
        """

    def nuisance_jacobian(
        self,
        nuisances: Sequence[Nuisance],
        values: Values,
        terms: Terms,
        observations: Sequence[Observation],
        base: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Derivatives by ``nuisances``, (n, n_nuisance) per observation.

        Parameters
        ----------
        nuisances : sequence of Nuisance
            Nuisance parameters, one column each.
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        observations : sequence of Observation
            Receptances and passages.
        base : sequence of array
            (n,) prediction of each observation at ``values``.

        Returns
        -------
        list[array]
            Derivatives by ``nuisances``, (n, n_nuisance) per observation.
        """


class Predictor:
    """Predicts receptances and passages of one site, for any values of its nuisances and any terms.

    ``rail`` holds the logarithms of the rail values about which the track of passages is modelled, ``zone`` the track
    with them. ``frf_pairs`` and ``aligned_passages`` describe by name what was measured. A predictor never changes but
    for its caches: another rail or another solver makes another predictor.
    """

    def __init__(self, site: Site, solver: Track1D, rail: Values | None = None):
        self.site, self.solver = site, solver
        self.frf_pairs: Mapping[str, FrfPair] = {}
        self.aligned_passages: Mapping[str, AlignedPassage] = {}
        self.rail = {name: (rail or {}).get(name, 0.0) for name in rail_sds(site.nominal)}
        self.zone = with_rail(site.nominal, self.rail)
        self._rail_tracks: OrderedDict[Hashable, Track] = OrderedDict()
        self._signals: OrderedDict[Hashable, np.ndarray] = OrderedDict()
        self._signals_with_probes: OrderedDict[Hashable, np.ndarray] = OrderedDict()
        self._simulators: OrderedDict[Hashable, PassageSimulator] = OrderedDict()
        self._sensitivities: OrderedDict[Hashable, ReceptanceSensitivity] = OrderedDict()
        self._transfers: OrderedDict[Hashable, Any] = OrderedDict()
        self._zones_with_file_values: dict[tuple[str, ...], Any] = {}
        # difference quotients of passages, each with the common values (in prior sd) at which it was computed
        self.differences: dict[Hashable, tuple[dict[str, float], np.ndarray]] = {}

    def with_recordings(
        self, frf_pairs: Mapping[str, FrfPair], aligned_passages: Mapping[str, AlignedPassage]
    ) -> Predictor:
        """The predictor of these recordings; it shares its caches with this one.

        Parameters
        ----------
        frf_pairs : mapping of str to FrfPair
            Measured receptances by their id.
        aligned_passages : mapping of str to AlignedPassage
            Aligned passages by their id.

        Returns
        -------
        Predictor
            The predictor of these recordings; it shares its caches with this one.
        """
        other = copy(self)
        other.frf_pairs, other.aligned_passages = dict(frf_pairs), dict(aligned_passages)
        return other

    def recentre(self, values: Values) -> Predictor:
        """The predictor with the track of passages about the rail that ``values`` give.

        Receptances are linear in deviations of the rail from a grid, so they hardly depend on it.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        Predictor
            The predictor with the track of passages about the rail that ``values`` give.
        """
        other = Predictor(self.site, self.solver, values)
        other.frf_pairs, other.aligned_passages = self.frf_pairs, self.aligned_passages
        other._rail_tracks = self._rail_tracks
        return other

    def with_solver(self, solver: Track1D) -> Predictor:
        """The predictor with another simulation of passages, with empty caches.

        Parameters
        ----------
        solver : Track1D
            Simulation of passages.

        Returns
        -------
        Predictor
            The predictor with another simulation of passages, with empty caches.
        """
        other = Predictor(self.site, solver, self.rail)
        other.frf_pairs, other.aligned_passages = self.frf_pairs, self.aligned_passages
        return other

    @property
    def waves(self) -> Waves:
        """Free waves of the rail; SimulationError without passages."""
        if self.site.waves is None:
            raise SimulationError("no passage was given: the rail has no free waves.")
        return self.site.waves

    @property
    def surface(self) -> RunningSurface:
        """Running surface with its uncertain numbers; SimulationError without passages."""
        if self.site.surface is None:
            raise SimulationError("no passage was given: there is no running surface.")
        return self.site.surface

    def track(self, route: str = "main", terms: Iterable[PhysicsTerm] = ()) -> Track:
        """Base track of a route, cut to the zone.

        Rail values that ``terms`` set themselves are as in the track file.

        Parameters
        ----------
        route : str
            Route through the turnout.
        terms : iterable of PhysicsTerm
            Physics terms of the effects.

        Returns
        -------
        Track
            Base track of a route, cut to the zone.
        """
        file_names = tuple(sorted({t.name for t in terms} & set(self.rail)))
        if file_names and file_names not in self._zones_with_file_values:
            self._zones_with_file_values[file_names] = with_rail(
                self.site.nominal, {n: 0.0 if n in file_names else v for n, v in self.rail.items()}
            )
        zone = self._zones_with_file_values[file_names] if file_names else self.zone
        return zone.turnout.track_of(route)

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Predictions of receptances and passages.

        Parameters
        ----------
        values : mapping
            All nuisances of the site, by name.
        terms : sequence of PhysicsTerm
            Effects beside the base model.
        observations : sequence of Observation
            Of ``frf_pairs`` or ``aligned_passages``, by their names.

        Returns
        -------
        list of (n,) array
            One per observation, in its unit.

        Raises
        ------
        SimulationError
            A passage cannot be simulated at these values.
        """
        predictions, sensitivity_of = [], self.pair_sensitivities(values, terms)
        for o in observations:
            if o.name in self.frf_pairs:
                pair = self.frf_pairs[o.name]
                predictions.append(self.predict_receptance(values, terms, pair, sensitivity_of(pair)))
            else:
                predictions.append(self.predict_passage(values, terms, self.aligned_passages[o.name]))
        return predictions

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Predictions a small step away: receptances follow without solving the track again.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        new : Terms
            Terms that are added.
        observations : sequence of Observation
            Receptances and passages.
        predictions : sequence of array
            (n,) prediction of each observation with ``terms``.

        Returns
        -------
        list[array]
            Predictions a small step away: receptances follow without solving the track again.
        """
        return receptance_model.predict_near(self, values, terms, new, observations, predictions)

    def nuisance_jacobian(
        self,
        nuisances: Sequence[Nuisance],
        values: Values,
        terms: Terms,
        observations: Sequence[Observation],
        base: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Derivatives by ``nuisances``, see ``sensitivity.nuisance_jacobian``.

        Parameters
        ----------
        nuisances : sequence of Nuisance
            Nuisance parameters, one column each.
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        observations : sequence of Observation
            Receptances and passages.
        base : sequence of array
            (n,) prediction of each observation at ``values``.

        Returns
        -------
        list[array]
            Derivatives by ``nuisances``, see ``sensitivity.nuisance_jacobian``.
        """
        return sensitivity.nuisance_jacobian(self, nuisances, values, terms, observations, base)

    def pair_sensitivities(self, values: Values, terms: Terms) -> Callable[[FrfPair], ReceptanceSensitivity]:
        """Function that gives ``pair_sensitivity`` of a pair at these values, computed once per conditions.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.

        Returns
        -------
        Callable[[FrfPair], ReceptanceSensitivity]
            Function that gives ``pair_sensitivity`` of a pair at these values, computed once per conditions.
        """
        sensitivities: dict[Hashable, ReceptanceSensitivity] = {}

        def sensitivity_of(pair: FrfPair) -> ReceptanceSensitivity:
            conditions = tuple(sorted(pair.conditions.items()))
            if conditions not in sensitivities:
                sensitivities[conditions] = self.pair_sensitivity(values, terms, pair)
            return sensitivities[conditions]

        return sensitivity_of

    def pair_sensitivity(self, values: Values, terms: Terms, pair: FrfPair) -> ReceptanceSensitivity:
        """``ReceptanceSensitivity`` of all pairs under the conditions of ``pair``, cached.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        ReceptanceSensitivity
            ``ReceptanceSensitivity`` of all pairs under the conditions of ``pair``, cached.
        """
        track_terms = receptance_observation.track_terms(terms, pair.conditions)
        rail = rail_on_grid(values, self.rail)
        pair_keys, seats = self._pairs_and_seats(values, terms, pair.conditions)
        key = (
            repr(track_terms),
            tuple(rail.values()),
            track_value_key(self.zone, values),
            pair_keys,
            tuple(seats.items()),
        )
        if key not in self._sensitivities:
            model = ReceptanceModel(track_with(self._track_near(rail), self.zone, values), track_terms)
            self._sensitivities[key] = ReceptanceSensitivity(model, pair_keys, seats, self.zone)
            # all positions at once: rounding depends on what is solved together
            model.solve((*(position for position, _ in pair_keys), *seats.values()))
            _shorten(self._sensitivities, SIMULATION.sensitivity_cache_size)
        return self._sensitivities[key]

    def _track_near(self, rail: Values) -> Track:
        """The main track with ``rail`` values on the grid of ``rail_on_grid``; cached."""
        key = tuple(rail.values())
        if key not in self._rail_tracks:
            self._rail_tracks[key] = with_rail(self.site.nominal, rail).turnout.track_of("main")
            _shorten(self._rail_tracks, SIMULATION.rail_cache_size)
        return self._rail_tracks[key]

    def _pairs_and_seats(self, values: Values, terms: Terms, conditions: Mapping[str, Any]) -> tuple[tuple, dict]:
        """(position of the impact, ``FrfPair.seat``) of all pairs under these conditions; positions of these seats."""
        pairs = [p for p in self.frf_pairs.values() if p.conditions == conditions]
        sensors, track = {p.seat: p.sensor for p in pairs}, self.track()
        seats = {seat: self.seat(s, values, terms).probe(track).place for seat, s in sensors.items()}
        return tuple((p.test.place, p.seat) for p in pairs), seats

    def seat(self, sensor: Sensor, values: Values, terms: Terms) -> Sensor:
        """The sensor at the position that ``values`` and ``terms`` give.

        Parameters
        ----------
        sensor : Sensor
            A sensor.
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.

        Returns
        -------
        Sensor
            The sensor at the position that ``values`` and ``terms`` give.
        """
        offset = values.get(f"seat_{sensor.name}", 0.0)
        return passage_model.place_sensor(replace(sensor, place=sensor.place + offset) if offset else sensor, terms)

    def channel_response(self, values: Values, terms: Terms, pair: FrfPair) -> np.ndarray:
        """(n_line,) complex factor of the channel of a pair.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        (n_line,) array
            Complex factor of the channel of a pair.
        """
        factor = receptance_observation.channel_factor(terms, pair.sensor, receptance_observation.SHIFTED_LINES)
        return factor * (1.0 + values.get(f"gain_{pair.channel}", 0.0))

    def receptance(self, values: Values, pair: FrfPair, sensitivity: ReceptanceSensitivity) -> np.ndarray:
        """(n_line,) receptance of a pair [m/N], corrected to first order for the rail of ``values``.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        pair : FrfPair
            Pair of impact position and sensor.
        sensitivity : ReceptanceSensitivity
            Receptances of all pairs with their derivatives.

        Returns
        -------
        (n_line,) array
            Receptance of a pair [m/N], corrected to first order for the rail of ``values``.
        """
        deviation = [values[k] - at for k, at in rail_on_grid(values, self.rail).items()]
        return sensitivity.receptance(pair) + sensitivity.rail_gradient(pair) @ deviation

    def predict_receptance(
        self, values: Values, terms: Terms, pair: FrfPair, sensitivity: ReceptanceSensitivity
    ) -> np.ndarray:
        """(2n,) Re and Im of the receptance of a pair over its measured magnitude.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        pair : FrfPair
            Pair of impact position and sensor.
        sensitivity : ReceptanceSensitivity
            Receptances of all pairs with their derivatives.

        Returns
        -------
        (2n,) array
            Re and Im of the receptance of a pair over its measured magnitude.
        """
        return receptance_observation.split_complex(
            receptance_observation.scale_lines(
                pair, self.receptance(values, pair, sensitivity), self.channel_response(values, terms, pair)
            )
        )

    def predict_passage(
        self, values: Values, terms: Terms, aligned: AlignedPassage, with_probes: bool = True
    ) -> np.ndarray:
        """(n_sensor * n_time,) predicted signals of a passage, one sensor after the other [m/s²].

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
        (n_sensor * n_time,) array
            Predicted signals of a passage, one sensor after the other [m/s²].
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
        signal : array
            (n,) simulated acceleration [m/s²].

        Returns
        -------
        array
            Output of the channel of a sensor for the simulated signal ``signal``, at the times of the recording.
        """
        start = aligned.reference + values[f"time@{aligned.name}"] - SIMULATION.lead_time
        rate, time = 4.0 * self.solver.rate, aligned.time - start
        for term in terms:
            if term.effect_type == "channel":
                signal = term.under_conditions({"name": aligned.name, "start": start}).channel(signal, rate, sensor)
        return (1.0 + values[f"gain_{sensor.name}"]) * passage_band.read_at(
            aligned.limit_band(signal, rate), rate, time
        )

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
        array
            Simulated signals of the sensors before their channels, at four times the rate of the simulation; cached.
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
        array
            Simulated signals of the sensors and of ``probes`` at the rate of the simulation; the latest are cached.
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
        _, speed, load = _train_values(values, aligned)
        vehicle = vehicle_with(aligned.passage.vehicle, values, aligned.train, load)
        simulator, path = self.passage_simulator(values, passage_terms, aligned.passage), self.waves.path(values)
        sensors = [replace(s, place=s.place + values.get(f"seat_{s.name}", 0.0)) for s in aligned.sensors]
        surfaces: Surfaces = tuple(
            (*surface, *path) for surface in self.surface.surfaces(aligned.passage.route, values)
        )
        probe_points = probes(self, values, terms, aligned) if with_probes else []
        signals = simulator(
            aligned.passage, vehicle, aligned.speed * (1.0 + speed), sensors, probe_points, surfaces, aligned.sensors
        )
        self._signals[key] = signals[: len(sensors)].copy()
        _shorten(self._signals, SIMULATION.signal_cache_size)
        if with_probes:
            self._signals_with_probes[key] = signals
            _shorten(self._signals_with_probes, 2 * len(self.aligned_passages) + SIMULATION.probe_cache_spare)

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
            _shorten(self._transfers, SIMULATION.transfer_cache_size)
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
            ``PassageSimulator`` of a passage's route with these terms, cached.
        """
        key = passage.route, track_value_key(self.zone, values), repr(terms)
        if key not in self._simulators:
            track = track_with(self.track(passage.route, terms), self.zone, values)
            self._simulators[key] = PassageSimulator(self.zone.turnout, track, terms, self.solver)
            _shorten(self._simulators, SIMULATION.simulator_cache_size)
        return self._simulators[key]


def _shorten(cache: OrderedDict[Hashable, Any], size: int) -> None:
    """Drop the oldest entries beyond ``size``."""
    while len(cache) > size:
        cache.popitem(last=False)


def _train_values(values: Values, aligned: AlignedPassage) -> tuple[float, float, float]:
    """Unsprung mass, speed and load of a passage."""
    return values[f"wheels_{aligned.train}"], values[f"speed@{aligned.name}"], values[f"load@{aligned.name}"]


def _moves_sensor(term: PhysicsTerm) -> bool:
    """Whether a channel term changes the simulation itself, by the position of the sensor."""
    return type(term).sensor is not PhysicsTerm.sensor
