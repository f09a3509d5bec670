"""Records in blocks: samples of a raw record in SI units, and the checks of each channel that need all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnout.errors import ReadError
from turnout.readers.channel_maps import ChannelMapping
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source
from turnout.records import Channel

MIN_CHANGES = 32  # of a value: so many are an even number of samples apart by chance once in 2**31
HEAD_LENGTH = 4096  # samples
LARGEST_NUMBER = 1e30  # beyond it a number marks a missing sample, as 9.9e37 and 9.91e37 of SCPI instruments


@dataclass(frozen=True)
class BlockReader:
    """``reader(start, stop)`` -> (n_channel, stop - start) SI samples of the channels ``mapped`` of a raw record.

    Samples are counted from the ``first`` one that was measured. ReadError if the file is damaged there, or has changed
    since this object was created.
    """

    record: RawRecord
    mapped: tuple[ChannelMapping, ...]
    where: str
    source: Source
    state: tuple[int, int] | None
    first: int = 0

    def __call__(self, start: int, stop: int) -> np.ndarray:
        if self.source.state() != self.state:
            problem = f"it changed while it was read, at sample {start}"
            raise self.source.error(self.where, problem, "Start again when its copying has ended")
        samples = np.empty((len(self.mapped), stop - start))
        start, stop = self.first + start, self.first + stop
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
        return BlockReader(
            self.record, tuple(self.mapped[i] for i in rows), self.where, self.source, self.state, self.first
        )


@dataclass
class ChannelStatistics:
    """Statistics of each channel (n_channel,) over the blocks read so far.

    ``n_bad`` is the number of samples that are not finite or mark missing ones, ``first_bad`` the index of the first of
    them, ``value`` the first sample, ``constant`` whether all samples equal it. ``lowest`` and ``highest`` are the
    extremes. ``hold`` is the number of samples of which all changes of the value are multiples apart; of a square wave,
    which ``has_two_levels``, that is its period.
    """

    n_bad: np.ndarray
    first_bad: np.ndarray
    value: np.ndarray
    constant: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    hold: np.ndarray
    n_change: np.ndarray
    has_two_levels: np.ndarray

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
            np.zeros(n, int), np.full(n, -1), np.zeros(n), np.ones(n, bool), np.full(n, np.inf), np.full(n, -np.inf),
            np.zeros(n, int), np.zeros(n, int), np.ones(n, bool),
        )  # fmt: skip

    def by_channel(self) -> list[tuple[int, int, float, bool, int]]:
        """(n_bad, first_bad, value, constant, hold) of each channel; ``hold`` is 1 for few changes."""
        is_known = (self.n_change >= MIN_CHANGES) & ~self.has_two_levels
        hold = np.where(is_known, np.maximum(self.hold, 1), 1)
        return list(zip(self.n_bad, self.first_bad, self.value, self.constant, hold))

    def _add(self, samples: np.ndarray, start: int) -> None:
        if start == 0:
            self.value = samples[:, 0].copy()
        for i, row in enumerate(samples):
            self.lowest[i] = min(self.lowest[i], row.min())
            self.highest[i] = max(self.highest[i], row.max())
            self.constant[i] = self.lowest[i] == self.value[i] == self.highest[i]
            for part in (row[:HEAD_LENGTH], row[HEAD_LENGTH - 1 :]):  # one change at any other sample settles it
                if self.hold[i] != 1 and len(changes := np.flatnonzero(part[1:] != part[:-1])):
                    self.hold[i] = np.gcd.reduce([self.hold[i], *np.diff(changes)])
                    self.n_change[i] += len(changes)
                    self.has_two_levels[i] &= bool(((part == self.lowest[i]) | (part == self.highest[i])).all())
            with np.errstate(over="ignore", invalid="ignore"):
                suspect = not abs(row.sum()) < LARGEST_NUMBER
            if suspect and not (finite := np.abs(row) < LARGEST_NUMBER).all():
                if not self.n_bad[i]:
                    self.first_bad[i] = start + int(np.argmin(finite))
                self.n_bad[i] += np.count_nonzero(~finite)


def channel_error(
    n_sample: int, statistics: tuple[int, int, float, bool, int], channel: Channel, where: str, source: Source
) -> ReadError | None:
    """ReadError of a channel that is not finite, constant or a slower one whose samples are repeated.

    Parameters
    ----------
    n_sample : int
        Number of samples of the channel.
    statistics : tuple of (int, int, float, bool, int)
        Number of non-finite samples, index of the first of them, first sample, whether all are equal, the number of
        samples for which each value is held.
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
    n_bad, first_bad, value, constant, hold = statistics
    if n_bad:
        problem = f"{n_bad} of {n_sample} samples are missing or not finite, the first is sample {first_bad}"
        remedy = "Export the record again from the logger; if it is so there too, check the channel's cable and range"
        return source.error(place, problem, remedy, reason="not_finite")
    if constant and channel.quantity != "temperature":
        problem = f"all {n_sample} samples are {value + 0.0:.6g}: the channel is dead"
        remedy = "Check the sensor, its cable and 'source' of this channel in the layout"
        return source.error(place, problem, remedy, reason="dead_channel")
    if hold > 1 and channel.quantity in ("force", "acceleration"):
        problem = f"its value changes only after multiples of {hold} samples: those of a lower rate are repeated"
        remedy = "Export force and response at one rate, each sample once"
        return source.error(place, problem, remedy, reason="wrong_rate")
    return None
