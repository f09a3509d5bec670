"""A recording that is too long to be held: the same nouns, samples in stretches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from turnout.records.channel import Channel


@dataclass(frozen=True)
class LongRecording:
    """Simultaneously sampled channels of a logger that never stops; its samples stay in their file.

    ``read(start, stop)`` gives (n_channel, stop - start) samples in the SI unit of each channel's quantity, of
    ``n_sample`` in all; the rest is as in ``Recording``.
    """

    read: Callable[[int, int], np.ndarray]
    n_sample: int
    rate: float
    channels: tuple[Channel, ...]
    kind: str = "passage"
    source: str = ""
    record: int = 0
    started_at: datetime | None = None
    conditions: Mapping = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.n_sample / self.rate

    def of_quantity(self, quantity: str) -> tuple[int, ...]:
        """Rows of all channels that measure ``quantity``."""
        return tuple(i for i, c in enumerate(self.channels) if c.quantity == quantity)

    def stretches(self, length: float) -> Iterator[np.ndarray]:
        """The whole recording in consecutive stretches of ``length`` seconds, (n_channel, n) each."""
        step = max(round(length * self.rate), 1)
        for start in range(0, self.n_sample, step):
            yield self.read(start, min(start + step, self.n_sample))
