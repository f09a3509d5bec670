"""Cubic spline on a uniform grid, C2, with straight ends."""

import numpy as np

from turnout.simulate.compiled import kernel


@kernel
def _second_differences(value, out):
    """Solve m[i-1] + 4 m[i] + m[i+1] = 6 (value[i-1] - 2 value[i] + value[i+1]), m = 0 at both ends."""
    n = value.size
    factor = np.zeros(n)
    for i in range(1, n - 1):
        pivot = 1.0 / (4.0 - factor[i - 1])
        factor[i] = pivot
        out[i] = (6.0 * (value[i - 1] - 2.0 * value[i] + value[i + 1]) - out[i - 1]) * pivot
    for i in range(n - 2, 0, -1):
        out[i] -= factor[i] * out[i + 1]


def uniform_pieces(value):
    """(n - 1, 4) coefficients, highest power first, of the natural cubic spline through ``value`` (n,), unit steps.

    >>> pieces = uniform_pieces(np.array([0.0, 1.0, 2.0, 3.0]))
    >>> bool(np.allclose(pieces, [[0, 0, 1, 0], [0, 0, 1, 1], [0, 0, 1, 2]]))
    True
    """
    value = np.ascontiguousarray(value, dtype=float)
    m = np.zeros(value.size)
    _second_differences(value, m)
    a, b = m[:-1], m[1:]
    slope = np.diff(value) - (2.0 * a + b) / 6.0
    return np.column_stack([(b - a) / 6.0, 0.5 * a, slope, value[:-1]])


def uniform_spline(value, start, step, x):
    """Natural cubic spline through ``value`` at ``start`` + k ``step``, at ``x``; 0 outside the grid."""
    pieces = uniform_pieces(value)
    place = (np.asarray(x, dtype=float) - start) / step
    k = np.clip(np.floor(place).astype(np.int64), 0, len(pieces) - 1)
    r = place - k
    c = pieces[k]
    found = ((c[..., 0] * r + c[..., 1]) * r + c[..., 2]) * r + c[..., 3]
    return np.where((place >= 0.0) & (place <= len(pieces)), found, 0.0)
