"""Hammer tests and passages of one turnout as a case for the engine."""

from collections import OrderedDict

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.case import Case, Nuisance
from turnout.mismatch.track import blows, rolling
from turnout.mismatch.track.base_model import COMMON, OWN, track_nuisances, track_with, vehicle_with, zone_of
from turnout.mismatch.track.columns import columns_of, green, support_forces
from turnout.mismatch.track.library import library
from turnout.mismatch.track.rough_rail import Waves, wave_columns
from turnout.simulate.run import Probe

KEPT = 150  # simulated passages remembered
GAIN_SD = 0.02


class TrackCase(Case):
    """``Case`` of a ``Campaign``; ``families`` restricts the candidates, ``solver`` the simulation used in fits."""

    frozen_jacobian = True

    def __init__(self, campaign, settings=None, families=None, solver=None):
        self._prepare(campaign, settings or MismatchSettings(), solver or rolling.Track1D())
        found = [*self._hammer(), *self._passages()]
        if not found:
            raise SimulationError("nothing to diagnose: " + "; ".join(self.notes))
        reserved = set(campaign.reserved)
        self.observations = tuple(o for name, o in found if name not in reserved)
        self.reserved = tuple(o for name, o in found if name in reserved)
        if not self.observations:
            raise SimulationError("every recording is reserved for the verification: nothing is left to fit.")
        self.nuisances = tuple(self._nuisances())
        self.candidates = library(self, families)

    def _prepare(self, campaign, settings, solver):
        """What does not depend on recordings."""
        self.settings, self.solver, self.campaign = settings, solver, campaign
        self.zone = zone_of(campaign.turnout, campaign.places())
        self._simulated, self._rolls = OrderedDict(), OrderedDict()
        self.trains = tuple(dict.fromkeys(p.train or p.name for p in campaign.passages))
        self.pairs, self.rollings, self.notes = {}, {}, []
        self.waves = self._waves()

    def peak(self, channel):
        """Largest value a channel showed in the passages, 0 where it showed none. [m/s²]"""
        found = [0.0]
        for o in self.observations:
            made = self.rollings.get(o.name)
            names = [s.name for s in made.sensors] if made else []
            if channel in names:
                found.append(float(np.max(np.abs(o.data.reshape(len(names), -1)[names.index(channel)]))))
        return max(found)

    def _waves(self):
        if not self.campaign.passages:
            return None
        offset = self.campaign.turnout.roughness_level
        return Waves([s.place for s in self.campaign.sensors], 0.0 if offset is None else offset)

    def _hammer(self):
        for test in self.campaign.hammer:
            sensors = [*self.campaign.sensors, *_loose(test, self.campaign.sensors)]
            pairs = blows.pairs_of(test, sensors, self.settings.pair_tolerance)
            if not pairs:
                self.notes.append(f"hammer test {test.name}: no channel with {blows.FEWEST} sound blows")
            for pair, observation in pairs:
                self.pairs[pair.name] = pair
                yield test.name, observation

    def _passages(self):
        if not self.campaign.passages:
            return
        values = {n.name: 0.0 for n in (*track_nuisances(self.zone, self.trains), *self.waves.nuisances())}
        for passage in self.campaign.passages:
            sensors = [s for s in self.campaign.sensors if s.name in {c.name for c in passage.recording.channels}]
            if not sensors:
                self.notes.append(f"passage {passage.name}: none of the sensors recorded it")
                continue
            signals = self._roll(values, (), passage)(passage, passage.vehicle, passage.speed, sensors)
            reference, speed, likeness = rolling.align(passage, sensors, signals, self.solver.rate)
            if likeness < 0.3:
                self.notes.append(
                    f"passage {passage.name}: likeness {likeness:.2f} with the simulation of "
                    f"{passage.train or 'its train'}; wrong vehicle file, wrong sensor places or another turnout"
                )
                continue
            made, observation = rolling.rolling_of(passage, sensors, reference, speed, self.settings.materiality)
            self.rollings[passage.name] = made
            yield passage.name, observation

    def _nuisances(self):
        yield from track_nuisances(self.zone, self.trains)
        for sensor in self.campaign.sensors:
            yield Nuisance(f"gain_{sensor.name}", "-", 0.0, GAIN_SD, meaning="gain of a sensor less one")
        if self.rollings:
            yield from self.waves.nuisances()
        for pair in self.pairs.values():
            yield from blows.pair_nuisances(pair, self.settings.pair_tolerance)
        for made in self.rollings.values():
            yield from rolling.rolling_nuisances(made.passage)

    def track(self, route="main"):
        """The kept part of the base track under a route."""
        return self.zone.turnout.track_of(route)

    def predict(self, values, terms, observations):
        """Prediction of receptances and passages."""
        models, found = {}, []
        for o in observations:
            if o.name in self.pairs:
                found.append(self._receptance(values, terms, self.pairs[o.name], models))
            else:
                found.append(self._passage(values, terms, self.rollings[o.name]))
        return found

    def _blow_model(self, values, terms, pair, models):
        under = tuple(t.under(pair.conditions) for t in terms if t.kind in ("matrix", "port"))
        key = repr(under), pair.frequency.tobytes()
        if key not in models:
            models[key] = blows.BlowModel(track_with(self.track(), self.zone, values), under, pair.frequency)
        return models[key]

    def _receptance(self, values, terms, pair, models):
        model = self._blow_model(values, terms, pair, models)
        sensor = rolling.seat(pair.sensor, terms)
        h = model.receptance(pair.test.place, model.place_of(sensor))
        h = h * blows.channel_factor(terms, pair.sensor, pair.frequency)
        h = h * (1.0 + values.get(f"gain_{pair.channel}", 0.0))
        return blows.split(blows.pair_chain(pair, values, h))

    def _passage(self, values, terms, made):
        clean = self._clean(values, terms, made)
        rate, time = 4.0 * self.solver.rate, made.time - made.reference - values[f"time@{made.name}"] + rolling.LEAD
        shown = []
        for sensor, row in zip(made.sensors, clean):
            for term in terms:
                if term.kind == "channel":
                    row = term.under({"name": made.name}).channel(row, rate, sensor)
            row = made.limited(row, rate)
            shown.append((1.0 + values[f"gain_{sensor.name}"]) * rolling.read_at(row, rate, time))
        return np.concatenate(shown)

    def _clean(self, values, terms, made, probes=()):
        """Simulated signals before the channels, four times as fine as the march, remembered."""
        under = tuple(t.under(self._said(made)) for t in terms if t.kind != "channel" or _moves(t))
        inner = [values[n] for n, *_ in COMMON] + [values[f"{t}_{j}"] for _, t, _ in OWN for j in self.zone.supports]
        train = made.passage.train or made.passage.name
        own = values[f"wheels_{train}"], values[f"speed@{made.name}"], values[f"load@{made.name}"]
        path = self.waves.path(values)
        shape = path[0].dip.tobytes() if path else b""
        key = made.name, np.array([*inner, *own]).tobytes(), shape, repr(under), len(probes)
        if key not in self._simulated:
            vehicle = vehicle_with(made.passage.vehicle, values, train, own[2])
            roll = self._roll(values, under, made.passage)
            signals = roll(made.passage, vehicle, made.speed * (1.0 + own[1]), made.sensors, probes, path)
            self._simulated[key] = signals
            while len(self._simulated) > KEPT:
                self._simulated.popitem(last=False)
        return rolling.finer(self._simulated[key])

    def _said(self, made):
        passage = made.passage
        loads = tuple(2.0 * load for load in passage.vehicle.static_loads)
        return {"axle_loads": loads, "train": passage.train or passage.name, "name": made.name, **passage.conditions}

    def _roll(self, values, terms, passage):
        inner = [values[n] for n, *_ in COMMON] + [values[f"{t}_{j}"] for _, t, _ in OWN for j in self.zone.supports]
        key = passage.route, np.array(inner).tobytes(), repr(terms)
        if key not in self._rolls:
            track = track_with(self.track(passage.route), self.zone, values)
            self._rolls[key] = rolling.Roll(self.zone.turnout, track, terms, self.solver)
            while len(self._rolls) > 12:
                self._rolls.popitem(last=False)
        return self._rolls[key]

    def nuisance_jacobian(self, values, terms, observations, base):
        """Exact for receptances, gains, times; common values of passages by differences, supports' by pseudo-forces."""
        index, models = {n.name: k for k, n in enumerate(self.nuisances)}, {}
        found = [np.zeros((o.data.size, len(self.nuisances))) for o in observations]
        passages = [(o, p, j) for o, p, j in zip(observations, base, found) if o.name in self.rollings]
        for o, predicted, jacobian in zip(observations, base, found):
            if o.name in self.pairs:
                for name, column in self._pair_columns(values, terms, self.pairs[o.name], predicted, models):
                    jacobian[:, index[name]] = column
        if passages:
            self._common_columns(values, terms, passages, index)
        for o, predicted, jacobian in passages:
            made = self.rollings[o.name]
            for name, column in self._passage_columns(values, terms, made, predicted):
                jacobian[:, index[name]] = column
            first = index[self.waves.names[0]]
            jacobian[:, first : first + len(self.waves.names)] = wave_columns(self, values, made)
        return found

    def _pair_columns(self, values, terms, pair, predicted, models):
        model = self._blow_model(values, terms, pair, models)
        place = model.place_of(rolling.seat(pair.sensor, terms))
        chain = blows.pair_chain(pair, values, np.ones(pair.frequency.size, dtype=complex))
        chain = chain * blows.channel_factor(terms, pair.sensor, pair.frequency)
        chain = chain * (1.0 + values.get(f"gain_{pair.channel}", 0.0))
        for name, column in model.gradient(pair.test.place, place, self.zone).items():
            yield name, blows.split(column * chain)
        yield from blows.pair_columns(pair, values, predicted).items()
        if f"gain_{pair.channel}" in values:
            yield f"gain_{pair.channel}", predicted / (1.0 + values[f"gain_{pair.channel}"])

    def _common_columns(self, values, terms, passages, index):
        names = [name for name, *_ in COMMON] + [f"wheels_{train}" for train in self.trains]
        for name in names:
            step = 0.04
            moved = {**values, name: values[name] + step}
            for o, predicted, jacobian in passages:
                made = self.rollings[o.name]
                if name.startswith("wheels_") and name != f"wheels_{made.passage.train or made.passage.name}":
                    continue
                jacobian[:, index[name]] = (self._passage(moved, terms, made) - predicted) / step

    def _passage_columns(self, values, terms, made, predicted):
        n = made.time.size
        rows = predicted.reshape(-1, n)
        moment = f"time@{made.name}"
        later = self._passage({**values, moment: values[moment] + 1e-5}, terms, made)  # nothing is simulated again
        slope = -(later - predicted).reshape(-1, n) / 1e-5
        lag = made.time - made.reference
        yield f"time@{made.name}", -slope.ravel()
        yield f"speed@{made.name}", (slope * lag).ravel()
        load = f"load@{made.name}"
        yield load, (self._passage({**values, load: values[load] + 0.03}, terms, made) - predicted) / 0.03
        for k, sensor in enumerate(made.sensors):
            column = np.zeros_like(rows)
            column[k] = rows[k] / (1.0 + values[f"gain_{sensor.name}"])
            yield f"gain_{sensor.name}", column.ravel()
        if not self.pairs:  # blows, where there are some, tell a support's own values far better
            histories = support_forces(self, values, terms, made)
            yield from columns_of(self, values, terms, made, histories).items()

    def probes(self):
        """Displacements of rail and sleeper at every support of the zone: what pseudo-forces are made of."""
        return [Probe((kind, j), 0) for j in self.zone.supports for kind in ("rail", "sleeper")]

    def screen(self, fit):
        """Linear columns of the candidates that have one."""
        from turnout.mismatch.track.screening import screen_columns

        return screen_columns(self, fit)

    def latent(self, fit):
        """Missing force at the support that explains most of the residual."""
        from turnout.mismatch.track.latent_force import latent_force

        return latent_force(self, fit)

    def numerical_error(self, fit):
        """Difference to half the step and half the mesh, where passages are there."""
        if not self.rollings:
            return None
        finer = rolling.Track1D(2.0 * self.solver.rate, self.solver.scheme, 2 * (self.solver.elements or 4))
        error = []
        for o, predicted in zip(self.observations, fit.predictions):
            made = self.rollings.get(o.name)
            error.append(np.zeros(o.data.size) if made is None else self._refined(fit, made, finer) - predicted)
        return error

    def _refined(self, fit, made, finer):
        kept = self.solver, self._simulated, self._rolls
        self.solver, self._simulated, self._rolls = finer, OrderedDict(), OrderedDict()
        try:
            return self._passage(fit.values, fit.terms, made)
        finally:
            self.solver, self._simulated, self._rolls = kept

    def green(self, values, terms, made):
        """Free track's response of the passage's sensors to forces at the zone's rail seats and sleepers."""
        return green(self, values, terms, made)


def _moves(term):
    """A channel term that changes what is simulated: the sensor's seat."""
    from turnout.physics.term import PhysicsTerm

    return type(term).sensor is not PhysicsTerm.sensor


def _loose(test, sensors):
    """Accelerometers of a hammer test that are no installed sensors."""
    from turnout.simulate.sensor import Sensor

    known, found = {s.name for s in sensors}, {}
    for recording in test.recordings[:1]:
        for channel in recording.channels:
            if channel.quantity == "acceleration" and channel.name not in known and channel.position is not None:
                found[channel.name] = Sensor(channel.name, channel.position, channel.mounting)
    return found.values()
