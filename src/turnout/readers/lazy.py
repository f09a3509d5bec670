"""Lazy arrays: samples of a long record stay in the file and are read on request."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

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
