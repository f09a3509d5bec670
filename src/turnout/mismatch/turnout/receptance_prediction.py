"""Predictions of receptances of hammer tests, with the derivatives of all pairs under the same conditions."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence

import numpy as np

from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.bilinear_supports import bilinear_changes, bilinear_terms
from turnout.mismatch.turnout.lifting_chairs import LiftingChairs
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.predictions import Terms, Values
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.rail_parameters import rail_on_grid, with_rail
from turnout.mismatch.turnout.receptance_model import ReceptanceModel
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.receptance_samples import PairSamples
from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
from turnout.mismatch.turnout.site import Site
from turnout.mismatch.turnout.site_model import SiteModel, drop_oldest
from turnout.mismatch.turnout.toe_position import TOE, with_toe
from turnout.mismatch.turnout.track_parameters import track_value_key, track_with
from turnout.simulate.track import Track


class ReceptancePredictor(SiteModel):
    """Predicts the receptances of a site; ``lifting`` are chairs that open under impacts, None without a blade."""

    def __init__(self, site: Site, solver: Track1D, rail: Values | None = None):
        super().__init__(site, solver, rail)
        self._rail_tracks: OrderedDict[Hashable, Track] = OrderedDict()
        self._sensitivities: OrderedDict[Hashable, ReceptanceSensitivity] = OrderedDict()
        self.lifting: LiftingChairs | None = None

    def pair_sensitivities(self, values: Values, terms: Terms) -> Callable[[FrfPair], ReceptanceSensitivity]:
        """Function that gives ``pair_sensitivity`` of a pair at these values, sought once per conditions.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.

        Returns
        -------
        Callable[[FrfPair], ReceptanceSensitivity]
        """
        by_conditions: dict[Hashable, ReceptanceSensitivity] = {}
        by_terms: dict[str, ReceptanceSensitivity] = {}

        def sensitivity_of(pair: FrfPair) -> ReceptanceSensitivity:
            if pair.conditions_key not in by_conditions:
                acting = repr(receptance_observation.track_terms(terms, pair.conditions))
                if acting not in by_terms:
                    by_terms[acting] = self.pair_sensitivity(values, terms, pair)
                by_conditions[pair.conditions_key] = by_terms[acting]
            return by_conditions[pair.conditions_key]

        return sensitivity_of

    def pair_samples(
        self, values: Values, terms: Terms, observations: Sequence[Observation], new: Terms = ()
    ) -> list[tuple[list[int], PairSamples]]:
        """Receptances among the observations, those on the same track together.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        observations : sequence of Observation
            Others than receptances are left out.
        new : Terms
            Terms that must act alike on what is taken together as well.

        Returns
        -------
        list of (list of int, PairSamples)
            Numbers of the observations, and their samples.
        """
        sensitivity_of, acting = self.pair_sensitivities(values, terms), dict[Hashable, str]()
        groups: dict[Hashable, list[tuple[int, FrfPair]]] = {}
        for k, o in enumerate(observations):
            pair = self.frf_pairs.get(o.name)
            if pair is None:
                continue
            if pair.conditions_key not in acting:
                acting[pair.conditions_key] = repr(receptance_observation.track_terms(new, pair.conditions))
            key = id(sensitivity_of(pair)), acting[pair.conditions_key]
            groups.setdefault(key, []).append((k, pair))
        samples = []
        for group in groups.values():
            numbers, pairs = zip(*group)
            samples.append((list(numbers), PairSamples(pairs, sensitivity_of(pairs[0]))))
        return samples

    def pair_sensitivity(self, values: Values, terms: Terms, pair: FrfPair) -> ReceptanceSensitivity:
        """``ReceptanceSensitivity`` of all pairs that have the same track as ``pair``, cached.

        Most effects do not depend on conditions, so that the tests of several days share one solution.

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
        """
        track_terms = receptance_observation.track_terms(terms, pair.conditions)
        rail = rail_on_grid(values, self.rail)
        pair_keys, seats = self._pairs_and_seats(values, terms, repr(track_terms))
        key = (
            repr(track_terms),
            tuple(rail.values()),
            track_value_key(self.zone, values),
            values.get(TOE, 0.0),
            pair_keys,
            tuple(seats.items()),
        )
        if key not in self._sensitivities:
            track = with_toe(track_with(self._track_near(rail), self.zone, values), values)
            model = ReceptanceModel(track, track_terms)
            self._sensitivities[key] = ReceptanceSensitivity(model, pair_keys, seats, self.zone)
            # all positions at once: rounding depends on what is solved together
            model.solve((*(position for position, _ in pair_keys), *seats.values()))
            drop_oldest(self._sensitivities, SIMULATION.sensitivity_cache_size)
        return self._sensitivities[key]

    def _track_near(self, rail: Values) -> Track:
        """The main track with ``rail`` values on the grid of ``rail_on_grid``; cached."""
        key = tuple(rail.values())
        if key not in self._rail_tracks:
            self._rail_tracks[key] = with_rail(self.site.nominal, rail).turnout.track_of("main")
            drop_oldest(self._rail_tracks, SIMULATION.rail_cache_size)
        return self._rail_tracks[key]

    def _pairs_and_seats(self, values: Values, terms: Terms, track_terms: str) -> tuple[tuple, dict]:
        """(position of the impact, ``FrfPair.seat``) of all pairs with these terms on the track; positions of seats."""
        is_alike: dict[Hashable, bool] = {}
        pairs = []
        for p in self.frf_pairs.values():
            if p.conditions_key not in is_alike:
                acting = receptance_observation.track_terms(terms, p.conditions)
                is_alike[p.conditions_key] = repr(acting) == track_terms
            if is_alike[p.conditions_key]:
                pairs.append(p)
        sensors, track = {p.seat: p.sensor for p in pairs}, self.track()
        seats = {seat: self.seat(s, values, terms).probe(track).place for seat, s in sensors.items()}
        return tuple(dict.fromkeys((p.test.place, p.seat) for p in pairs)), seats

    def channel_response(self, values: Values, terms: Terms, pair: FrfPair) -> np.ndarray:
        """Factor of the channel of a pair.

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
        (n_line,) array of complex
            Recorded over true response. [-]
        """
        factor = receptance_observation.channel_factor(
            terms, pair.sensor, receptance_observation.SHIFTED_LINES, "hammer"
        )
        return factor * (1.0 + values.get(f"gain_{pair.channel}", 0.0))

    def receptance(self, values: Values, pair: FrfPair, sensitivity: ReceptanceSensitivity) -> np.ndarray:
        """Receptance of a pair, corrected to first order for the rail of ``values``.

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
        (n_line,) array of complex
            Receptance. [m/N]
        """
        deviation = [values[k] - at for k, at in rail_on_grid(values, self.rail).items()]
        return sensitivity.receptance(pair) + sensitivity.rail_gradient(pair) @ deviation

    def predict_receptances(self, values: Values, terms: Terms, samples: PairSamples) -> list[np.ndarray]:
        """Re and Im of the receptance of each pair over its measured magnitude.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.
        terms : Terms
            Physics terms of the effects.
        samples : PairSamples
            The pairs.

        Returns
        -------
        list of (2n,) array of float
        """
        sensitivity = samples.sensitivity
        deviation = [values[k] - at for k, at in rail_on_grid(values, self.rail).items()]
        h = samples.at(sensitivity.receptances + sensitivity.rail_gradients @ deviation)
        model = sensitivity.model
        if bilinear_terms(model.terms, model.track):
            probes = [self.seat(pair.sensor, values, terms).probe(model.track) for pair in samples.pairs]
            changes = bilinear_changes(model, samples.pairs, probes)
            h = h + np.concatenate([change[pair.lines] for pair, change in zip(samples.pairs, changes)])
        if self.lifting is not None:
            h = h + np.concatenate([self.lifting.change(pair, terms)[pair.lines] for pair in samples.pairs])
        return samples.to_observations(
            h * samples.channel_factors(lambda pair: self.channel_response(values, terms, pair))
        )
