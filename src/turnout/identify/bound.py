"""Cramér-Rao bound of frequencies and damping ratios for the decays that were used."""

import numpy as np

from turnout.identify.linearise import drift_columns, linearise


def cramer_rao_bound(theta, decays, rate, sigma2, columns=None):
    r"""Smallest standard errors that any unbiased estimator can have: poles shared, amplitudes free in each decay.

    .. math:: \mathrm{cov} \ge \sigma^2 \left(\sum_i J_i^T J_i\right)^{-1}

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) array of float
        True (or estimated) ln f [Hz] and zeta of each decay; the bound is for their common mean if they agree.
    decays : (n_decay, n) array of float
        They only set the amplitudes.
    rate : float
        [Hz]
    sigma2 : float or (n_decay,) array
        Variance of the white noise of each decay.
    columns : (n_column, n) array of float, optional
        What has to be estimated too, free in each decay: drift, hum.

    Returns
    -------
    (n_mode, 2) array of float
        Standard errors of ln f (relative) and of zeta.

    References
    ----------
    Rao 1945; for damped sinusoids Yao and Pandit 1995.
    """
    columns = drift_columns(decays.shape[1], -1) if columns is None else columns
    at = linearise(theta, decays, rate, columns)
    weight = 1.0 / np.broadcast_to(sigma2, len(decays))
    information = np.einsum("i,ijk->jk", weight, at.information)
    scale = np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return np.sqrt(np.diag(covariance)).reshape(-1, 2)
