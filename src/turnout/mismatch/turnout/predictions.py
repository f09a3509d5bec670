"""What a case asks of the predictions of its recordings, and the types of their arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeAlias

import numpy as np

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.physics.term import PhysicsTerm

Values: TypeAlias = Mapping[str, float]  # nuisance parameters by name
Terms: TypeAlias = Sequence[PhysicsTerm]


class Predictions(Protocol):
    """What a case asks of a ``prediction.Predictor``, or of a cache around it."""

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Predictions of receptances and passages.

        Parameters
        ----------
        values : mapping of str to float
            All nuisance parameters of the site, by name.
        terms : sequence of PhysicsTerm
            Effects beside the base model.
        observations : sequence of Observation
            Receptances and passages to predict.

        Returns
        -------
        list of (n,) array
            One per observation, in its unit.

        Raises
        ------
        SimulationError
            If a passage cannot be simulated at these values.
        """

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Predictions a small step from known ones, for derivatives.

        Parameters
        ----------
        values : mapping of str to float
            All nuisance parameters of the site, by name.
        terms : sequence of PhysicsTerm
            Effects for which the predictions are known.
        new : sequence of PhysicsTerm
            The same effects with one parameter changed.
        observations : sequence of Observation
            Receptances and passages to predict.
        predictions : sequence of (n,) array
            Those with ``terms``, one per observation.

        Returns
        -------
        list of (n,) array
            Those with ``new``, one per observation.

        Raises
        ------
        SimulationError
            If a passage cannot be simulated at these values.
        """

    def nuisance_jacobian(
        self,
        nuisances: Sequence[Nuisance],
        values: Values,
        terms: Terms,
        observations: Sequence[Observation],
        base: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Derivatives of predictions by nuisance parameters.

        Parameters
        ----------
        nuisances : sequence of Nuisance
            One column each.
        values : mapping of str to float
            All nuisance parameters of the site, by name.
        terms : sequence of PhysicsTerm
            Effects beside the base model.
        observations : sequence of Observation
            Receptances and passages.
        base : sequence of (n,) array
            Predictions at these values, one per observation.

        Returns
        -------
        list of (n, n_nuisance) array
            One per observation, in its unit over that of the nuisance.

        Raises
        ------
        SimulationError
            If a passage cannot be simulated a step away.
        """
