"""Samples that stay in their file: what of an array a reader asks for, and stretches of samples on request."""

import numpy as np

MANY = 2**16  # numbers: fewer are no long record


def stays(dataset) -> bool:
    """Whether a dataset can be samples of a long record: numbers in one or two dimensions, many of them."""
    return dataset.dtype.kind in "fiu" and dataset.ndim in (1, 2) and dataset.size >= MANY


class Stored:
    """A matrix in a file: ``shape``, ``ndim``, ``dtype``, ``T`` and rows as an array has them; rows are ``Column``.

    ``numbers`` is anything with ``shape`` and ``dtype`` that is sliced like an array of two dimensions. The last
    stretch is kept: all rows of a stretch cost one access to the file.
    """

    ndim = 2

    def __init__(self, numbers, turned: bool = False):
        self.numbers, self.turned = numbers, turned
        self.dtype = np.dtype(numbers.dtype)
        self.shape = tuple(numbers.shape)[::-1] if turned else tuple(numbers.shape)
        self.size = self.shape[0] * self.shape[1]
        self.last: tuple[tuple[int, int] | None, np.ndarray] = (None, np.empty((0, 0)))

    @property
    def T(self):
        """The same matrix with its axes exchanged."""
        return Stored(self.numbers, not self.turned)

    def __len__(self):
        return self.shape[0]

    def __iter__(self):
        return (Column(self.row_of(k), self.shape[1], self.dtype) for k in range(len(self)))

    def row_of(self, k):
        """Function (start, stop) -> that stretch of row ``k``."""
        return lambda start, stop: self.stretch(start, stop)[k]

    def stretch(self, start, stop) -> np.ndarray:
        """(n_row, stop - start)."""
        if self.last[0] != (start, stop):
            part = self.numbers[start:stop].T if self.turned else self.numbers[:, start:stop]
            self.last = (start, stop), part
        return self.last[1]


class Column:
    """A row of samples in a file, (n,): sliced, it is read; ``take(start, stop)`` does that.

    >>> column = Column(lambda start, stop: np.arange(start, stop), 10, np.dtype(float))
    >>> len(column), column[7:99].tolist(), float(np.asarray(column).sum())
    (10, [7, 8, 9], 45.0)
    """

    ndim = 1

    def __init__(self, take, n: int, dtype):
        self.take, self.shape, self.size, self.dtype = take, (n,), n, np.dtype(dtype)

    def __len__(self):
        return self.size

    def __getitem__(self, part: slice):
        start, stop, step = part.indices(self.size)
        return self.take(start, max(stop, start))[::step]

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self[:], dtype=dtype)


def stored(numbers):
    """``Column`` or ``Stored`` of what is sliced like an array; an axis of length 1 is no axis.

    >>> stored(np.ones((1, 5))).shape, stored(np.ones((5, 1))).shape, stored(np.ones((2, 5))).shape
    ((5,), (5,), (2, 5))
    """
    shape = tuple(numbers.shape)
    if len(shape) == 1:
        return Column(lambda start, stop: numbers[start:stop], shape[0], numbers.dtype)
    if 1 in shape:
        (only,) = Stored(numbers, turned=shape[0] != 1)
        return only
    return Stored(numbers)


ARRAYS = (np.ndarray, Stored, Column)
