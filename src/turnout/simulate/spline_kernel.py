"""Compiled kernel of the cubic spline through the path of a wheel."""

import numpy as np

from turnout.kernel_cache import kernel


@kernel
def second_differences(value: np.ndarray, out: np.ndarray) -> None:
    """Solve m[i-1] + 4 m[i] + m[i+1] = 6 (value[i-1] - 2 value[i] + value[i+1]), m = 0 at both ends.

    Parameters
    ----------
    value : (n,) array of float
        Values at equally spaced points.
    out : (n,) array of float
        Zeros; filled with the second derivatives m times the square of the spacing.
    """
    n = value.size
    factor = np.zeros(n)
    for i in range(1, n - 1):
        pivot = 1.0 / (4.0 - factor[i - 1])
        factor[i] = pivot
        out[i] = (6.0 * (value[i - 1] - 2.0 * value[i] + value[i + 1]) - out[i - 1]) * pivot
    for i in range(n - 2, 0, -1):
        out[i] -= factor[i] * out[i + 1]
