"""What held and long recordings have in common: channels sampled together at one rate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from turnout.records.channel import Channel


class Samples(Protocol):
    """``n_sample`` samples of ``channels`` at ``rate`` [Hz], which ``read(start, stop)`` gives in SI."""

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""

    @property
    def n_sample(self) -> int:
        """Samples per channel."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """One per row."""

    @property
    def read(self):
        """(start, stop) -> (n_channel, stop - start)."""


class Sampled:
    """Lengths, rows and stretches of ``Samples``."""

    @property
    def duration(self: Samples) -> float:
        """Length [s]."""
        return self.n_sample / self.rate

    def of_quantity(self: Samples, quantity: str) -> tuple[int, ...]:
        """Rows of all channels that measure ``quantity``."""
        return tuple(i for i, c in enumerate(self.channels) if c.quantity == quantity)

    def stretches(self: Samples, length: float) -> Iterator[np.ndarray]:
        """The whole recording in consecutive stretches of ``length`` seconds, (n_channel, n) each."""
        step = max(round(length * self.rate), 1)
        for start in range(0, self.n_sample, step):
            yield self.read(start, min(start + step, self.n_sample))
