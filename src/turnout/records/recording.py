"""Recordings: channels sampled simultaneously, with their conditions.

A ``Recording`` holds its samples in memory. A ``LongRecording`` reads them from its file in blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure


@dataclass(frozen=True)
class Channel:
    """One measured quantity of a recording.

    ``quantity`` is "force" [N], "acceleration" [m/s²], "velocity" [m/s], "displacement" [m], "strain" [-]
    or "temperature" [°C]; the samples are in that SI unit with the configured sign already applied.
    ``position`` is along the track [m] in the turnout's coordinate. ``mounting`` is where the sensor
    is fixed ("rail head at sleeper", "rail head mid-span", "rail web", "sleeper", "hammer"). ``limit`` is the
    range beyond which the instrument clips and ``resolution`` one step of its converter, both in the SI
    unit, None where unknown.
    """

    name: str
    quantity: str
    position: float | None = None
    mounting: str = ""
    serial: str = ""
    limit: float | None = None
    resolution: float | None = None


class Samples(Protocol):
    """``n_sample`` samples of ``channels`` at ``rate`` [Hz]; ``read(start, stop)`` returns them in SI."""

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""

    @property
    def n_sample(self) -> int:
        """Samples per channel."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """One channel per row."""

    @property
    def read(self) -> Callable[[int, int], np.ndarray]:
        """(start, stop) -> (n_channel, stop - start)."""


class SampledSignals:
    """Duration, rows and blocks of ``Samples``."""

    @property
    def duration(self: Samples) -> float:
        """Length [s]."""
        return self.n_sample / self.rate

    def of_quantity(self: Samples, quantity: str) -> tuple[int, ...]:
        """Rows of all channels that measure ``quantity``.

        Parameters
        ----------
        quantity : str
            "force", "acceleration", "velocity", "displacement", "strain" or "temperature".

        Returns
        -------
        tuple of int
            Rows, increasing.
        """
        return tuple(i for i, c in enumerate(self.channels) if c.quantity == quantity)

    def blocks(self: Samples, length: float) -> Iterator[np.ndarray]:
        """The whole recording in consecutive blocks of ``length`` seconds, (n_channel, n) each.

        Parameters
        ----------
        length : float
            Length of a block. [s]

        Yields
        ------
        (n_channel, n) array of float
            In the SI unit of each channel; the last block may be shorter.
        """
        step = max(round(length * self.rate), 1)
        for start in range(0, self.n_sample, step):
            yield self.read(start, min(start + step, self.n_sample))


@dataclass(frozen=True)
class LongRecording(SampledSignals):
    """Recording of a continuous logger, whose samples stay in the file.

    ``read(start, stop)`` returns (n_channel, stop - start) of its ``n_sample`` samples, in the SI unit of each channel.
    The other fields are as in ``Recording``.
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

    def __repr__(self) -> str:
        return _recording_text(self)


def _recording_text(recording: Recording | LongRecording) -> str:
    """Kind, channels and length of a recording in one line."""
    names = [f"{c.name} ({c.quantity})" for c in recording.channels]
    if len(names) > MAX_NAMED_CHANNELS:
        names = [*names[: MAX_NAMED_CHANNELS - 1], f"... {len(names)} channels"]
    length = f"{recording.n_sample} samples at {recording.rate:g} Hz, {recording.duration:.4g} s"
    source = f", {recording.source} record {recording.record + 1}" if recording.source else ""
    return f"{type(recording).__name__}({recording.kind}: {', '.join(names)}; {length}{source})"


MAX_NAMED_CHANNELS = 4  # channels of a recording that its text names
EMPTY_MAPPING: Mapping = MappingProxyType({})


@dataclass(frozen=True)
class Recording(SampledSignals):
    """Simultaneously sampled channels over one period of time, measured or simulated.

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
        File of the samples, relative to the raw root.
    record : int
        Which record of the file, from 0.
    started_at : datetime or None
        Naive UTC time of the first sample.
    conditions : mapping
        Conditions stored with the samples, in SI or as text: ``rail_temperature`` [°C], ``train_type``,
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

    def __post_init__(self) -> None:
        samples = np.asarray(self.samples, dtype=float)
        if samples.ndim != 2 or samples.shape[0] != len(self.channels):
            raise ValueError(f"{samples.shape} samples do not match {len(self.channels)} channels")
        if not self.rate > 0:
            raise ValueError(f"sampling rate must be above 0 Hz, got {self.rate}")
        object.__setattr__(self, "samples", samples)

    def __repr__(self) -> str:
        return _recording_text(self)

    def plot(self, figure: Figure | SubFigure | None = None) -> np.ndarray:
        """Draw every channel over time, one below the other.

        Parameters
        ----------
        figure : matplotlib.figure.Figure or SubFigure, optional
            Where to draw; a new figure by default.

        Returns
        -------
        (n_channel,) array of matplotlib.axes.Axes
            Each channel in its SI unit over time [s].
        """
        from turnout.plots import plot_recording

        return plot_recording(self, figure)

    @property
    def n_sample(self) -> int:
        """Samples per channel."""
        return self.samples.shape[1]

    def read(self, start: int, stop: int) -> np.ndarray:
        """(n_channel, stop - start) samples.

        Parameters
        ----------
        start, stop : int
            First sample, and the one after the last.

        Returns
        -------
        (n_channel, stop - start) array of float
            In the SI unit of each channel.
        """
        return self.samples[:, start:stop]

    def index(self, name: str) -> int:
        """Row of the channel called ``name``; KeyError lists the names there are.

        Parameters
        ----------
        name : str
            Name of a channel.

        Returns
        -------
        int
            Its row.

        Raises
        ------
        KeyError
            There is no such channel; the message lists the names there are.
        """
        for i, channel in enumerate(self.channels):
            if channel.name == name:
                return i
        raise KeyError(f"no channel {name!r}; there are {[c.name for c in self.channels]}")

    def signal(self, name: str) -> np.ndarray:
        """(n_sample,) samples of the channel called ``name``, in its SI unit.

        Parameters
        ----------
        name : str
            Name of a channel.

        Returns
        -------
        (n_sample,) array of float
            In the SI unit of the channel.

        Raises
        ------
        KeyError
            There is no such channel.
        """
        return self.samples[self.index(name)]


@dataclass(frozen=True)
class ReadResult:
    """Result of reading one raw file: its intact records, and an error for each damaged one.

    It is a sequence of its ``recordings``. ``long_recordings`` are the records whose samples stay in the file.
    """

    recordings: tuple[Recording, ...]
    errors: tuple[Exception, ...] = ()
    sha256: str = ""
    long_recordings: tuple[LongRecording, ...] = ()

    def __len__(self) -> int:
        return len(self.recordings)

    def __bool__(self) -> bool:
        return True  # a file without intact records is a result as well

    def __iter__(self) -> Iterator[Recording]:
        return iter(self.recordings)

    def __getitem__(self, index: int) -> Recording:
        return self.recordings[index]

    def __repr__(self) -> str:
        n_error = f", {len(self.errors)} damaged" if self.errors else ""
        n_long = f", {len(self.long_recordings)} left in the file" if self.long_recordings else ""
        more = " ..." if len(self.recordings) > 1 else ""
        first = f": {self.recordings[0]!r}{more}" if self.recordings else ""
        return (
            f"ReadResult({len(self.recordings)} recording{'s' * (len(self.recordings) != 1)}{n_long}{n_error}{first})"
        )
