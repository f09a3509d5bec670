"""Is a mode, or a drift, in the data? Chi-squared tests of amplitudes, per blow and over all blows."""

import numpy as np
from scipy.stats import chi2

from turnout.identify.linearise import Linearisation


def mode_chi_squared(at: Linearisation, sigma2: float) -> np.ndarray:
    r"""Squared amplitude of each mode in each blow over its own covariance: chi-squared(2) if it is not there.

    .. math:: \chi^2 = a^T \left(\sigma^2 [(B^T B)^{-1}]_{mm}\right)^{-1} a

    Returns (n_decay, n_mode); ``sigma2`` is the variance of the noise.
    """
    n_mode = at.amplitude.shape[1]
    inverse = np.linalg.inv(at.gram)
    cosine, sine = np.arange(n_mode), n_mode + np.arange(n_mode)
    cc, ss, cs = inverse[:, cosine, cosine], inverse[:, sine, sine], inverse[:, cosine, sine]
    a, b = at.coefficient[:, cosine], at.coefficient[:, sine]
    return (a**2 * ss - 2.0 * a * b * cs + b**2 * cc) / (np.maximum(cc * ss - cs**2, 1e-300) * sigma2)


def columns_chi_squared(at: Linearisation, sigma2: float, columns) -> float:
    """Chi-squared(n_decay times columns) that these columns of the model (a drift, a hum) are not needed."""
    columns = np.asarray(columns)
    block = np.linalg.inv(at.gram)[:, columns[:, None], columns]
    value = at.coefficient[:, columns]
    return float(np.sum(value * np.linalg.solve(block, value[..., None])[..., 0]) / sigma2)


def common_probability(statistic: np.ndarray) -> np.ndarray:
    """Probability of the sum over blows of chi-squared(2) values, if the mode is not there; (n_mode,).

    >>> print(common_probability(np.array([[0.0], [0.0]])))
    [1.]
    """
    return chi2.sf(statistic.sum(axis=0), 2 * len(statistic))


def share_of_blows(statistic: np.ndarray, probability: float = 0.01) -> np.ndarray:
    """Share of blows in which the mode shows by itself at ``probability``; (n_mode,)."""
    return (statistic > chi2.isf(probability, 2)).mean(axis=0)
