"""Eigensystem realisation of free decays: exact, through FFT products and Lanczos, or a Gram matrix for several."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh, svds

from turnout.identify.hankel import gram_matrices, hankel_operator, hankel_rows
from turnout.identify.poles import modal_parameters

DENSE_BELOW = 64


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
        up = np.argsort(frequency)
        return frequency[up], damping[up]


def era(decay, order: int, rows: int | None = None, rate: float = 1.0) -> Realisation:
    r"""Eigensystem realisation algorithm for one or several free decays of one sensor.

    .. math:: H_0 = U S V^T, \quad A = S^{-1/2} U^T H_1 V S^{-1/2}, \quad c = U_0 S^{1/2}, \quad x_0 = S^{1/2} V_0^T

    One decay: the leading singular triplets come from Lanczos iterations on FFT products and agree with a full
    SVD to rounding. Several: all decays side by side, through the Gram matrix of their rows; the poles are
    common, every decay has its own initial state.

    Parameters
    ----------
    decay : (n,) or (n_decay, n) array of float
        Free decay from its first sample, unfiltered.
    order : int
        States kept, two per mode.
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


def _era_single(y, order, rows, rate):
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


def _largest_eigenpairs(h, order):
    """Eigenpairs of a symmetric operator that are largest in magnitude, largest first."""
    n = h.shape[0]
    if n < DENSE_BELOW or order >= n - 1:
        w, u = np.linalg.eigh(h @ np.eye(n))
    else:
        w, u = eigsh(h, k=order, which="LM", v0=_start(h), ncv=min(n, max(2 * order + 8, 20)))
    leading = np.argsort(-np.abs(w), kind="stable")[:order]
    return w[leading], u[:, leading]


def _largest_singular_triplets(h, order):
    n = min(h.shape)
    if n < DENSE_BELOW or order >= n - 1:
        u, s, vt = np.linalg.svd(h @ np.eye(h.shape[1]), full_matrices=False)
    else:
        # PROPACK-free route: eigenpairs of H H^T lose half of the digits, the augmented matrix keeps them.
        u, s, vt = svds(h, k=order, v0=None, solver="propack", rng=np.random.default_rng(1))
    leading = np.argsort(-s, kind="stable")[:order]
    return u[:, leading], s[leading], vt[leading].T


def _start(h: LinearOperator):
    """A start vector with a share in every singular vector that a decay can have: its own first column."""
    return h @ np.eye(1, h.shape[1]).ravel() + 1e-3 * np.random.default_rng(1).standard_normal(h.shape[0])


def _era_side_by_side(decays, order, rows, rate):
    (gram,) = gram_matrices(decays, rows)
    w, u = eigh(gram[:-1, :-1], subset_by_index=(rows - order, rows - 1))
    w, u = np.maximum(w[::-1], np.finfo(float).tiny), u[:, ::-1]
    s = np.sqrt(w)
    root = np.sqrt(s)
    a = (u.T @ gram[1:, :-1] @ u) / np.outer(root, root * s)
    first = np.stack([hankel_operator(y, rows).H @ u[:, k] for y in decays for k in range(order)])
    v0 = first[:, 0].reshape(len(decays), order) / s
    return Realisation(a, (root * v0).T, u[0] * root, s, rate)
