"""A case whose predictions come from a ``Predictor`` and contain the accepted effects of the track."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import TypeVar

import numpy as np

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.accepted_effects import NO_EFFECTS, AcceptedEffects
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Predictions, Terms, Values
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.screening import screen_columns

Self = TypeVar("Self", bound="PredictedCase")


class PredictedCase(Case):
    """Observations with the predictions of a ``Predictor``; every prediction contains the accepted effects.

    Parameters
    ----------
    predictor : Predictor
        Predicts all observations, and whatever else of the site a search asks for.
    observations : sequence of Observation
        Those that are fitted.
    nuisances : sequence of Nuisance
        Those of the site. The nuisances of the accepted effects follow them.
    candidates : sequence of Candidate
        Effects that a diagnosis tests; those that are accepted already are left out.
    accepted : AcceptedEffects
    predictions : Predictions or None
        A cache around the predictor, which fits use; None: the predictor itself.
    """

    def __init__(
        self,
        predictor: Predictor,
        observations: Sequence[Observation],
        nuisances: Sequence[Nuisance],
        candidates: Sequence[Candidate] = (),
        accepted: AcceptedEffects = NO_EFFECTS,
        predictions: Predictions | None = None,
    ):
        self.predictor, self.accepted = predictor, accepted
        self.predictions: Predictions = predictions or predictor
        self.observations = tuple(observations)
        self._site_nuisances, self.all_candidates = tuple(nuisances), tuple(candidates)
        self.nuisances = (*self._site_nuisances, *accepted.nuisances)
        self.candidates = accepted.without(self.all_candidates)

    @property
    def frf_pairs(self) -> Mapping[str, FrfPair]:
        """Response channels of hammer tests, by name."""
        return self.predictor.frf_pairs

    @property
    def aligned_passages(self) -> Mapping[str, AlignedPassage]:
        """Passages aligned with their simulation, by name."""
        return self.predictor.aligned_passages

    def all_terms(self, fit: Fit) -> tuple:
        """Terms of the accepted effects and of the candidates in a fit.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        tuple
        """
        return (*self.accepted.terms(fit.values), *fit.terms)

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Predictions with the accepted effects."""
        return self.predictions.predict(values, (*self.accepted.terms(values), *terms), observations)

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Predictions with the accepted effects: receptances follow without solving the track again."""
        accepted = self.accepted.terms(values)
        return self.predictions.predict_near(values, (*accepted, *terms), (*accepted, *new), observations, predictions)

    def nuisance_jacobian(
        self, values: Values, terms: Terms, observations: Sequence[Observation], base: Sequence[np.ndarray]
    ) -> list[np.ndarray]:
        """Derivatives by all nuisances; those by parameters of accepted effects are difference quotients."""
        all_terms = (*self.accepted.terms(values), *terms)
        jacobians = self.predictions.nuisance_jacobian(self._site_nuisances, values, all_terms, observations, base)
        columns = self.accepted.difference_columns(lambda at: self.predict(at, terms, observations), values, base)
        if not columns:
            return jacobians
        return [np.column_stack([j, *(c[k] for c in columns)]) for k, j in enumerate(jacobians)]

    def with_fixed_effects(self: Self, fit: Fit) -> tuple[Self, Fit]:
        """The case with its accepted effects fixed as ``fit`` has them, and the fit without their columns.

        Searches use it: accepted effects are part of the base model then, and no candidate is left out.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        tuple[Self, Fit]
        """
        n, n_accepted = len(self._site_nuisances), len(self.accepted.nuisances)
        fixed = copy(self)
        fixed.predictions = self.predictor
        if not n_accepted:
            return fixed, fit
        fixed.nuisances, fixed.candidates = self._site_nuisances, self.all_candidates
        fixed.accepted = self.accepted.fixed_at(fit.values)
        return fixed, replace(fit, jacobian=[np.delete(j, slice(n, n + n_accepted), axis=1) for j in fit.jacobian])

    def screen(self, fit: Fit) -> dict:
        """Columns of all candidates that have one, (key, start) -> list of (n,) per observation.

        Parameters
        ----------
        fit : Fit
            A fit of the case.

        Returns
        -------
        dict
        """
        return screen_columns(*self.with_fixed_effects(fit), self.observations)
