"""Coloured noise: an autoregressive model of what the modes leave, and decays whitened by it."""

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter


def noise_filter(residual, order_maximum: int) -> np.ndarray:
    r"""Whitening filter of residuals, its order by the Bayesian information criterion.

    .. math:: e_k = \sum_{j=0}^p a_j r_{k-j}, \quad a_0 = 1

    ``residual`` is (n_decay, n); returns (p + 1,) coefficients, [1.] for white noise.

    References
    ----------
    Yule-Walker equations on the pooled autocovariance; Schwarz 1978.

    Examples
    --------
    >>> white = np.random.default_rng(1).standard_normal((5, 400))
    >>> noise_filter(white, 6)
    array([1.])
    """
    n = residual.size
    length = residual.shape[1]
    lags = np.array([np.sum(residual[:, : length - k] * residual[:, k:]) for k in range(order_maximum + 1)]) / n
    best, chosen = n * np.log(max(lags[0], 1e-300)), np.ones(1)
    for order in range(1, order_maximum + 1):
        if not lags[0] > 0.0:
            break
        a = solve_toeplitz(lags[:order], lags[1 : order + 1])
        variance = lags[0] - a @ lags[1 : order + 1]
        criterion = n * np.log(max(variance, 1e-300)) + order * np.log(n)
        if criterion < best:
            best, chosen = criterion, np.concatenate(([1.0], -a))
    return chosen


def whiten(decays, whitening) -> np.ndarray:
    """Decays through the whitening filter, without the samples it needs to fill; poles stay as they are.

    A sum of exponentials through a finite filter is the same sum with other amplitudes.

    >>> whiten(np.array([[1.0, 0.5, 0.25]]), np.array([1.0, -0.5]))
    array([[0., 0.]])
    """
    order = len(whitening) - 1
    return lfilter(whitening, 1.0, decays, axis=-1)[:, order:] if order else decays
