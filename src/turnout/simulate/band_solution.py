"""Solution of factorised banded systems, compiled: from one end, from both ends, and of several right-hand sides."""

import numpy as np

from turnout.kernel_cache import borrowing_kernel


@borrowing_kernel
def solve(
    lower_rows: np.ndarray, upper: np.ndarray, inverse_pivot: np.ndarray, x: np.ndarray, start: int, n: int
) -> None:
    """Solve in place for ``x[start:start+n]``; unrolled for four or six diagonals.

    Parameters
    ----------
    lower_rows : (n, width) array
        Rows of L as ``factorise`` fills them: ``[i, k]`` is L[i, i - 1 - k].
    upper : (n, width) array
        Rows of L^T from ``upper_rows``: ``[i, k]`` is L[i + 1 + k, i].
    inverse_pivot : (n,) array
        Inverse of each pivot.
    x : (n_padded,) array
        Right-hand side; overwritten with the solution.
    start : int
        Index in ``x`` of the first row.
    n : int
        Number of rows of the matrix.
    """
    width = lower_rows.shape[1]
    segment = x[start : start + n]
    if width == 4:
        _solve4(lower_rows, upper, inverse_pivot, segment, n)
    elif width == 6:
        _solve6(lower_rows, upper, inverse_pivot, segment, n)
    else:
        _solve_any(lower_rows, upper, inverse_pivot, segment, n)


@borrowing_kernel
def _solve4(low: np.ndarray, up: np.ndarray, inverse_pivot: np.ndarray, x: np.ndarray, n: int) -> None:
    a = 0.0 * x[0]
    b, c, d = a, a, a
    for i in range(n):
        s = x[i] - low[i, 3] * d - low[i, 2] * c - low[i, 1] * b - low[i, 0] * a
        d, c, b, a = c, b, a, s
        x[i] = s
    a = 0.0 * x[0]
    b, c, d = a, a, a
    for i in range(n - 1, -1, -1):
        s = x[i] * inverse_pivot[i] - up[i, 3] * d - up[i, 2] * c - up[i, 1] * b - up[i, 0] * a
        d, c, b, a = c, b, a, s
        x[i] = s


@borrowing_kernel
def _solve6(low: np.ndarray, up: np.ndarray, inverse_pivot: np.ndarray, x: np.ndarray, n: int) -> None:
    a = 0.0 * x[0]
    b, c, d, e, f = a, a, a, a, a
    for i in range(n):
        s = x[i] - low[i, 5] * f - low[i, 4] * e - low[i, 3] * d
        s = s - low[i, 2] * c - low[i, 1] * b - low[i, 0] * a
        f, e, d, c, b, a = e, d, c, b, a, s
        x[i] = s
    a = 0.0 * x[0]
    b, c, d, e, f = a, a, a, a, a
    for i in range(n - 1, -1, -1):
        s = x[i] * inverse_pivot[i] - up[i, 5] * f - up[i, 4] * e - up[i, 3] * d
        s = s - up[i, 2] * c - up[i, 1] * b - up[i, 0] * a
        f, e, d, c, b, a = e, d, c, b, a, s
        x[i] = s


@borrowing_kernel
def _solve_any(low: np.ndarray, up: np.ndarray, inverse_pivot: np.ndarray, x: np.ndarray, n: int) -> None:
    half = low.shape[1]
    for i in range(n):
        s = x[i]
        for k in range(min(half, i)):
            s -= low[i, k] * x[i - 1 - k]
        x[i] = s
    for i in range(n - 1, -1, -1):
        s = x[i] * inverse_pivot[i]
        for k in range(min(half, n - 1 - i)):
            s -= up[i, k] * x[i + 1 + k]
        x[i] = s


LANES = 8  # right-hand sides that ``solve_lanes`` takes at once: as long as a row of eight waits for the last


@borrowing_kernel
def solve_lanes(low: np.ndarray, up: np.ndarray, pivot: np.ndarray, x: np.ndarray, n: int) -> None:
    """Solve in place with four diagonals for ``LANES`` complex right-hand sides at once.

    Each row waits for the rows before it, but right-hand sides do not wait for each other. Slices with indices counted
    from 0 let the inner loops be vectorised.

    Parameters
    ----------
    low : (n, 4) array of complex
        Rows of L as ``factorise4`` fills them: ``[i, k]`` is L[i, i - 1 - k].
    up : (n, 4) array of complex
        Rows of L^T: ``[i, k]`` is L[i + 1 + k, i].
    pivot : (n,) array of complex
        Inverse of each pivot.
    x : (2 (n + 8) LANES,) array of float
        For each row the real parts of all right-hand sides, then the imaginary parts; overwritten with the solutions.
        Four rows of zeros come first, and four last.
    n : int
        Number of rows of the matrix.
    """
    m, row = LANES, 2 * LANES
    for i in range(n):
        w = x[i * row : (i + 5) * row]
        a, b, c, d = low[i, 0], low[i, 1], low[i, 2], low[i, 3]
        for r in range(m):
            real = w[4 * row + r] - a.real * w[3 * row + r] - b.real * w[2 * row + r] - c.real * w[row + r]
            imag = w[4 * row + m + r] - a.real * w[3 * row + m + r] - b.real * w[2 * row + m + r]
            real += a.imag * w[3 * row + m + r] + b.imag * w[2 * row + m + r] + c.imag * w[row + m + r]
            imag -= a.imag * w[3 * row + r] + b.imag * w[2 * row + r] + c.imag * w[row + r]
            w[4 * row + r] = real - d.real * w[r] + d.imag * w[m + r]
            w[4 * row + m + r] = imag - c.real * w[row + m + r] - d.real * w[m + r] - d.imag * w[r]
    for i in range(n - 1, -1, -1):
        w = x[(i + 4) * row : (i + 9) * row]
        a, b, c, d, p = up[i, 0], up[i, 1], up[i, 2], up[i, 3], pivot[i]
        for r in range(m):
            real = p.real * w[r] - p.imag * w[m + r] - a.real * w[row + r] - b.real * w[2 * row + r]
            imag = p.real * w[m + r] + p.imag * w[r] - a.real * w[row + m + r] - b.real * w[2 * row + m + r]
            real += a.imag * w[row + m + r] + b.imag * w[2 * row + m + r] + c.imag * w[3 * row + m + r]
            imag -= a.imag * w[row + r] + b.imag * w[2 * row + r] + c.imag * w[3 * row + r]
            real += d.imag * w[4 * row + m + r] - c.real * w[3 * row + r] - d.real * w[4 * row + r]
            imag -= d.imag * w[4 * row + r] + c.real * w[3 * row + m + r] + d.real * w[4 * row + m + r]
            w[r] = real
            w[m + r] = imag


@borrowing_kernel
def solve_from_both_ends(
    low: np.ndarray,
    up: np.ndarray,
    pivot: np.ndarray,
    low_back: np.ndarray,
    up_back: np.ndarray,
    pivot_back: np.ndarray,
    middle: np.ndarray,
    x: np.ndarray,
    start: int,
    n: int,
) -> None:
    """Solve in place with four diagonals, eliminating from both ends to four rows in the middle.

    Two independent recurrences run in parallel, so that neither waits for the last product of the other.
    ``low_back`` ... are the factors of the reversed matrix, ``middle`` (4, 4) is the middle block of the inverse.

    Parameters
    ----------
    low : (n, 4) array
        Rows of L of the matrix.
    up : (n, 4) array
        Rows of L^T of the matrix.
    pivot : (n,) array
        Inverse pivots of the matrix.
    low_back : (n, 4) array
        Rows of L of the reversed matrix.
    up_back : (n, 4) array
        Rows of L^T of the reversed matrix.
    pivot_back : (n,) array
        Inverse pivots of the reversed matrix.
    middle : (4, 4) array
        Block of the inverse at the rows (n - 4) // 2 to (n - 4) // 2 + 3.
    x : (n_padded,) array
        Right-hand side; overwritten with the solution.
    start : int
        Index in ``x`` of the first row.
    n : int
        Number of rows of the matrix, at least 16.
    """
    segment = x[start : start + n]
    top = (n - 4) // 2
    bottom = n - 4 - top
    last = n - 1
    zero = 0.0 * segment[0]
    a, b, c, d, e, f, g, h = zero, zero, zero, zero, zero, zero, zero, zero
    for i in range(top):
        s = segment[i] - low[i, 3] * d - low[i, 2] * c - low[i, 1] * b - low[i, 0] * a
        t = segment[last - i] - low_back[i, 3] * h - low_back[i, 2] * g - low_back[i, 1] * f - low_back[i, 0] * e
        d, c, b, a = c, b, a, s
        h, g, f, e = g, f, e, t
        segment[i] = s
        segment[last - i] = t
    for i in range(top, bottom):
        t = segment[last - i] - low_back[i, 3] * h - low_back[i, 2] * g - low_back[i, 1] * f - low_back[i, 0] * e
        h, g, f, e = g, f, e, t
        segment[last - i] = t
    r0 = segment[top] - low[top, 0] * a - low[top, 1] * b - low[top, 2] * c - low[top, 3] * d
    r1 = segment[top + 1] - low[top + 1, 1] * a - low[top + 1, 2] * b - low[top + 1, 3] * c
    r2 = segment[top + 2] - low[top + 2, 2] * a - low[top + 2, 3] * b
    r3 = segment[top + 3] - low[top + 3, 3] * a
    r3 = r3 - low_back[bottom, 0] * e - low_back[bottom, 1] * f - low_back[bottom, 2] * g - low_back[bottom, 3] * h
    r2 = r2 - low_back[bottom + 1, 1] * e - low_back[bottom + 1, 2] * f - low_back[bottom + 1, 3] * g
    r1 = r1 - low_back[bottom + 2, 2] * e - low_back[bottom + 2, 3] * f
    r0 = r0 - low_back[bottom + 3, 3] * e
    a = middle[0, 0] * r0 + middle[0, 1] * r1 + middle[0, 2] * r2 + middle[0, 3] * r3
    b = middle[1, 0] * r0 + middle[1, 1] * r1 + middle[1, 2] * r2 + middle[1, 3] * r3
    c = middle[2, 0] * r0 + middle[2, 1] * r1 + middle[2, 2] * r2 + middle[2, 3] * r3
    d = middle[3, 0] * r0 + middle[3, 1] * r1 + middle[3, 2] * r2 + middle[3, 3] * r3
    segment[top], segment[top + 1], segment[top + 2], segment[top + 3] = a, b, c, d
    e, f, g, h = d, c, b, a
    for i in range(bottom - 1, top - 1, -1):
        t = segment[last - i] * pivot_back[i] - up_back[i, 3] * h - up_back[i, 2] * g
        t = t - up_back[i, 1] * f - up_back[i, 0] * e
        h, g, f, e = g, f, e, t
        segment[last - i] = t
    for i in range(top - 1, -1, -1):
        s = segment[i] * pivot[i] - up[i, 3] * d - up[i, 2] * c - up[i, 1] * b - up[i, 0] * a
        t = segment[last - i] * pivot_back[i] - up_back[i, 3] * h - up_back[i, 2] * g
        t = t - up_back[i, 1] * f - up_back[i, 0] * e
        d, c, b, a = c, b, a, s
        h, g, f, e = g, f, e, t
        segment[i] = s
        segment[last - i] = t


@borrowing_kernel
def solve6_from_both_ends(
    low: np.ndarray,
    up: np.ndarray,
    pivot: np.ndarray,
    low_back: np.ndarray,
    up_back: np.ndarray,
    pivot_back: np.ndarray,
    middle: np.ndarray,
    x: np.ndarray,
    start: int,
    n: int,
) -> None:
    """``solve_from_both_ends`` with six diagonals, as a track with a blade has them.

    Parameters
    ----------
    low : (n, 6) array
        Rows of L of the matrix.
    up : (n, 6) array
        Rows of L^T of the matrix.
    pivot : (n,) array
        Inverse pivots of the matrix.
    low_back : (n, 6) array
        Rows of L of the reversed matrix.
    up_back : (n, 6) array
        Rows of L^T of the reversed matrix.
    pivot_back : (n,) array
        Inverse pivots of the reversed matrix.
    middle : (6, 6) array
        Block of the inverse at the rows (n - 6) // 2 to (n - 6) // 2 + 5.
    x : (n_padded,) array
        Right-hand side; overwritten with the solution.
    start : int
        Index in ``x`` of the first row.
    n : int
        Number of rows of the matrix, at least 24.
    """
    segment = x[start : start + n]
    top = (n - 6) // 2
    bottom = n - 6 - top
    last = n - 1
    zero = 0.0 * segment[0]
    a, b, c, d, e, f = zero, zero, zero, zero, zero, zero
    g, h, o, p, q, r = zero, zero, zero, zero, zero, zero
    for i in range(top):
        s = segment[i] - low[i, 5] * f - low[i, 4] * e - low[i, 3] * d
        t = segment[last - i] - low_back[i, 5] * r - low_back[i, 4] * q - low_back[i, 3] * p
        s = s - low[i, 2] * c - low[i, 1] * b - low[i, 0] * a
        t = t - low_back[i, 2] * o - low_back[i, 1] * h - low_back[i, 0] * g
        f, e, d, c, b, a = e, d, c, b, a, s
        r, q, p, o, h, g = q, p, o, h, g, t
        segment[i] = s
        segment[last - i] = t
    for i in range(top, bottom):
        t = segment[last - i] - low_back[i, 5] * r - low_back[i, 4] * q - low_back[i, 3] * p
        t = t - low_back[i, 2] * o - low_back[i, 1] * h - low_back[i, 0] * g
        r, q, p, o, h, g = q, p, o, h, g, t
        segment[last - i] = t
    above, below = (a, b, c, d, e, f), (g, h, o, p, q, r)
    for j in range(6):
        s = segment[top + j]
        for k in range(j, 6):
            s -= low[top + j, k] * above[k - j]
        for k in range(5 - j, 6):
            s -= low_back[bottom + 5 - j, k] * below[k - 5 + j]
        segment[top + j] = s
    inner = segment[top : top + 6]
    right = (inner[0], inner[1], inner[2], inner[3], inner[4], inner[5])
    for j in range(6):
        s = zero
        for k in range(6):
            s += middle[j, k] * right[k]
        inner[j] = s
    a, b, c, d, e, f = inner[0], inner[1], inner[2], inner[3], inner[4], inner[5]
    g, h, o, p, q, r = f, e, d, c, b, a
    for i in range(bottom - 1, top - 1, -1):
        t = segment[last - i] * pivot_back[i] - up_back[i, 5] * r - up_back[i, 4] * q - up_back[i, 3] * p
        t = t - up_back[i, 2] * o - up_back[i, 1] * h - up_back[i, 0] * g
        r, q, p, o, h, g = q, p, o, h, g, t
        segment[last - i] = t
    for i in range(top - 1, -1, -1):
        s = segment[i] * pivot[i] - up[i, 5] * f - up[i, 4] * e - up[i, 3] * d
        t = segment[last - i] * pivot_back[i] - up_back[i, 5] * r - up_back[i, 4] * q - up_back[i, 3] * p
        s = s - up[i, 2] * c - up[i, 1] * b - up[i, 0] * a
        t = t - up_back[i, 2] * o - up_back[i, 1] * h - up_back[i, 0] * g
        f, e, d, c, b, a = e, d, c, b, a, s
        r, q, p, o, h, g = q, p, o, h, g, t
        segment[i] = s
        segment[last - i] = t
