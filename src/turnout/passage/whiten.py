"""A filter that makes a sensor's noise white, so that sums of squares may be tested."""

from __future__ import annotations

import numpy as np
from scipy import linalg


def whitener(quiet, order: int = 16) -> tuple[np.ndarray, float]:
    """Taps (order + 1,) of the prediction-error filter of ``quiet`` (n,), and the standard deviation it leaves.

    Yule-Walker on the biased autocovariance: always stable, exact for autoregressive noise as n grows. ValueError
    for fewer than ten samples per tap.

    >>> rng = np.random.default_rng(0)
    >>> taps, noise = whitener(3.0 * rng.standard_normal(20000), 4)
    >>> print(np.round(taps, 1) + 0.0, round(noise, 1))
    [1. 0. 0. 0. 0.] 3.0
    """
    quiet = np.asarray(quiet, dtype=float)
    quiet = quiet - quiet.mean()
    if quiet.size < 10 * (order + 1):
        raise ValueError(f"{quiet.size} quiet samples are too few for a filter of order {order}")
    n = 1 << int(np.ceil(np.log2(2 * quiet.size)))
    power = np.abs(np.fft.rfft(quiet, n)) ** 2
    covariance = np.fft.irfft(power)[: order + 1] / quiet.size
    if covariance[0] == 0.0:
        return np.eye(1, order + 1)[0], 0.0
    # a millionth of white noise: a converter's zeros must not make the matrix singular
    covariance[0] *= 1.0 + 1e-6
    coefficients = linalg.solve_toeplitz(covariance[:-1], covariance[1:])
    variance = covariance[0] - coefficients @ covariance[1:]
    return np.concatenate([[1.0], -coefficients]), float(np.sqrt(max(variance, 0.0)))
