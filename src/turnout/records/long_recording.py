"""A recording that is too long to be held: the same nouns, samples in stretches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from turnout.records.channel import Channel
from turnout.records.sampled import Sampled


@dataclass(frozen=True)
class LongRecording(Sampled):
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
