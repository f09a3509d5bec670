"""Eigensystem realisation of free decays: state matrices and poles from Hankel matrices.

The Hankel matrices are never formed. One decay uses products by FFT and Lanczos iterations, several decays use a Gram
matrix from running sums. The signal subspace of several decays gives the state matrices of all orders at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh, svds

from turnout.modal.poles import modal_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike


def hankel_rows(n_sample: int, decay_time: float | None = None) -> int:
    """Rows of the Hankel matrix of a decay: a third of the record, or half if a third is below one decay time.

    The shorter side limits the resolution. ``decay_time`` is that of the slowest mode [samples], None if unknown.

    Parameters
    ----------
    n_sample : int
        Samples of the decay.
    decay_time : float or None
        Decay time of the slowest mode [samples], None if unknown.

    Returns
    -------
    int
        Number of rows.

    Examples
    --------
    >>> hankel_rows(600), hankel_rows(600, decay_time=250.0)
    (200, 300)
    """
    third = n_sample // 3
    return n_sample // 2 if decay_time is not None and third < decay_time else third


def hankel_operator(y: ArrayLike, rows: int, shift: int = 0) -> LinearOperator:
    r"""Hankel matrix :math:`H_{ij} = y_{i+j+\text{shift}}` as an operator of O(n log n) time and O(n) memory.

    Parameters
    ----------
    y : (n,) array of float
        The decay.
    rows : int
        Rows of the matrix.
    shift : int
        Samples that are skipped: 0 for H0, 1 for H1.

    Returns
    -------
    LinearOperator
        (rows, n - rows) operator.

    Raises
    ------
    ValueError
        If no column remains.

    Examples
    --------
    >>> h = hankel_operator(np.array([1.0, 2.0, 4.0, 8.0]), rows=2)
    >>> h @ np.array([1.0, 0.0])
    array([1., 2.])
    """
    y = np.asarray(y, dtype=float)
    columns = len(y) - rows
    if rows < 1 or columns < 1:
        raise ValueError(f"{len(y)} samples do not fill a Hankel matrix of {rows} rows")
    samples = y[shift : shift + rows + columns - 1]
    length = next_fast_len(len(samples) + max(rows, columns) - 1, real=True)
    spectrum = rfft(samples, length)

    def correlate(x: np.ndarray, n_in: int, n_out: int) -> np.ndarray:
        reversed_x = np.ravel(x)[::-1]
        return irfft(rfft(reversed_x, length) * spectrum, length)[n_in - 1 : n_in - 1 + n_out]

    return LinearOperator(
        (rows, columns),
        matvec=lambda x: correlate(x, columns, rows),
        rmatvec=lambda x: correlate(x, rows, columns),
        dtype=float,
    )


def gram_matrices(decays: ArrayLike, rows: int, starts: Sequence[int] = (0,)) -> list[np.ndarray]:
    r"""Gram matrix of the Hankel matrices of several decays set side by side, without forming them.

    .. math:: G_{ij} = \sum_\text{decays} \sum_{k=\text{start}}^{m-1} y_{i+k} y_{j+k}, \quad m = n - \text{rows}

    Along a diagonal only the ends of the inner sum change, so each is a difference of two running sums: O(n rows)
    per decay, shared by all starts.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Decays of one length.
    rows : int
        Rows of every Hankel matrix; the result has one more, so that it also holds the shifted products:
        ``G[:-1, :-1]`` is H0 H0^T and ``G[1:, :-1]`` is H1 H0^T.
    starts : sequence of int
        Numbers of leading samples that are skipped, one matrix for each.

    Returns
    -------
    list of (rows + 1, rows + 1) array of float
        In the squared unit of the decays.

    Raises
    ------
    ValueError
        If the decays are too short for the rows and starts.

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
    running_sum = np.zeros(decays.shape[1] + 1)
    for lag in range(rows + 1):
        length = decays.shape[1] - lag
        product = np.einsum("ij,ij->j", decays[:, :length], decays[:, lag:])
        np.cumsum(product, out=running_sum[1 : length + 1])
        count = rows + 1 - lag
        for start, gram in zip(starts, grams, strict=True):
            diagonal = running_sum[columns : columns + count] - running_sum[start : start + count]
            gram.ravel()[lag :: rows + 2][:count] = diagonal
            gram.ravel()[lag * (rows + 1) :: rows + 2] = diagonal
    return grams


MIN_SPARSE_SIZE = 64  # rows or columns: smaller Hankel matrices are decomposed as dense ones, which is faster


@dataclass(frozen=True)
class Realisation:
    """x[k+1] = A x[k], y[k] = c x[k], x[0] = b, cut to ``order`` by the singular values of the Hankel matrix.

    ``a`` (order, order), ``c`` (order,), ``b`` (order,) or (order, n_decay) with one column per decay,
    ``singular_values`` (order,) and ``rate`` [Hz].
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    singular_values: np.ndarray
    rate: float

    @property
    def poles(self) -> np.ndarray:
        """(order,) discrete poles z."""
        return np.linalg.eigvals(self.a)

    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz] and damping ratios of the underdamped stable poles, lowest frequency first."""
        z = self.poles
        frequency, damping = modal_parameters(z[(z.imag > 0.0) & (np.abs(z) < 1.0)], self.rate)
        ascending = np.argsort(frequency)
        return frequency[ascending], damping[ascending]


def era(decay: ArrayLike, order: int, rows: int | None = None, rate: float = 1.0) -> Realisation:
    r"""Eigensystem realisation algorithm for one or several free decays of one sensor.

    .. math:: H_0 = U S V^T, \quad A = S^{-1/2} U^T H_1 V S^{-1/2}, \quad c = U_0 S^{1/2}, \quad x_0 = S^{1/2} V_0^T

    One decay: the leading singular triplets come from Lanczos iterations on FFT products. They agree with a full SVD
    to rounding. Several decays: they are set side by side and use the Gram matrix of their rows. The poles are
    common, every decay has its own initial state.

    Parameters
    ----------
    decay : (n,) or (n_decay, n) array of float
        Free decay from its first sample, unfiltered.
    order : int
        Number of states, two per mode.
    rows : int, optional
        Rows of the Hankel matrix; a third of the record by default. See :func:`hankel_rows`.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    Realisation

    Raises
    ------
    ValueError
        Not finite, or too short for the order.

    References
    ----------
    Juang and Pappa 1985; Barkhordari et al., eq. 8-15, with H0 = U S V^T cut to the order in place of eq. 11.

    Examples
    --------
    A half-life of one sample is a real pole at 0.5.

    >>> model = era(0.5 ** np.arange(9.0), order=1)
    >>> print(f"{model.a[0, 0]:.6f}")
    0.500000
    """
    decay = np.asarray(decay, dtype=float)
    n = decay.shape[-1]
    rows = hankel_rows(n) if rows is None else rows
    if not np.all(np.isfinite(decay)):
        raise ValueError("the decay has samples that are not finite")
    if not 1 <= order <= min(rows, n - rows):
        raise ValueError(f"order {order} needs at least {order} rows and columns; there are {rows} x {n - rows}")
    if decay.ndim == 1:
        return _era_single(decay, order, rows, rate)
    return _era_side_by_side(decay, order, rows, rate)


def _era_single(y: np.ndarray, order: int, rows: int, rate: float) -> Realisation:
    columns = len(y) - rows
    h0, h1 = hankel_operator(y, rows), hankel_operator(y, rows, shift=1)
    if rows == columns:
        w, u = _largest_eigenpairs(h0, order)
        s, v = np.abs(w), u * np.sign(w)
    else:
        u, s, v = _largest_singular_triplets(h0, order)
    root = np.sqrt(s)
    a = (u.T @ np.column_stack([h1 @ column for column in v.T])) / np.outer(root, root)
    return Realisation(a, root * v[0], u[0] * root, s, rate)


def _largest_eigenpairs(h: LinearOperator, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenpairs of a symmetric operator that are largest in magnitude, largest first."""
    n = h.shape[0]
    if n < MIN_SPARSE_SIZE or order >= n - 1:
        w, u = np.linalg.eigh(h @ np.eye(n))
    else:
        w, u = eigsh(h, k=order, which="LM", v0=_start_vector(h), ncv=min(n, max(2 * order + 8, 20)))
    leading = np.argsort(-np.abs(w), kind="stable")[:order]
    return w[leading], u[:, leading]


def _largest_singular_triplets(h: LinearOperator, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = min(h.shape)
    if n < MIN_SPARSE_SIZE or order >= n - 1:
        u, s, vt = np.linalg.svd(h @ np.eye(h.shape[1]), full_matrices=False)
    else:
        # PROPACK works on H itself: eigenpairs of H H^T would lose half of the digits.
        u, s, vt = svds(h, k=order, v0=None, solver="propack", rng=np.random.default_rng(1))
    leading = np.argsort(-s, kind="stable")[:order]
    return u[:, leading], s[leading], vt[leading].T


def _start_vector(h: LinearOperator) -> np.ndarray:
    """Start vector of the iteration: the first column of H, which has a share in every singular vector."""
    return h @ np.eye(1, h.shape[1]).ravel() + 1e-3 * np.random.default_rng(1).standard_normal(h.shape[0])


def _era_side_by_side(decays: np.ndarray, order: int, rows: int, rate: float) -> Realisation:
    (gram,) = gram_matrices(decays, rows)
    w, u = eigh(gram[:-1, :-1], subset_by_index=(rows - order, rows - 1))
    w, u = np.maximum(w[::-1], np.finfo(float).tiny), u[:, ::-1]
    s = np.sqrt(w)
    root = np.sqrt(s)
    a = (u.T @ gram[1:, :-1] @ u) / np.outer(root, root * s)
    first = np.stack([hankel_operator(y, rows).H @ u[:, k] for y in decays for k in range(order)])
    v0 = first[:, 0].reshape(len(decays), order) / s
    return Realisation(a, (root * v0).T, u[0] * root, s, rate)


MAX_ROWS = 300  # rows of the Hankel matrices of several decays; limits the time of a decomposition


@dataclass(frozen=True)
class Subspace:
    """Leading left singular vectors ``u`` (n_row, order) of the Hankel matrices side by side.

    ``index`` (n_row,) are the samples at which the rows begin. ``transition`` (order, order) is the state matrix of the
    largest order. Those of lower orders are its leading blocks, corrected by ``last_row`` where this is not None.
    """

    u: np.ndarray
    index: np.ndarray
    transition: np.ndarray
    last_row: np.ndarray | None

    def state_matrix(self, order: int) -> np.ndarray:
        """One-sample state matrix of an order.

        Parameters
        ----------
        order : int
            Number of states, at most that of the subspace.

        Returns
        -------
        (order, order) array of float
            State matrix, in the coordinates of the first ``order`` singular vectors.
        """
        block = self.transition[:order, :order]
        if self.last_row is None:
            return block
        row = self.last_row[:order]
        return block + np.outer(row, row @ block) / max(1.0 - row @ row, 1e-12)


def subspaces(decays: np.ndarray, rows: int, order: int, starts: Sequence[int] = (0,)) -> list[Subspace]:
    r"""Signal subspace of the decays for each start sample.

    Up to ``MAX_ROWS`` rows the state matrix is the least squares solution of :math:`U_\uparrow A = U_\downarrow`.
    A longer record uses only every q-th row over its full length. :math:`A = S^{-1} U^T H_1 V S^{-1}` still advances by
    one sample, so there is no decimation and no aliasing.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rows : int
        Rows of the Hankel matrices.
    order : int
        Largest order.
    starts : sequence of int
        Numbers of leading samples that are skipped.

    Returns
    -------
    list of Subspace
        One subspace for each start sample.
    """
    stride = -(-rows // MAX_ROWS)
    if stride == 1:
        return [_subspace_by_shift(gram, order) for gram in gram_matrices(decays, rows, starts)]
    return [_subspace_by_stride(decays, rows, order, start, stride) for start in starts]


def _leading_eigenpairs(gram: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    n = len(gram)
    w, u = eigh(gram, subset_by_index=(n - order, n - 1))
    return w[::-1], u[:, ::-1]


def _subspace_by_shift(gram: np.ndarray, order: int) -> Subspace:
    _, u = _leading_eigenpairs(gram[:-1, :-1], order)
    return Subspace(u, np.arange(len(u)), u[:-1].T @ u[1:], u[-1])


def _subspace_by_stride(decays: np.ndarray, rows: int, order: int, start: int, stride: int) -> Subspace:
    index = np.arange(0, rows, stride)
    columns = decays.shape[1] - rows
    products = np.zeros((2, len(index), len(index)))
    for y in decays:
        windows = np.lib.stride_tricks.sliding_window_view(y[start:], columns - start)
        current, next_sample = windows[index], windows[index + 1]
        products += current @ current.T, next_sample @ current.T
    w, u = _leading_eigenpairs(products[0], order)
    return Subspace(u, index, (u.T @ products[1] @ u) / np.maximum(w, np.finfo(float).tiny), None)
