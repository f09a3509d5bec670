"""Factorise and multiply symmetric banded matrices; compiled, also the inverse near the diagonal."""

import numpy as np

from turnout.kernel_cache import borrowing_kernel, kernel


@kernel
def factorise(upper: np.ndarray, lower_rows: np.ndarray, inverse_pivot: np.ndarray) -> float:
    """L D L^T of a symmetric matrix without pivoting; returns the growth max|l| (a large one means lost digits).

    ``upper`` (half + 1, n) holds the upper diagonals; ``lower_rows[i, k]`` becomes L[i, i - 1 - k].

    Parameters
    ----------
    upper : (half + 1, n) array
        Upper diagonals of the matrix: ``[k, j]`` is A[j, j + k].
    lower_rows : (n, width) array
        Overwritten with the rows of L: ``[i, k]`` is L[i, i - 1 - k].
    inverse_pivot : (n,) array
        Overwritten with the inverse of each element of D.

    Returns
    -------
    float
        Growth: the largest |l|.
    """
    half, n = upper.shape[0] - 1, upper.shape[1]
    growth = 0.0
    scaled = np.zeros(half + 1, dtype=upper.dtype)
    for i in range(n):
        first = max(0, i - half)
        pivot = upper[0, i]
        for j in range(first, i):
            value = upper[i - j, j]
            for m in range(first, j):
                value -= scaled[m - first] * lower_rows[j, j - 1 - m]
            scaled[j - first] = value
            factor = value * inverse_pivot[j]
            lower_rows[i, i - 1 - j] = factor
            pivot -= value * factor
            growth = max(growth, abs(factor))
        inverse_pivot[i] = 1.0 / pivot
    return growth


@borrowing_kernel
def factorise4(a: np.ndarray, lower: np.ndarray, upper: np.ndarray, inverse_pivot: np.ndarray, n: int) -> float:
    """The same for half bandwidth 4 at most, unrolled: ``a`` (5, n + 4) is overwritten, ``lower`` has n + 4 rows.

    Parameters
    ----------
    a : (5, n + 4) array
        Upper diagonals, zero in the last 4 columns; overwritten.
    lower : (n + 4, 4) array
        Overwritten with the rows of L.
    upper : (n, 4) array
        Overwritten with the rows of L^T.
    inverse_pivot : (n,) array
        Overwritten with the inverse of each pivot.
    n : int
        Number of rows of the matrix.

    Returns
    -------
    float
        Growth: the largest root of the sum of squares of the factors of one row.
    """
    growth = 0.0
    for i in range(n):
        inverse = 1.0 / a[0, i]
        a1, a2, a3, a4 = a[1, i], a[2, i], a[3, i], a[4, i]
        l1, l2, l3, l4 = a1 * inverse, a2 * inverse, a3 * inverse, a4 * inverse
        a[0, i + 1] -= l1 * a1
        a[1, i + 1] -= l1 * a2
        a[2, i + 1] -= l1 * a3
        a[3, i + 1] -= l1 * a4
        a[0, i + 2] -= l2 * a2
        a[1, i + 2] -= l2 * a3
        a[2, i + 2] -= l2 * a4
        a[0, i + 3] -= l3 * a3
        a[1, i + 3] -= l3 * a4
        a[0, i + 4] -= l4 * a4
        inverse_pivot[i] = inverse
        upper[i, 0], upper[i, 1], upper[i, 2], upper[i, 3] = l1, l2, l3, l4
        lower[i + 1, 0], lower[i + 2, 1], lower[i + 3, 2], lower[i + 4, 3] = l1, l2, l3, l4
        size = l1.real**2 + l1.imag**2 + l2.real**2 + l2.imag**2
        growth = max(growth, size + l3.real**2 + l3.imag**2 + l4.real**2 + l4.imag**2)
    return np.sqrt(growth)


@kernel
def upper_rows(lower_rows: np.ndarray, n: int, half: int, width: int) -> np.ndarray:
    """Rows of L^T: ``out[i, k]`` is L[i + 1 + k, i].

    Parameters
    ----------
    lower_rows : (n, width) array
        Rows of L as ``factorise`` fills them: ``[i, k]`` is L[i, i - 1 - k].
    n : int
        Number of rows of the matrix.
    half : int
        Half bandwidth.
    width : int
        Columns of the result, at least ``half``.

    Returns
    -------
    (n, width) array
        Rows of L^T, 0 beyond the half bandwidth.
    """
    out = np.zeros((n, width), dtype=lower_rows.dtype)
    for k in range(half):
        for i in range(n - 1 - k):
            out[i, k] = lower_rows[i + 1 + k, k]
    return out


@borrowing_kernel
def multiply(diagonals: np.ndarray, x: np.ndarray, start: int, out: np.ndarray, n: int) -> None:
    """``out[:n]`` = matrix times ``x[start:start+n]``; ``diagonals`` (2 half + 1, n) from ``all_diagonals``.

    Parameters
    ----------
    diagonals : (2 half + 1, n) array of float
        All diagonals of the symmetric matrix.
    x : (n_padded,) array of float
        Vector with at least ``half`` entries before and after the part that is multiplied.
    start : int
        Index in ``x`` of the first row.
    out : (n_out,) array of float
        Its first ``n`` entries are overwritten with the product.
    n : int
        Number of rows of the matrix.
    """
    count = diagonals.shape[0]
    near = x[start - count // 2 : start + n + count // 2]  # indices counted from 0 let the loop be vectorised
    if count == 9:
        for i in range(n):
            low = diagonals[0, i] * near[i] + diagonals[1, i] * near[i + 1] + diagonals[2, i] * near[i + 2]
            mid = diagonals[3, i] * near[i + 3] + diagonals[4, i] * near[i + 4] + diagonals[5, i] * near[i + 5]
            high = diagonals[6, i] * near[i + 6] + diagonals[7, i] * near[i + 7] + diagonals[8, i] * near[i + 8]
            out[i] = low + mid + high
        return
    for i in range(n):
        out[i] = 0.0
    for k in range(count):
        for i in range(n):
            out[i] += diagonals[k, i] * near[i + k]


@borrowing_kernel
def momentum_minus_force(
    mass: np.ndarray,
    stiffness: np.ndarray,
    v: np.ndarray,
    u: np.ndarray,
    by_v: complex,
    by_u: complex,
    start: int,
    out: np.ndarray,
    n: int,
) -> None:
    """``out[start:start+n]`` = by_v M v - by_u K u, with all 9 or 13 diagonals in one pass.

    Parameters
    ----------
    mass : (9 or 13, n) array of float
        All diagonals of M. [kg]
    stiffness : (9 or 13, n) array of float
        All diagonals of K. [N/m]
    v : (n_padded,) array of float
        Velocity with as many entries around the part that is used as there are diagonals above the main one. [m/s]
    u : (n_padded,) array of float
        Displacement, padded like ``v``. [m]
    by_v : complex
        Factor of M v; real for the midpoint rule. [1/s]
    by_u : complex
        Factor of K u; real for the midpoint rule. [-]
    start : int
        Index of the first row in ``v``, ``u`` and ``out``.
    out : (n_padded,) array
        Overwritten from ``start`` on. [N]
    n : int
        Number of rows of the matrix.
    """
    half = mass.shape[0] // 2
    near_v, near_u = v[start - half : start + n + half], u[start - half : start + n + half]
    inner = out[start : start + n]
    if half == 6:
        for i in range(n):
            m = mass[0, i] * near_v[i] + mass[1, i] * near_v[i + 1] + mass[2, i] * near_v[i + 2]
            m += mass[3, i] * near_v[i + 3] + mass[4, i] * near_v[i + 4] + mass[5, i] * near_v[i + 5]
            m += mass[6, i] * near_v[i + 6] + mass[7, i] * near_v[i + 7] + mass[8, i] * near_v[i + 8]
            m += mass[9, i] * near_v[i + 9] + mass[10, i] * near_v[i + 10]
            m += mass[11, i] * near_v[i + 11] + mass[12, i] * near_v[i + 12]
            k = stiffness[0, i] * near_u[i] + stiffness[1, i] * near_u[i + 1] + stiffness[2, i] * near_u[i + 2]
            k += stiffness[3, i] * near_u[i + 3] + stiffness[4, i] * near_u[i + 4] + stiffness[5, i] * near_u[i + 5]
            k += stiffness[6, i] * near_u[i + 6] + stiffness[7, i] * near_u[i + 7] + stiffness[8, i] * near_u[i + 8]
            k += stiffness[9, i] * near_u[i + 9] + stiffness[10, i] * near_u[i + 10]
            k += stiffness[11, i] * near_u[i + 11] + stiffness[12, i] * near_u[i + 12]
            inner[i] = by_v * m - by_u * k
        return
    for i in range(n):
        m = mass[0, i] * near_v[i] + mass[1, i] * near_v[i + 1] + mass[2, i] * near_v[i + 2]
        m += mass[3, i] * near_v[i + 3] + mass[4, i] * near_v[i + 4] + mass[5, i] * near_v[i + 5]
        m += mass[6, i] * near_v[i + 6] + mass[7, i] * near_v[i + 7] + mass[8, i] * near_v[i + 8]
        k = stiffness[0, i] * near_u[i] + stiffness[1, i] * near_u[i + 1] + stiffness[2, i] * near_u[i + 2]
        k += stiffness[3, i] * near_u[i + 3] + stiffness[4, i] * near_u[i + 4] + stiffness[5, i] * near_u[i + 5]
        k += stiffness[6, i] * near_u[i + 6] + stiffness[7, i] * near_u[i + 7] + stiffness[8, i] * near_u[i + 8]
        inner[i] = by_v * m - by_u * k


def all_diagonals(upper: np.ndarray, half: int) -> np.ndarray:
    """(2 half + 1, n) diagonals of a symmetric matrix: ``out[k, i]`` is A[i, i + k - half].

    Parameters
    ----------
    upper : (n_diagonal, n) array of float
        Upper diagonals: ``[k, i]`` is A[i, i + k].
    half : int
        Half bandwidth of the result, at least n_diagonal - 1.

    Returns
    -------
    (2 half + 1, n) array of float
        Diagonal ``half`` is the main one; entries outside the matrix are 0.
    """
    n = upper.shape[1]
    out = np.zeros((2 * half + 1, n))
    for k in range(upper.shape[0]):
        out[half + k, : n - k] = upper[k, : n - k]
        out[half - k, k:] = upper[k, : n - k]
    return out


@kernel
def inverse_windows(lower_rows: np.ndarray, upper: np.ndarray, inverse_pivot: np.ndarray, reach: int) -> np.ndarray:
    """(n, 2 reach + 1) entries of the inverse near its diagonal: ``out[r, k]`` is inverse[r, r - reach + k].

    Parameters
    ----------
    lower_rows : (n, width) array
        Rows of L as ``factorise`` fills them: ``[i, k]`` is L[i, i - 1 - k].
    upper : (n, width) array
        Rows of L^T from ``upper_rows``: ``[i, k]`` is L[i + 1 + k, i].
    inverse_pivot : (n,) array
        Inverse of each pivot.
    reach : int
        Half width of the windows. [rows]

    Returns
    -------
    (n, 2 reach + 1) array
        Row r is computed as if the inverse were 0 beyond ``reach`` rows from r.
    """
    n = lower_rows.shape[0]
    out = np.zeros((n, 2 * reach + 1), dtype=lower_rows.dtype)
    width = lower_rows.shape[1]
    for r in range(n):
        row, last = out[r], min(n, r + reach + 1)
        row[reach] = 1.0
        for i in range(r + 1, last):
            s = row[0] * 0.0
            for k in range(min(width, i - r)):
                s -= lower_rows[i, k] * row[i - 1 - k - r + reach]
            row[i - r + reach] = s
        for i in range(last - 1, max(-1, r - reach - 1), -1):
            s = row[i - r + reach] * inverse_pivot[i]
            for k in range(min(width, last - 1 - i)):
                s -= upper[i, k] * row[i + 1 + k - r + reach]
            row[i - r + reach] = s
    return out
