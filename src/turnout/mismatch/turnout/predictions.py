"""What a case asks of the predictions of its recordings, and the types of their arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeAlias

import numpy as np

from turnout.mismatch.engine.case import Nuisance, Observation
from turnout.physics.term import PhysicsTerm

Values: TypeAlias = Mapping[str, float]  # nuisance parameters by name
Terms: TypeAlias = Sequence[PhysicsTerm]


class Predictions(Protocol):
    """What a case asks of a ``prediction.Predictor``, or of a cache around it."""

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
