"""Compiled step of the fit with a mode for each impact: single estimates, their spread, mean and shrinkage."""

import numpy as np

from turnout.kernel_cache import kernel
from turnout.modal.wave_kernels import factorise

RIDGE = 1e-10  # keeps matrices of two nearly equal modes invertible; distinct modes differ by 1e-6 and more
SMALLEST = 1e-300


@kernel
def inverse(matrix: np.ndarray, result: np.ndarray, factor: np.ndarray) -> None:
    """Inverse of a positive definite matrix, scaled to a unit diagonal with ``RIDGE`` added.

    Parameters
    ----------
    matrix, result, factor : (n, n) array of float
        The matrix, its inverse (filled in), and work space.
    """
    n = len(matrix)
    scale = np.empty(n)
    for i in range(n):
        scale[i] = 1.0 / np.sqrt(max(matrix[i, i], SMALLEST))
    for i in range(n):
        for j in range(i + 1):
            factor[i, j] = matrix[i, j] * scale[i] * scale[j]
        factor[i, i] += RIDGE
    factorise(factor, RIDGE)
    # the inverse of the factor above the diagonal, transposed
    for j in range(n):
        result[j, j] = 1.0 / factor[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= factor[i, k] * result[j, k]
            result[j, i] = total / factor[i, i]
    for i in range(n):
        for j in range(i, n):
            total = 0.0
            for k in range(j, n):
                total += result[i, k] * result[j, k]
            result[i, j] = total
    for i in range(n):
        for j in range(i, n):
            result[i, j] *= scale[i] * scale[j]
            result[j, i] = result[i, j]


@kernel
def spread_between(value: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Variance between estimates in excess of their own, as :func:`turnout.modal.mixed_effects.between_variance`.

    Parameters
    ----------
    value, variance : (n, p) array of float
        Estimates and their variances.

    Returns
    -------
    (p,) array of float
        Variance between the estimates; 0 for a single one.
    """
    n, p = value.shape
    spread = np.zeros(p)
    if n < 2:
        return spread
    for j in range(p):
        total, total_square, mean, q = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            weight = 1.0 / variance[i, j]
            total += weight
            total_square += weight * weight
            mean += weight * value[i, j]
        mean /= total
        for i in range(n):
            q += (value[i, j] - mean) ** 2 / variance[i, j]
        spread[j] = max(0.0, (q - (n - 1)) / (total - total_square / total))
    return spread


@kernel
def shrink(
    theta: np.ndarray, information: np.ndarray, score: np.ndarray, sigma2: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Estimates of single decays by a linear step from ``theta``, shrunken towards their mean.

    Parameters
    ----------
    theta, score : (n_decay, p) array of float
        Parameters and J^T r of each decay.
    information : (n_decay, p, p) array of float
        J^T J of each decay.
    sigma2 : float
        Variance of the noise.

    Returns
    -------
    free (n_decay, p), covariance (n_decay, p, p), variance (n_decay, p), spread (p,), centre (p,), shrunken
        Estimates, their covariance and variances from the noise, variance between them, mean, shrunken estimates.
    """
    n, p = theta.shape
    covariance, weight = np.empty((n, p, p)), np.empty((n, p, p))
    free, variance, shrunken = theta.copy(), np.empty((n, p)), np.empty((n, p))
    factor, matrix, total, result = np.empty((p, p)), np.empty((p, p)), np.zeros((p, p)), np.empty((p, p))
    weighted, centre = np.zeros(p), np.zeros(p)
    for d in range(n):
        inverse(information[d], covariance[d], factor)
        for i in range(p):
            step = 0.0
            for j in range(p):
                step += covariance[d, i, j] * score[d, j]
            if np.isfinite(step):
                free[d, i] += step
        for i in range(p):
            for j in range(p):
                covariance[d, i, j] *= sigma2
            # Never below the variance with all other parameters known: rounding may turn that of twin poles negative.
            variance[d, i] = max(covariance[d, i, i], sigma2 / max(information[d, i, i], SMALLEST))
    spread = spread_between(free, variance)
    for d in range(n):
        matrix[:] = covariance[d]
        for i in range(p):
            matrix[i, i] += spread[i]
        inverse(matrix, weight[d], factor)
        for i in range(p):
            for j in range(p):
                total[i, j] += weight[d, i, j]
                weighted[i] += weight[d, i, j] * free[d, j]
    inverse(total, result, factor)
    for i in range(p):
        for j in range(p):
            centre[i] += result[i, j] * weighted[j]
    for d in range(n):
        for i in range(p):
            pull = 0.0
            for j in range(p):
                pull += weight[d, i, j] * (free[d, j] - centre[j])
            shrunken[d, i] = centre[i] + spread[i] * pull
    return free, covariance, variance, spread, centre, shrunken
