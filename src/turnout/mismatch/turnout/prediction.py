"""Predictions of the recordings of a track with caches: receptances of hammer tests and signals of passages."""

from collections import OrderedDict
from dataclasses import replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_band, passage_model, receptance_model, receptance_observation
from turnout.mismatch.turnout.pseudo_forces import probes
from turnout.mismatch.turnout.receptance_model import ReceptanceModel
from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
from turnout.mismatch.turnout.track_parameters import rail_on_grid, track_value_key, track_with, vehicle_with, with_rail
from turnout.physics.term import PhysicsTerm

PASSAGE_CACHE_SIZE = 150  # simulated passages in the cache
PROBE_CACHE_SPARE = 4  # cached passages with probes beyond the number of passages


class TrackPredictor:
    """The part of ``TrackCase`` that predicts recordings.

    ``nominal`` is the zone as filed, ``zone`` the same with the rail fitted to the hammer tests. ``frf_pairs`` of
    hammer tests and ``aligned_passages`` describe the measurements.
    """

    def _clear_caches(self):
        """Clear all caches of simulations."""
        self._signal_cache, self._probe_cache = OrderedDict(), OrderedDict()
        self._simulators, self._sensitivities, self._file_rail_zones = OrderedDict(), OrderedDict(), {}

    def track(self, route="main", terms=()):
        """Base track of a route, cut to the zone.

        Rail values that ``terms`` set themselves are as in the track file.
        """
        file_names = tuple(sorted({t.name for t in terms} & set(self.rail)))
        if file_names and file_names not in self._file_rail_zones:
            self._file_rail_zones[file_names] = with_rail(
                self.nominal, {n: 0.0 if n in file_names else v for n, v in self.rail.items()}
            )
        return (self._file_rail_zones[file_names] if file_names else self.zone).turnout.track_of(route)

    def predict(self, values, terms, observations):
        """Predictions of receptances and passages."""
        predictions, sensitivity_of = [], self.pair_sensitivities(values, terms)
        for o in observations:
            if o.name in self.frf_pairs:
                pair = self.frf_pairs[o.name]
                predictions.append(self._predict_receptance(values, terms, pair, sensitivity_of(pair)))
            else:
                predictions.append(self.predict_passage(values, terms, self.aligned_passages[o.name]))
        return predictions

    def predict_near(self, values, terms, new, observations, predictions):
        """Predictions a small step away: receptances follow without solving the track again."""
        return receptance_model.predict_near(self, values, terms, new, observations, predictions)

    def pair_sensitivities(self, values, terms):
        """Function that gives ``pair_sensitivity`` of a pair at these values, computed once per conditions."""
        sensitivities = {}

        def sensitivity_of(pair):
            conditions = tuple(sorted(pair.conditions.items()))
            if conditions not in sensitivities:
                sensitivities[conditions] = self.pair_sensitivity(values, terms, pair)
            return sensitivities[conditions]

        return sensitivity_of

    def pair_sensitivity(self, values, terms, pair):
        """``ReceptanceSensitivity`` of all pairs under the conditions of ``pair``, cached."""
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
            while len(self._sensitivities) > 8:
                self._sensitivities.popitem(last=False)
        return self._sensitivities[key]

    def _track_near(self, rail):
        """The main track with ``rail`` values on the grid of ``rail_on_grid``; cached."""
        key = tuple(rail.values())
        if key not in self._rail_tracks:
            if len(self._rail_tracks) > 8:
                self._rail_tracks.clear()
            self._rail_tracks[key] = with_rail(self.nominal, rail).turnout.track_of("main")
        return self._rail_tracks[key]

    def _pairs_and_seats(self, values, terms, conditions):
        """(position of the impact, ``FrfPair.seat``) of all pairs under these conditions; positions of these seats."""
        pairs = [p for p in self.frf_pairs.values() if p.conditions == conditions]
        sensors, track = {p.seat: p.sensor for p in pairs}, self.track()
        seats = {seat: self.seat(s, values, terms).probe(track).place for seat, s in sensors.items()}
        return tuple((p.test.place, p.seat) for p in pairs), seats

    def seat(self, sensor, values, terms):
        """The sensor at the position that ``values`` and ``terms`` give."""
        offset = values.get(f"seat_{sensor.name}", 0.0)
        return passage_model.place_sensor(replace(sensor, place=sensor.place + offset) if offset else sensor, terms)

    def channel_response(self, values, terms, pair):
        """(n_line,) complex factor of the channel of a pair."""
        factor = receptance_observation.channel_factor(terms, pair.sensor, receptance_observation.SHIFTED_LINES)
        return factor * (1.0 + values.get(f"gain_{pair.channel}", 0.0))

    def receptance(self, values, pair, sensitivity):
        """(n_line,) receptance of a pair [m/N], corrected to first order for the rail of ``values``."""
        deviation = [values[k] - at for k, at in rail_on_grid(values, self.rail).items()]
        return sensitivity.receptance(pair) + sensitivity.rail_gradient(pair) @ deviation

    def _predict_receptance(self, values, terms, pair, sensitivity):
        return receptance_observation.split_complex(
            receptance_observation.scale_lines(
                pair, self.receptance(values, pair, sensitivity), self.channel_response(values, terms, pair)
            )
        )

    def predict_passage(self, values, terms, aligned):
        """(n_sensor * n_time,) predicted signals of a passage, one sensor after the other."""
        signals = self.sensor_signals(values, terms, aligned)
        return np.concatenate(
            [self.channel_output(values, terms, aligned, s, row) for s, row in zip(aligned.sensors, signals)]
        )

    def channel_output(self, values, terms, aligned, sensor, signal):
        """Output of the channel of a sensor for the simulated signal ``signal``, at the times of the recording."""
        start = aligned.reference + values[f"time@{aligned.name}"] - passage_model.LEAD_TIME
        rate, time = 4.0 * self.solver.rate, aligned.time - start
        for term in terms:
            if term.effect_type == "channel":
                signal = term.under_conditions({"name": aligned.name, "start": start}).channel(signal, rate, sensor)
        return (1.0 + values[f"gain_{sensor.name}"]) * passage_band.read_at(
            aligned.limit_band(signal, rate), rate, time
        )

    def sensor_signals(self, values, terms, aligned):
        """Simulated signals of the sensors before their channels, at four times the rate of the simulation; cached."""
        passage_terms, key = self._terms_and_key(values, terms, aligned)
        if key not in self._signal_cache:
            self._simulate(values, terms, aligned, passage_terms, key)
        return passage_band.upsample(self._signal_cache[key])

    def signals_with_probes(self, values, terms, aligned):
        """Simulated signals of the sensors and of ``probes`` at the rate of the simulation; the latest are cached."""
        passage_terms, key = self._terms_and_key(values, terms, aligned)
        if key not in self._probe_cache:
            self._simulate(values, terms, aligned, passage_terms, key)
        return self._probe_cache[key]

    def _terms_and_key(self, values, terms, aligned):
        """(terms under the conditions of a passage, cache key of its simulation)."""
        passage_terms = tuple(
            t.under_conditions(self.conditions_of(aligned))
            for t in terms
            if t.effect_type != "channel" or _moves_sensor(t)
        )
        path = self.waves.path(values)
        shape, surfaces = path[0].dip.tobytes() if path else b"", self.surface.surfaces(aligned.passage.route, values)
        seats = tuple(values.get(f"seat_{s.name}", 0.0) for s in aligned.sensors)
        train_values = self._train_values(values, aligned)
        return passage_terms, (
            aligned.name,
            track_value_key(self.zone, values),
            train_values,
            seats,
            shape,
            surfaces,
            repr(passage_terms),
        )

    def _train_values(self, values, aligned):
        """Unsprung mass, speed and load of a passage."""
        train = aligned.passage.train or aligned.passage.name
        return values[f"wheels_{train}"], values[f"speed@{aligned.name}"], values[f"load@{aligned.name}"]

    def _simulate(self, values, terms, aligned, passage_terms, key):
        """Simulate a passage and cache it. Probe signals are large: their cache is small."""
        _, speed, load = self._train_values(values, aligned)
        vehicle = vehicle_with(aligned.passage.vehicle, values, aligned.passage.train or aligned.passage.name, load)
        simulator, path = self.passage_simulator(values, passage_terms, aligned.passage), self.waves.path(values)
        sensors = [replace(s, place=s.place + values.get(f"seat_{s.name}", 0.0)) for s in aligned.sensors]
        surfaces = tuple((*surface, *path) for surface in self.surface.surfaces(aligned.passage.route, values))
        probe_points = probes(self, values, terms, aligned)
        signals = simulator(
            aligned.passage, vehicle, aligned.speed * (1.0 + speed), sensors, probe_points, surfaces, aligned.sensors
        )
        self._signal_cache[key], self._probe_cache[key] = signals[: len(sensors)].copy(), signals
        for cache, size in (
            (self._signal_cache, PASSAGE_CACHE_SIZE),
            (self._probe_cache, len(self.aligned_passages) + PROBE_CACHE_SPARE),
        ):
            while len(cache) > size:
                cache.popitem(last=False)

    def conditions_of(self, aligned):
        """Conditions of a passage, as terms need them."""
        passage = aligned.passage
        loads = tuple(2.0 * load for load in passage.vehicle.static_loads)
        return {"axle_loads": loads, "train": passage.train or passage.name, "name": aligned.name, **passage.conditions}

    def passage_simulator(self, values, terms, passage):
        """``PassageSimulator`` of a passage's route with these terms, cached."""
        key = passage.route, track_value_key(self.zone, values), repr(terms)
        if key not in self._simulators:
            track = track_with(self.track(passage.route, terms), self.zone, values)
            self._simulators[key] = passage_model.PassageSimulator(self.zone.turnout, track, terms, self.solver)
            while len(self._simulators) > 12:
                self._simulators.popitem(last=False)
        return self._simulators[key]

    def numerical_error(self, fit):
        """Difference of each prediction to one with half the step and half the mesh; None without passages.

        It is 0 for hammer tests and where the finer simulation fails. The mesh stays where pads are spread over nodes.
        """
        if not self.aligned_passages:
            return None
        fine_solver = passage_model.Track1D(2.0 * self.solver.rate, self.solver.scheme, 2 * (self.solver.elements or 4))
        passages = [self.aligned_passages.get(o.name) for o in self.observations]
        refined = [
            aligned and self._predict_with(fit, aligned, fine_solver, p)
            for aligned, p in zip(passages, fit.predictions)
        ]
        return [np.zeros(p.size) if new is None else new - p for new, p in zip(refined, fit.predictions)]

    def _predict_with(self, fit, aligned, solver, predicted):
        saved = self.solver, self._signal_cache, self._probe_cache, self._simulators
        self.solver, self._signal_cache, self._probe_cache, self._simulators = (
            solver,
            OrderedDict(),
            OrderedDict(),
            OrderedDict(),
        )
        try:
            return self.predict_passage(fit.values, fit.terms, aligned)
        except SimulationError:
            return predicted
        finally:
            self.solver, self._signal_cache, self._probe_cache, self._simulators = saved


def _moves_sensor(term):
    """Whether a channel term changes the simulation itself, by the position of the sensor."""
    return type(term).sensor is not PhysicsTerm.sensor
