"""Predictions of the recordings of a turnout: receptances of hammer tests and signals of passages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import TypeAlias

import numpy as np

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import receptance_changes, sensitivity
from turnout.mismatch.turnout.lifting_chairs import LiftingChairs
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.passage_prediction import PassagePredictor
from turnout.mismatch.turnout.predictions import Predictions, Terms, Values
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.receptance_prediction import ReceptancePredictor


class Predictor(ReceptancePredictor, PassagePredictor, Predictions):
    """Predicts receptances and passages of one site, for any values of its nuisances and any terms.

    A predictor never changes but for its caches: another rail or another solver makes another predictor.
    """

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
        """
        changed = copy(self)
        changed.frf_pairs, changed.aligned_passages = dict(frf_pairs), dict(aligned_passages)
        return changed

    def with_lifting(self, lifting: LiftingChairs) -> Predictor:
        """The predictor of impacts that open the chairs of a blade.

        Parameters
        ----------
        lifting : LiftingChairs
            Changes of receptances by them.

        Returns
        -------
        Predictor
            It shares its caches with this one.
        """
        changed = copy(self)
        changed.lifting = lifting
        return changed

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
        """
        changed = Predictor(self.site, self.solver, values)
        changed.frf_pairs, changed.aligned_passages = self.frf_pairs, self.aligned_passages
        changed.lifting = self.lifting
        changed._rail_tracks = self._rail_tracks
        return changed

    def with_solver(self, solver: Track1D) -> Predictor:
        """The predictor with another simulation of passages, with empty caches.

        Parameters
        ----------
        solver : Track1D
            Simulation of passages.

        Returns
        -------
        Predictor
        """
        changed = Predictor(self.site, solver, self.rail)
        changed.frf_pairs, changed.aligned_passages = self.frf_pairs, self.aligned_passages
        changed.lifting = self.lifting
        return changed

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Predictions of receptances and passages."""
        predicted: dict[int, np.ndarray] = {}
        for numbers, samples in self.pair_samples(values, terms, observations):
            predicted |= zip(numbers, self.predict_receptances(values, terms, samples))
        for k, o in enumerate(observations):
            if k not in predicted:
                predicted[k] = self.predict_passage(values, terms, self.aligned_passages[o.name])
        return [predicted[k] for k in range(len(observations))]

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Predictions a small step away: receptances follow without solving the track again."""
        return receptance_changes.predict_near(self, values, terms, new, observations, predictions)

    def nuisance_jacobian(
        self,
        nuisances: Sequence[Nuisance],
        values: Values,
        terms: Terms,
        observations: Sequence[Observation],
        base: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Derivatives, see ``sensitivity.nuisance_jacobian``."""
        return sensitivity.nuisance_jacobian(self, nuisances, values, terms, observations, base)


# (predictor, whether it predicts hammer tests alone) -> a cache around the predictor, or the predictor itself
PredictionCache: TypeAlias = Callable[[Predictor, bool], Predictions]


def no_cache(predictor: Predictor, is_hammer_only: bool) -> Predictions:
    """The predictor itself.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    is_hammer_only : bool
        Whether it predicts hammer tests alone, which takes no simulation.

    Returns
    -------
    Predictions
        The predictor.
    """
    return predictor
