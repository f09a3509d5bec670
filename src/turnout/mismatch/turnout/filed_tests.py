"""Hammer tests compared with the simulation on the track as filed, before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.campaign import HammerInput
from turnout.mismatch.turnout.channel_identity import Comparison
from turnout.mismatch.turnout.observed_tests import ObservedTests
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import CHANNELS_CHECK
from turnout.mismatch.turnout.receptance_observation import FrfPair


@dataclass(frozen=True)
class FiledTests:
    """Hammer tests with the ``predictor`` of the site as filed; ``positions`` are those of all tests. [m]"""

    predictor: Predictor
    tests: ObservedTests
    positions: tuple[float, ...]

    @cached_property
    def pairs_by_test(self) -> Mapping[str, list[FrfPair]]:
        """Pairs of force and response by the name of their test."""
        by_test: dict[str, list[FrfPair]] = {}
        for pair in self.tests.frf_pairs.values():
            by_test.setdefault(pair.test.name, []).append(pair)
        return by_test

    @cached_property
    def _observations(self) -> Mapping[str, Observation]:
        return {o.name: o for _, o in self.tests.observations}

    @cached_property
    def simulated(self) -> Mapping[str, np.ndarray]:
        """Simulated receptance of each pair, by its name: real parts, then imaginary parts, as in observations."""
        return dict(zip(self.tests.frf_pairs, self._simulate(list(self.tests.frf_pairs.values()))))

    @cached_property
    def comparisons(self) -> list[Comparison]:
        """Correlation of each channel with the simulation at each of the sensors of its test, one per test."""
        return [self._compare(pairs) for pairs in self.pairs_by_test.values()]

    @property
    def upright_channels(self) -> set[str]:
        """Channels that agree with the simulation of their sensor, in the median of the tests, with its polarity."""
        correlations: dict[str, list[float]] = {}
        for comparison in self.comparisons:
            for (channel, sensor), r in comparison.at_best_lag({}).items():
                if channel == sensor:
                    correlations.setdefault(channel, []).append(r)
        return {channel for channel, r in correlations.items() if np.median(r) >= CHANNELS_CHECK.same_sensor}

    def correlations_at(self, test: HammerInput, position: float) -> np.ndarray:
        """Correlation of each channel of a test with the simulation of impacts at a position.

        Parameters
        ----------
        test : HammerInput
            One of the tests.
        position : float
            Of the impacts. [m]

        Returns
        -------
        (n_channel,) array of float
        """
        pairs = self.pairs_by_test[test.name]
        if position == test.place:
            simulated = [self.simulated[pair.name] for pair in pairs]
        else:
            moved = replace(test, place=position)
            simulated = self._simulate([replace(pair, test=moved) for pair in pairs])
        return np.array([self._correlation(pair, row) for pair, row in zip(pairs, simulated)])

    def _compare(self, pairs: Sequence[FrfPair]) -> Comparison:
        names = tuple(p.channel for p in pairs)
        correlations, ratios = np.zeros((len(pairs), len(pairs), 1)), np.zeros(len(pairs))
        for i, measured in enumerate(pairs):
            elsewhere = [p for p in pairs if p is not measured]
            rows = iter(self._simulate([replace(measured, channel=p.channel, sensor=p.sensor) for p in elsewhere]))
            at_its_sensor = self.simulated[measured.name]
            for j, pair in enumerate(pairs):
                correlations[i, j] = self._correlation(measured, at_its_sensor if pair is measured else next(rows))
            ratios[i] = 1.0 / max(np.median(np.hypot(*at_its_sensor.reshape(2, -1))), 1e-12)
        return Comparison(names, names, correlations, ratios)

    def _simulate(self, pairs: Sequence[FrfPair]) -> list[np.ndarray]:
        """Receptances on the track as filed: of the recorded pairs, or of these at other sensors or impacts."""
        values = {n.name: n.mean for n in self.predictor.site.shared_nuisances()}
        named = {str(i): replace(pair, name=str(i)) for i, pair in enumerate(pairs)}
        observations = [replace(self._observations[pair.name], name=str(i)) for i, pair in enumerate(pairs)]
        return self.predictor.with_recordings({**self.tests.frf_pairs, **named}, {}).predict(values, (), observations)

    def _correlation(self, pair: FrfPair, simulated: np.ndarray) -> float:
        """Correlation of two receptances, both over the magnitude of the measured one."""
        size = np.tile(pair.size, 2)
        a, b = self._observations[pair.name].data * size, simulated * size
        return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-30))
