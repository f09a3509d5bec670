"""Samples of several pairs of impact and sensor at once, as their observations have them.

The pairs share one model of the track. One operation on all their lines replaces one for each pair: with some twenty
pairs the latter spends most of its time on calls.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity


class PairSamples:
    """Lines of all ``pairs``, one pair after the other.

    Parameters
    ----------
    pairs : sequence of FrfPair
        Response channels of hammer tests.
    sensitivity : ReceptanceSensitivity
        Receptances of all of them, and their derivatives.
    """

    def __init__(self, pairs: Sequence[FrfPair], sensitivity: ReceptanceSensitivity):
        self.pairs, self.sensitivity = tuple(pairs), sensitivity
        self.counts = np.array([p.lines.size for p in self.pairs])
        self.owner = np.repeat(np.arange(len(self.pairs)), self.counts)
        self.line = np.concatenate([p.lines for p in self.pairs])
        self.row = np.array([sensitivity.row_of(p) for p in self.pairs])[self.owner]
        self.size = np.concatenate([p.size for p in self.pairs])

    @cached_property
    def real_rows(self) -> np.ndarray:
        """(n,) row of the real part of each sample, where the observations follow one another: Re, then Im of each."""
        return np.arange(self.owner.size) + (np.cumsum(self.counts) - self.counts)[self.owner]

    @cached_property
    def imaginary_rows(self) -> np.ndarray:
        """(n,) the same for the imaginary part."""
        return self.real_rows + self.counts[self.owner]

    def channel_factors(self, response_of: Callable[[FrfPair], np.ndarray]) -> np.ndarray:
        """(n,) factor of the channel of each sample over its measured magnitude [N/m].

        Parameters
        ----------
        response_of : callable
            Pair -> (n_line,) complex factor of its channel.

        Returns
        -------
        (n,) array of complex
        """
        by_channel: dict[tuple[str, str], np.ndarray] = {}
        for p in self.pairs:
            if (p.channel, p.sensor.name) not in by_channel:
                by_channel[p.channel, p.sensor.name] = response_of(p)
        responses = [by_channel[p.channel, p.sensor.name][p.lines] for p in self.pairs]
        return np.concatenate(responses) / self.size

    def at(self, values: np.ndarray) -> np.ndarray:
        """Values of the samples.

        Parameters
        ----------
        values : (n_pair, n_line, ...) array
            For all pairs of the sensitivity on all lines.

        Returns
        -------
        (n, ...) array
        """
        return values[self.row, self.line]

    def write(self, values: np.ndarray, out: np.ndarray) -> None:
        """Real and imaginary parts in the order of the observations.

        Parameters
        ----------
        values : (n,) or (n, k) array of complex
        out : (2n,) or (2n, k) array of float
            It is overwritten.
        """
        out[self.real_rows], out[self.imaginary_rows] = values.real, values.imag

    def split(self, stacked: np.ndarray) -> list[np.ndarray]:
        """Parts of an array that belong to each pair.

        Parameters
        ----------
        stacked : (2n, ...) array
            In the order of the observations.

        Returns
        -------
        list of (2 n_k, ...) array
            One view per pair.
        """
        return np.split(stacked, 2 * np.cumsum(self.counts)[:-1])

    def to_observations(self, values: np.ndarray) -> list[np.ndarray]:
        """Values as the observation of each pair has them.

        Parameters
        ----------
        values : (n,) array of complex

        Returns
        -------
        list of (2 n_k,) array of float
            Re, then Im.
        """
        stacked = np.empty(2 * values.size)
        self.write(values, stacked)
        return self.split(stacked)
