"""Time limit, progress and replay of a diagnosis: a cache around the predictor of its case."""

from __future__ import annotations

import time
from collections.abc import Callable, MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnout.errors import TurnoutError
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.predictions import Predictions, Terms, Values


class BudgetSpentError(TurnoutError):
    """The time of a diagnosis is spent; ``rows`` are those of the ``n_done`` finished groups, by table."""

    def __init__(self, n_done: int = 0, n_groups: int = 1, rows: dict[str, list[dict[str, Any]]] | None = None) -> None:
        super().__init__(f"the budget is used up, {n_done} of {n_groups} groups done; the same command continues.")
        self.n_done, self.rows = n_done, rows or {}


@dataclass
class Watch:
    """Time limit and progress: ``deadline`` on the monotonic clock [s] or None, ``count`` of predictions so far.

    ``tell`` is called with that count. ``n_limited`` of them were subject to the deadline.
    """

    deadline: float | None = None
    tell: Callable[[int], object] | None = None
    count: int = 0
    n_limited: int = 0

    def tick(self) -> None:
        """Count one prediction."""
        self.count += 1
        if self.tell is not None:
            self.tell(self.count)

    def tick_limited(self) -> None:
        """Count one prediction; BudgetSpentError after the deadline.

        The first prediction never raises, so every run makes progress.
        """
        self.tick()
        self.n_limited += 1
        if self.deadline is not None and self.n_limited > 1 and time.monotonic() > self.deadline:
            raise BudgetSpentError


@dataclass
class Budget:
    """Cache of a ``TrackCase``: predictions count on ``watch``, and those of passages are stored in ``replay``.

    ``replay`` is a mapping or None. An interrupted diagnosis repeats the same requests, so that it continues within a
    fit.
    """

    watch: Watch
    replay: MutableMapping[str, list[np.ndarray]] | None = None

    def __call__(self, predictor: Predictor, is_hammer_only: bool) -> Predictions:
        """The cache around a predictor."""
        return CountedPredictions(predictor, self.watch) if is_hammer_only else ReplayedPredictions(predictor, self)


@dataclass(frozen=True)
class CountedPredictions(Predictions):
    """Predictions of a ``predictor`` that count on ``watch``."""

    predictor: Predictor
    watch: Watch

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Those of the predictor, counted."""
        self.watch.tick()
        return self.predictor.predict(values, terms, observations)

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Those of the predictor, counted."""
        self.watch.tick()
        return self.predictor.predict_near(values, terms, new, observations, predictions)

    def nuisance_jacobian(
        self,
        nuisances: Sequence[Nuisance],
        values: Values,
        terms: Terms,
        observations: Sequence[Observation],
        base: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Those of the predictor, counted."""
        self.watch.tick()
        return self.predictor.nuisance_jacobian(nuisances, values, terms, observations, base)


class ReplayedPredictions(Predictions):
    """Predictions of a ``predictor`` within a ``Budget``: computed once, then replayed.

    They raise BudgetSpentError if the time is spent and they are not stored.
    """

    def __init__(self, predictor: Predictor, budget: Budget) -> None:
        self.predictor, self.budget = predictor, budget
        self._rail = repr(sorted(predictor.rail.items()))  # passages depend on it

    def predict(self, values: Values, terms: Terms, observations: Sequence[Observation]) -> list[np.ndarray]:
        """Those of the predictor, or as they were stored."""
        key = self._key("p", values, terms, observations)
        return self._compute_once(key, lambda: self.predictor.predict(values, terms, observations))

    def predict_near(
        self,
        values: Values,
        terms: Terms,
        new: Terms,
        observations: Sequence[Observation],
        predictions: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Those of the predictor, or as they were stored."""
        key = self._key(f"m:{new!r}", values, terms, observations)
        return self._compute_once(
            key, lambda: self.predictor.predict_near(values, terms, new, observations, predictions)
        )

    def nuisance_jacobian(
        self,
        nuisances: Sequence[Nuisance],
        values: Values,
        terms: Terms,
        observations: Sequence[Observation],
        base: Sequence[np.ndarray],
    ) -> list[np.ndarray]:
        """Those of the predictor, or as they were stored."""
        key = self._key("j", values, terms, observations)
        return self._compute_once(
            key, lambda: self.predictor.nuisance_jacobian(nuisances, values, terms, observations, base)
        )

    def _key(self, quantity: str, values: Values, terms: Terms, observations: Sequence[Observation]) -> str:
        names = [o.name for o in observations]
        return f"{quantity}:{self._rail}:{sorted(values.items())!r}:{tuple(terms)!r}:{names!r}"

    def _compute_once(self, key: str, compute: Callable[[], list[np.ndarray]]) -> list[np.ndarray]:
        """Result from the replay, computed if it is not there."""
        replay, watch = self.budget.replay, self.budget.watch
        if replay is None:
            watch.tick_limited()
            return compute()
        try:
            return replay[key]
        except KeyError:
            watch.tick_limited()
        replay[key] = result = compute()
        return result
