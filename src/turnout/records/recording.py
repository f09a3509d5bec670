"""A recording: channels sampled together over one stretch of time, and what was noted beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from types import MappingProxyType

import numpy as np

from turnout.records.channel import Channel
from turnout.records.long_recording import LongRecording
from turnout.records.sampled import Sampled

NOTHING: Mapping = MappingProxyType({})


@dataclass(frozen=True)
class Recording(Sampled):
    """Simultaneously sampled channels over one stretch of time, measured or simulated.

    Parameters
    ----------
    samples : (n_channel, n_sample) array of float
        In the SI unit of each channel's quantity.
    rate : float
        Samples per second. [Hz]
    channels : tuple of Channel
        One per row of ``samples``.
    kind : str
        "hammer" or "passage".
    source : str
        File the samples came from, relative to the raw root; "record k" is in ``record``.
    record : int
        Which record of the file, from 0.
    started_at : datetime or None
        Naive UTC time of the first sample.
    conditions : mapping
        What was noted beside the samples, SI or named: ``rail_temperature`` [°C], ``train_type``,
        ``speed`` [m/s], ``axle_loads`` [N], ``track`` ("main", "diverging"), ``direction`` ...
    """

    samples: np.ndarray
    rate: float
    channels: tuple[Channel, ...]
    kind: str = "hammer"
    source: str = ""
    record: int = 0
    started_at: datetime | None = None
    conditions: Mapping = field(default_factory=dict)

    def __post_init__(self):
        samples = np.asarray(self.samples, dtype=float)
        if samples.ndim != 2 or samples.shape[0] != len(self.channels):
            raise ValueError(f"{samples.shape} samples do not match {len(self.channels)} channels")
        if not self.rate > 0:
            raise ValueError(f"sampling rate must be above 0 Hz, got {self.rate}")
        object.__setattr__(self, "samples", samples)

    @property
    def n_sample(self) -> int:
        """Samples per channel."""
        return self.samples.shape[1]

    def read(self, start: int, stop: int) -> np.ndarray:
        """(n_channel, stop - start) samples."""
        return self.samples[:, start:stop]

    def index(self, name: str) -> int:
        """Row of the channel called ``name``; KeyError lists the names there are."""
        for i, channel in enumerate(self.channels):
            if channel.name == name:
                return i
        raise KeyError(f"no channel {name!r}; there are {[c.name for c in self.channels]}")

    def signal(self, name: str) -> np.ndarray:
        """(n_sample,) samples of the channel called ``name``, in its SI unit."""
        return self.samples[self.index(name)]


@dataclass(frozen=True)
class ReadResult:
    """What came out of one raw file: its sound records, and an error for each damaged one.

    ``long`` are those that stay in the file, where that was asked for.
    """

    recordings: tuple[Recording, ...]
    errors: tuple[Exception, ...] = ()
    sha256: str = ""
    long: tuple[LongRecording, ...] = ()
