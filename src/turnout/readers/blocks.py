"""Records in blocks: samples of a raw record in SI units, and the checks of each channel that need all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnout.errors import ReadError
from turnout.readers.channel_maps import ChannelMapping
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source
from turnout.records import Channel

LARGEST_NUMBER = 1e30  # beyond it a number marks a missing sample, as 9.9e37 and 9.91e37 of SCPI instruments


@dataclass(frozen=True)
class BlockReader:
    """``reader(start, stop)`` -> (n_channel, stop - start) SI samples of the channels ``mapped`` of a raw record.

    ReadError if the file is damaged there, or has changed since this object was created.
    """

    record: RawRecord
    mapped: tuple[ChannelMapping, ...]
    where: str
    source: Source
    state: tuple[int, int] | None

    def __call__(self, start: int, stop: int) -> np.ndarray:
        if self.source.state() != self.state:
            problem = f"it changed while it was read, at sample {start}"
            raise self.source.error(self.where, problem, "Start again when its copying has ended")
        samples = np.empty((len(self.mapped), stop - start))
        place = f"{self.where}, samples {start} to {stop}"
        with self.source.parsed_by("the format's library", place), np.errstate(all="ignore"):
            for row, mapping in zip(samples, self.mapped):
                np.multiply(self.record.samples[mapping.index][start:stop], mapping.scale, out=row)
                if mapping.offset:
                    row += mapping.offset
        return samples

    def subset(self, rows: Sequence[int]) -> BlockReader:
        """The same reader for some of the channels.

        Parameters
        ----------
        rows : sequence of int
            Indices of the channels in ``mapped``.

        Returns
        -------
        BlockReader
            A reader of these channels in this order.
        """
        return BlockReader(self.record, tuple(self.mapped[i] for i in rows), self.where, self.source, self.state)


@dataclass
class ChannelStatistics:
    """Statistics of each channel (n_channel,) over the blocks read so far.

    ``n_bad`` is the number of samples that are not finite or mark missing ones, ``first_bad`` the index of the first of
    them, ``value`` the first sample, ``constant`` whether all samples equal it. ``lowest`` and ``highest`` are the
    extremes.
    """

    n_bad: np.ndarray
    first_bad: np.ndarray
    value: np.ndarray
    constant: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray

    @classmethod
    def from_record(cls, block_reader: BlockReader, n_sample: int) -> ChannelStatistics:
        """Statistics from one pass over a record of ``n_sample`` samples.

        Parameters
        ----------
        block_reader : BlockReader
            Reads the samples of the record in blocks.
        n_sample : int
            Number of samples of each channel.

        Returns
        -------
        ChannelStatistics
            Statistics of all samples.

        Raises
        ------
        ReadError
            If the file is damaged in one of the blocks.
        """
        statistics = cls._empty(len(block_reader.mapped))
        for start in range(0, n_sample, BLOCK_SIZE):
            statistics._add(block_reader(start, min(start + BLOCK_SIZE, n_sample)), start)
        return statistics

    @classmethod
    def from_samples(cls, samples: np.ndarray) -> ChannelStatistics:
        """Statistics of the samples of a record in memory.

        Parameters
        ----------
        samples : (n_channel, n_sample) array of float
            In the SI unit of each channel.

        Returns
        -------
        ChannelStatistics
            Statistics of all samples.
        """
        statistics = cls._empty(len(samples))
        statistics._add(samples, 0)
        return statistics

    @classmethod
    def _empty(cls, n: int) -> ChannelStatistics:
        return cls(
            np.zeros(n, int), np.full(n, -1), np.zeros(n), np.ones(n, bool), np.full(n, np.inf), np.full(n, -np.inf)
        )

    def by_channel(self) -> list[tuple[int, int, float, bool]]:
        """(n_bad, first_bad, value, constant) of each channel."""
        return list(zip(self.n_bad, self.first_bad, self.value, self.constant))

    def _add(self, samples: np.ndarray, start: int) -> None:
        if start == 0:
            self.value = samples[:, 0].copy()
        for i, row in enumerate(samples):
            self.lowest[i] = min(self.lowest[i], row.min())
            self.highest[i] = max(self.highest[i], row.max())
            self.constant[i] = self.lowest[i] == self.value[i] == self.highest[i]
            with np.errstate(over="ignore", invalid="ignore"):
                suspect = not abs(row.sum()) < LARGEST_NUMBER
            if suspect and not (finite := np.abs(row) < LARGEST_NUMBER).all():
                if not self.n_bad[i]:
                    self.first_bad[i] = start + int(np.argmin(finite))
                self.n_bad[i] += np.count_nonzero(~finite)


def channel_error(
    n_sample: int, statistics: tuple[int, int, float, bool], channel: Channel, where: str, source: Source
) -> ReadError | None:
    """ReadError of a channel that is not finite or constant; None for an intact one.

    Parameters
    ----------
    n_sample : int
        Number of samples of the channel.
    statistics : tuple of (int, int, float, bool)
        Number of non-finite samples, index of the first of them, first sample, whether all are equal.
    channel : Channel
        The channel; one that measures temperature may be constant.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    ReadError or None
        The error, None for an intact channel.
    """
    place = f"{where}, channel {channel.name!r}"
    n_bad, first_bad, value, constant = statistics
    if n_bad:
        problem = f"{n_bad} of {n_sample} samples are missing or not finite, the first is sample {first_bad}"
        remedy = "Export the record again from the logger; if it is so there too, check the channel's cable and range"
        return source.error(place, problem, remedy, reason="not_finite")
    if constant and channel.quantity != "temperature":
        problem = f"all {n_sample} samples are {value:.6g}: the channel is dead"
        remedy = "Check the sensor, its cable and 'source' of this channel in the layout"
        return source.error(place, problem, remedy, reason="dead_channel")
    return None
