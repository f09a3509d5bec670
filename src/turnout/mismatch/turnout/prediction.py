"""Predictions of the recordings of a track with caches: receptances of hammer tests and signals of passages."""

from collections import OrderedDict
from dataclasses import replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_band, passage_model, receptance_model, receptance_observation
from turnout.mismatch.turnout.pseudo_forces import probes
from turnout.mismatch.turnout.receptance_model import BlowModel
from turnout.mismatch.turnout.receptance_sensitivity import Heard
from turnout.mismatch.turnout.track_parameters import inner_values, near_rail, track_with, vehicle_with, with_rail
from turnout.physics.term import PhysicsTerm

KEPT = 150  # simulated passages in the cache
SPARE = 4  # cached passages with probes beyond the number of passages


class Predicting:
    """The part of ``TrackCase`` that predicts recordings.

    ``nominal`` is the zone as filed, ``zone`` the same with the rail fitted to the hammer tests. ``frf_pairs`` of
    hammer tests and ``aligned_passages`` describe the measurements.
    """

    def _forget(self):
        """Clear all caches of simulations."""
        self._simulated, self._whole = OrderedDict(), OrderedDict()
        self._rolls, self._models, self._filed = OrderedDict(), OrderedDict(), {}

    def track(self, route="main", terms=()):
        """Base track of a route, cut to the zone.

        Rail values that ``terms`` set themselves are as in the track file.
        """
        own = tuple(sorted({t.name for t in terms} & set(self.rail)))
        if own and own not in self._filed:
            self._filed[own] = with_rail(self.nominal, {n: 0.0 if n in own else v for n, v in self.rail.items()})
        return (self._filed[own] if own else self.zone).turnout.track_of(route)

    def predict(self, values, terms, observations):
        """Predictions of receptances and passages."""
        found, heard_by = [], self.blow_models(values, terms)
        for o in observations:
            if o.name in self.pairs:
                pair = self.pairs[o.name]
                found.append(self._receptance(values, terms, pair, heard_by(pair)))
            else:
                found.append(self.passage_of(values, terms, self.rollings[o.name]))
        return found

    def moved(self, values, terms, new, observations, predictions):
        """Predictions a small step away: receptances follow without solving the track again."""
        return receptance_model.moved(self, values, terms, new, observations, predictions)

    def blow_models(self, values, terms):
        """Function that gives ``pair_sensitivity`` of a pair at these values, computed once per conditions."""
        known = {}

        def of(pair):
            said = tuple(sorted(pair.conditions.items()))
            if said not in known:
                known[said] = self.blow_model(values, terms, pair)
            return known[said]

        return of

    def blow_model(self, values, terms, pair):
        """``ReceptanceSensitivity`` of all pairs under the conditions of ``pair``, cached."""
        under = receptance_observation.shown(terms, pair.conditions)
        near = near_rail(values, self.rail)
        heard, seats = self._touched(values, terms, pair.conditions)
        key = repr(under), tuple(near.values()), inner_values(self.zone, values), heard, tuple(seats.items())
        if key not in self._models:
            made = BlowModel(track_with(self._on_grid(near), self.zone, values), under)
            self._models[key] = Heard(made, heard, seats, self.zone)
            # all positions at once: rounding depends on what is solved together
            made.solve((*(place for place, _ in heard), *seats.values()))
            while len(self._models) > 8:
                self._models.popitem(last=False)
        return self._models[key]

    def _on_grid(self, near):
        """The main track with ``rail`` values on the grid of ``rail_on_grid``; cached."""
        key = tuple(near.values())
        if key not in self._railed:
            if len(self._railed) > 8:
                self._railed.clear()
            self._railed[key] = with_rail(self.nominal, near).turnout.track_of("main")
        return self._railed[key]

    def _touched(self, values, terms, conditions):
        """(position of the impact, ``FrfPair.seat``) of all pairs under these conditions; positions of these seats."""
        alike = [p for p in self.pairs.values() if p.conditions == conditions]
        sensors, track = {p.seat: p.sensor for p in alike}, self.track()
        seats = {seat: self.seat(s, values, terms).probe(track).place for seat, s in sensors.items()}
        return tuple((p.test.place, p.seat) for p in alike), seats

    def seat(self, sensor, values, terms):
        """The sensor at the position that ``values`` and ``terms`` give."""
        more = values.get(f"seat_{sensor.name}", 0.0)
        return passage_model.seat(replace(sensor, place=sensor.place + more) if more else sensor, terms)

    def chain(self, values, terms, pair):
        """(n_line,) complex factor of the channel of a pair."""
        factor = receptance_observation.channel_factor(terms, pair.sensor, receptance_observation.SHIFTED)
        return factor * (1.0 + values.get(f"gain_{pair.channel}", 0.0))

    def receptance(self, values, pair, heard):
        """(n_line,) receptance of a pair [m/N], corrected to first order for the rail of ``values``."""
        off = [values[k] - at for k, at in near_rail(values, self.rail).items()]
        return heard.receptance(pair) + heard.rail_gradient(pair) @ off

    def _receptance(self, values, terms, pair, heard):
        return receptance_observation.split(
            receptance_observation.scaled(pair, self.receptance(values, pair, heard), self.chain(values, terms, pair))
        )

    def passage_of(self, values, terms, made):
        """(n_sensor * n_time,) predicted signals of a passage, one sensor after the other."""
        clean = self.clean(values, terms, made)
        return np.concatenate([self.shown(values, terms, made, s, row) for s, row in zip(made.sensors, clean)])

    def shown(self, values, terms, made, sensor, row):
        """Output of the channel of a sensor for the simulated signal ``signal``, at the times of the recording."""
        start = made.reference + values[f"time@{made.name}"] - passage_model.LEAD
        rate, time = 4.0 * self.solver.rate, made.time - start
        for term in terms:
            if term.kind == "channel":
                row = term.under({"name": made.name, "start": start}).channel(row, rate, sensor)
        return (1.0 + values[f"gain_{sensor.name}"]) * passage_band.read_at(made.limited(row, rate), rate, time)

    def clean(self, values, terms, made):
        """Simulated signals of the sensors before their channels, at four times the rate of the simulation; cached."""
        under, key = self._asked(values, terms, made)
        if key not in self._simulated:
            self._march(values, terms, made, under, key)
        return passage_band.finer(self._simulated[key])

    def marched(self, values, terms, made):
        """Simulated signals of the sensors and of ``probes`` at the rate of the simulation; the latest are cached."""
        under, key = self._asked(values, terms, made)
        if key not in self._whole:
            self._march(values, terms, made, under, key)
        return self._whole[key]

    def _asked(self, values, terms, made):
        """(terms under the conditions of a passage, cache key of its simulation)."""
        under = tuple(t.under(self.said(made)) for t in terms if t.kind != "channel" or _moves(t))
        path = self.waves.path(values)
        shape, surfaces = path[0].dip.tobytes() if path else b"", self.surface.surfaces(made.passage.route, values)
        seats = tuple(values.get(f"seat_{s.name}", 0.0) for s in made.sensors)
        own = self._own(values, made)
        return under, (made.name, inner_values(self.zone, values), own, seats, shape, surfaces, repr(under))

    def _own(self, values, made):
        """Unsprung mass, speed and load of a passage."""
        train = made.passage.train or made.passage.name
        return values[f"wheels_{train}"], values[f"speed@{made.name}"], values[f"load@{made.name}"]

    def _march(self, values, terms, made, under, key):
        """Simulate a passage and cache it. Probe signals are large: their cache is small."""
        _, speed, load = self._own(values, made)
        vehicle = vehicle_with(made.passage.vehicle, values, made.passage.train or made.passage.name, load)
        roll, path = self.roll(values, under, made.passage), self.waves.path(values)
        sensors = [replace(s, place=s.place + values.get(f"seat_{s.name}", 0.0)) for s in made.sensors]
        rolled = tuple((*parts, *path) for parts in self.surface.surfaces(made.passage.route, values))
        also = probes(self, values, terms, made)
        signals = roll(made.passage, vehicle, made.speed * (1.0 + speed), sensors, also, rolled, made.sensors)
        self._simulated[key], self._whole[key] = signals[: len(sensors)].copy(), signals
        for held, most in ((self._simulated, KEPT), (self._whole, len(self.rollings) + SPARE)):
            while len(held) > most:
                held.popitem(last=False)

    def said(self, made):
        """Conditions of a passage, as terms need them."""
        passage = made.passage
        loads = tuple(2.0 * load for load in passage.vehicle.static_loads)
        return {"axle_loads": loads, "train": passage.train or passage.name, "name": made.name, **passage.conditions}

    def roll(self, values, terms, passage):
        """``PassageSimulator`` of a passage's route with these terms, cached."""
        key = passage.route, inner_values(self.zone, values), repr(terms)
        if key not in self._rolls:
            track = track_with(self.track(passage.route, terms), self.zone, values)
            self._rolls[key] = passage_model.Roll(self.zone.turnout, track, terms, self.solver)
            while len(self._rolls) > 12:
                self._rolls.popitem(last=False)
        return self._rolls[key]

    def numerical_error(self, fit):
        """Difference of each prediction to one with half the step and half the mesh; None without passages.

        It is 0 for hammer tests and where the finer simulation fails. The mesh stays where pads are spread over nodes.
        """
        if not self.rollings:
            return None
        finer = passage_model.Track1D(2.0 * self.solver.rate, self.solver.scheme, 2 * (self.solver.elements or 4))
        made = [self.rollings.get(o.name) for o in self.observations]
        refined = [m and self._refined(fit, m, finer, p) for m, p in zip(made, fit.predictions)]
        return [np.zeros(p.size) if new is None else new - p for new, p in zip(refined, fit.predictions)]

    def _refined(self, fit, made, finer, predicted):
        kept = self.solver, self._simulated, self._whole, self._rolls
        self.solver, self._simulated, self._whole, self._rolls = finer, OrderedDict(), OrderedDict(), OrderedDict()
        try:
            return self.passage_of(fit.values, fit.terms, made)
        except SimulationError:
            return predicted
        finally:
            self.solver, self._simulated, self._whole, self._rolls = kept


def _moves(term):
    """Whether a channel term changes the simulation itself, by the position of the sensor."""
    return type(term).sensor is not PhysicsTerm.sensor
