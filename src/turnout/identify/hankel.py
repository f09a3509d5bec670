"""Hankel matrices of free decays that are never formed: products by FFT, Gram matrices by running sums."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.sparse.linalg import LinearOperator


def hankel_rows(n_sample: int, decay_time: float | None = None) -> int:
    """Rows of the Hankel matrix of a decay: a third of the record, or square if that is under a decay time.

    The short side decides what can be seen; ``decay_time`` is that of the slowest mode in samples, None if
    unknown.

    >>> hankel_rows(600), hankel_rows(600, decay_time=250.0)
    (200, 300)
    """
    third = n_sample // 3
    return n_sample // 2 if decay_time is not None and third < decay_time else third


def hankel_operator(y, rows: int, shift: int = 0) -> LinearOperator:
    r"""Hankel matrix :math:`H_{ij} = y_{i+j+\text{shift}}` as an operator of O(n log n) time and O(n) memory.

    ``y`` is (n,); the operator is (rows, n - rows - shift) at shift 1 and one column more at shift 0 so that
    both have ``n - rows`` columns. ValueError if fewer than one column is left.

    >>> h = hankel_operator(np.array([1.0, 2.0, 4.0, 8.0]), rows=2)
    >>> h @ np.array([1.0, 0.0])
    array([1., 2.])
    """
    y = np.asarray(y, dtype=float)
    columns = len(y) - rows
    if rows < 1 or columns < 1:
        raise ValueError(f"{len(y)} samples do not fill a Hankel matrix of {rows} rows")
    part = y[shift : shift + rows + columns - 1]
    length = next_fast_len(len(part) + max(rows, columns) - 1, real=True)
    spectrum = rfft(part, length)

    def correlate(x, n_in, n_out):
        reversed_x = np.ravel(x)[::-1]
        return irfft(rfft(reversed_x, length) * spectrum, length)[n_in - 1 : n_in - 1 + n_out]

    return LinearOperator(
        (rows, columns),
        matvec=lambda x: correlate(x, columns, rows),
        rmatvec=lambda x: correlate(x, rows, columns),
        dtype=float,
    )


def gram_matrices(decays, rows: int, starts=(0,)) -> list[np.ndarray]:
    r"""Gram matrix of the Hankel matrices of several decays set side by side, without forming them.

    .. math:: G_{ij} = \sum_\text{decays} \sum_{k=\text{start}}^{m-1} y_{i+k} y_{j+k}, \quad m = n - \text{rows}

    Along a diagonal only the ends of the inner sum change, so each is a difference of two running sums: O(n rows)
    per decay, shared by all starts.

    Parameters
    ----------
    decays : (n_decay, n) array of float
    rows : int
        Rows of every Hankel matrix; the result has one more, so that it also holds the shifted products:
        ``G[:-1, :-1]`` is H0 H0^T and ``G[1:, :-1]`` is H1 H0^T.
    starts : sequence of int
        Leading samples left out, one matrix for each.

    Returns
    -------
    list of (rows + 1, rows + 1) array of float
        In the squared unit of the decays.

    Examples
    --------
    >>> gram_matrices(np.array([[1.0, 2.0, 4.0]]), rows=1)[0]
    array([[ 5., 10.],
           [10., 20.]])
    """
    decays = np.atleast_2d(np.asarray(decays, dtype=float))
    columns = decays.shape[1] - rows
    if rows < 1 or columns <= max(starts):
        raise ValueError(f"{decays.shape[1]} samples do not fill a Hankel matrix of {rows} rows")
    grams = [np.empty((rows + 1, rows + 1)) for _ in starts]
    running = np.zeros(decays.shape[1] + 1)
    for lag in range(rows + 1):
        length = decays.shape[1] - lag
        product = np.einsum("ij,ij->j", decays[:, :length], decays[:, lag:])
        np.cumsum(product, out=running[1 : length + 1])
        count = rows + 1 - lag
        for start, gram in zip(starts, grams, strict=True):
            diagonal = running[columns : columns + count] - running[start : start + count]
            gram.ravel()[lag :: rows + 2][:count] = diagonal
            gram.ravel()[lag * (rows + 1) :: rows + 2] = diagonal
    return grams
