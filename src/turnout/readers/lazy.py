"""Lazy arrays: samples of a long record stay in the file and are read and converted in blocks on request."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from turnout.errors import ReadError
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source
from turnout.records import Channel

if TYPE_CHECKING:
    from turnout.readers.channel_maps import ChannelMapping

Take = Callable[[int, int], np.ndarray]  # (start, stop) -> the samples between these indices


class Numbers(Protocol):
    """Numbers in a file or in memory, which are read when they are sliced."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each axis."""

    @property
    def dtype(self) -> Any:
        """Type of the numbers."""

    def __getitem__(self, selection: Any, /) -> np.ndarray: ...


MIN_LAZY_SIZE = 2**16  # numbers: smaller datasets are read at once


def is_large(dataset: Any) -> bool:
    """Whether a dataset may be the samples of a long record: many numbers in one or two dimensions.

    Parameters
    ----------
    dataset : any
        Dataset of h5py or an array; it has ``dtype``, ``ndim`` and ``size``.

    Returns
    -------
    bool
        True from ``MIN_LAZY_SIZE`` numbers on.
    """
    return dataset.dtype.kind in "fiu" and dataset.ndim in (1, 2) and dataset.size >= MIN_LAZY_SIZE


class LazyMatrix:
    """A matrix in a file with the ``shape``, ``ndim``, ``dtype``, ``T`` and rows of an array; rows are ``LazyColumn``.

    ``numbers`` has ``shape`` and ``dtype`` and is sliced like a two-dimensional array. The last block is cached, so
    that all rows of a block cost one access to the file.

    Parameters
    ----------
    numbers : Numbers
        Matrix in a file, (n_row, n_column) as it is stored.
    transposed : bool
        Exchange the axes.
    """

    ndim = 2

    def __init__(self, numbers: Numbers, transposed: bool = False):
        self.numbers, self.transposed = numbers, transposed
        self.dtype = np.dtype(numbers.dtype)
        self.shape = tuple(numbers.shape)[::-1] if transposed else tuple(numbers.shape)
        self.size = self.shape[0] * self.shape[1]
        self.last: tuple[tuple[int, int] | None, np.ndarray] = (None, np.empty((0, 0)))

    @property
    def T(self) -> LazyMatrix:
        """The same matrix with its axes exchanged."""
        return LazyMatrix(self.numbers, not self.transposed)

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[LazyColumn]:
        return (LazyColumn(self.row_of(k), self.shape[1], self.dtype) for k in range(len(self)))

    def row_of(self, k: int) -> Take:
        """Function (start, stop) -> samples of row ``k``.

        Parameters
        ----------
        k : int
            Number of the row, from 0.

        Returns
        -------
        callable
            Reads the samples of this row from one index up to another.
        """
        return lambda start, stop: self.block(start, stop)[k]

    def block(self, start: int, stop: int) -> np.ndarray:
        """All rows from ``start`` to ``stop``, (n_row, stop - start).

        Parameters
        ----------
        start : int
            First column, from 0.
        stop : int
            Column behind the last one.

        Returns
        -------
        (n_row, stop - start) array
            The numbers of the block.
        """
        if self.last[0] != (start, stop):
            block = self.numbers[start:stop].T if self.transposed else self.numbers[:, start:stop]
            self.last = (start, stop), block
        return self.last[1]


class LazyColumn:
    """A row of samples in a file, (n,), which ``take(start, stop)`` reads when it is sliced.

    Parameters
    ----------
    take : callable
        ``take(start, stop)`` reads the samples from ``start`` up to ``stop``.
    n : int
        Number of samples.
    dtype : dtype
        Type of the numbers.

    Examples
    --------
    >>> column = LazyColumn(lambda start, stop: np.arange(start, stop), 10, np.dtype(float))
    >>> len(column), column[7:99].tolist(), float(np.asarray(column).sum())
    (10, [7, 8, 9], 45.0)
    """

    ndim = 1

    def __init__(self, take: Take, n: int, dtype: Any):
        self.take, self.shape, self.size, self.dtype = take, (n,), n, np.dtype(dtype)

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, selection: slice) -> np.ndarray:
        start, stop, step = selection.indices(self.size)
        return self.take(start, max(stop, start))[::step]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[:], dtype=dtype)


def lazy_array(numbers: Numbers) -> LazyColumn | LazyMatrix:
    """``LazyColumn`` or ``LazyMatrix`` of anything that is sliced like an array; axes of length 1 are dropped.

    Parameters
    ----------
    numbers : Numbers
        Dataset of one or two dimensions in a file.

    Returns
    -------
    LazyColumn or LazyMatrix
        A column if at most one axis is longer than 1, else a matrix.

    Examples
    --------
    >>> lazy_array(np.ones((1, 5))).shape, lazy_array(np.ones((5, 1))).shape, lazy_array(np.ones((2, 5))).shape
    ((5,), (5,), (2, 5))
    """
    shape = tuple(numbers.shape)
    if len(shape) == 1:
        return LazyColumn(lambda start, stop: numbers[start:stop], shape[0], numbers.dtype)
    if 1 in shape:
        (only,) = LazyMatrix(numbers, transposed=shape[0] != 1)
        return only
    return LazyMatrix(numbers)


ARRAYS = (np.ndarray, LazyMatrix, LazyColumn)
Array = np.ndarray | LazyMatrix | LazyColumn
Column = np.ndarray | LazyColumn  # samples of one channel, (n_sample,)


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
        with self.source.parsed_by("the format's library", f"{self.where}, samples {start} to {stop}"):
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

    ``n_bad`` is the number of non-finite samples, ``first_bad`` the index of the first of them, ``value`` the first
    sample, ``constant`` whether all samples equal it.
    """

    n_bad: np.ndarray
    first_bad: np.ndarray
    value: np.ndarray
    constant: np.ndarray

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
        return cls(np.zeros(n, int), np.full(n, -1), np.zeros(n), np.ones(n, bool))

    def by_channel(self) -> list[tuple[int, int, float, bool]]:
        """(n_bad, first_bad, value, constant) of each channel."""
        return list(zip(self.n_bad, self.first_bad, self.value, self.constant))

    def _add(self, samples: np.ndarray, start: int) -> None:
        if start == 0:
            self.value = samples[:, 0].copy()
        for i, row in enumerate(samples):
            self.constant[i] &= bool(row[0] == self.value[i] == row[-1] and row.min() == row.max())
            with np.errstate(over="ignore", invalid="ignore"):
                suspect = not np.isfinite(row.sum())
            if suspect and not (finite := np.isfinite(row)).all():
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
        return source.error(place, problem, "Check sensor, cable and channel map", reason="dead_channel")
    return None


def open_hdf5(source: Source) -> AbstractContextManager[Any]:
    """The HDF5 file as a context; with a lazy source the datasets keep it open.

    Parameters
    ----------
    source : Source
        The HDF5 file.

    Returns
    -------
    context manager of h5py.File
        The open file.
    """
    import h5py

    file = h5py.File(source.path, "r")
    return nullcontext(file) if source.lazy else file
