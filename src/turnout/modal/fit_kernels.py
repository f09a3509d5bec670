"""Compiled iterations of the fits of modes: shared modes of all decays, and modes of each impact."""

import numpy as np

from turnout.kernel_cache import kernel
from turnout.modal.mixed_kernels import SMALLEST, inverse, shrink
from turnout.modal.wave_kernels import fit_waves

SEARCH_RSS_STEPS = 4  # iterations over which an improvement is measured: steps may alternate between two values
SEARCH_RSS_STEP = 1.0  # improvement in variances of the noise that no choice depends on: limits are chi-squared of 2 n
SEARCH_EXCURSION = 0.002  # share of the sum of squares above its smallest value, of the order of a test's limit
SEARCH_RSS_SHARE = 0.1  # improvement in shares of the distance to go
MAX_REDUCTIONS = 8  # of a step that does not lower the sum of squares
REDUCTION = 0.4  # factor of each
NO_STEP = 1e-12  # step of ln f or zeta that is none


@kernel
def is_decided(rss: np.ndarray, sigma2: float, target_rss: float) -> bool:
    """Whether more iterations cannot change a choice of modes.

    The smallest sum of squares either no longer falls by ``SEARCH_RSS_STEP`` variances of the noise, or it falls by
    less than ``SEARCH_RSS_SHARE`` of its distance from ``target_rss``: a sequence whose improvements each are at most
    nine tenths of the one before never arrives there. A step that leads away from it says nothing yet.

    Parameters
    ----------
    rss : (n_iteration,) array of float
        Sums of squares so far.
    sigma2 : float
        Variance of the noise.
    target_rss : float
        Sum of squares that matters to the caller; -inf: none.

    Returns
    -------
    bool

    Examples
    --------
    >>> rss = [2000.0, 1012.0, 1010.0, 1009.5, 1008.5]
    >>> rss = np.array([*rss, 1008.2])  # 3.8 better than before, less than a tenth of the 58.2 to go
    >>> [is_decided(rss, 1.0, target) for target in (-np.inf, 950.0)]
    [False, True]
    >>> plateau = [2000.0, 1008.5, 1008.4, 1008.3, 1008.2]
    >>> [is_decided(np.array([*plateau, last]), 1.0, -np.inf) for last in (1008.1, 1020.0)]
    [True, False]
    """
    n = len(rss)
    if n < 2 + SEARCH_RSS_STEPS:
        return False
    before, recent, highest = rss[0], rss[n - SEARCH_RSS_STEPS], rss[n - SEARCH_RSS_STEPS]
    for i in range(n):
        if i < n - SEARCH_RSS_STEPS:
            before = min(before, rss[i])
        else:
            recent, highest = min(recent, rss[i]), max(highest, rss[i])
    lowest = min(before, recent)
    if highest > (1.0 + SEARCH_EXCURSION) * lowest:
        return False
    improvement = before - lowest
    if improvement < SEARCH_RSS_STEP * sigma2:
        return True
    return target_rss > -np.inf and improvement < SEARCH_RSS_SHARE * (lowest - target_rss)


@kernel
def iterate_mixed(
    theta: np.ndarray,
    rate: float,
    decays: np.ndarray,
    columns: np.ndarray,
    power_sums: np.ndarray,
    dof: int,
    iterations: int,
    tolerance: float,
    is_search: bool,
    target_rss: float,
    limits: tuple[float, float, float, float],
) -> tuple:
    """Iterations of :func:`turnout.modal.mixed_effects.fit_mixed`.

    Parameters
    ----------
    theta : (n_impact, n_mode, 2) array of float
        Modes at the start.
    rate : float
        Sampling rate. [Hz]
    decays : (n_impact, n_response, n) array of float
        Decays of each impact.
    columns, power_sums : (n_column, n) array of float, (3, n_term) array of float
        As in :func:`~turnout.modal.wave_kernels.fit_waves`.
    dof : int
        Degrees of freedom of the residual.
    iterations, tolerance, is_search, target_rss
        As in ``fit_mixed``; ``target_rss`` -inf where there is none.
    limits : (float, float, float, float)
        Largest steps of ln f and zeta, smallest and largest damping ratio.

    Returns
    -------
    tuple
        theta, what ``fit_waves`` returns at it, what ``shrink`` returns, variance of the noise, and convergence.
    """
    n_impact, n_mode = theta.shape[:2]
    p = 2 * n_mode
    rss = np.empty(iterations)
    count = 0
    while True:
        fit = fit_waves(theta, rate, decays, columns, power_sums)
        rss[count] = fit[3].sum()
        count += 1
        sigma2 = max(rss[count - 1] / dof, SMALLEST)
        step = shrink(theta.reshape(n_impact, p), fit[5].sum(axis=1), fit[4].sum(axis=1), sigma2)
        _, _, variance, spread, _, shrunken = step
        following, change = np.empty_like(theta), 0.0
        for d in range(n_impact):
            for m in range(n_mode):
                for i in range(2):
                    old = theta[d, m, i]
                    new = old + min(max(shrunken[d, 2 * m + i] - old, -limits[i]), limits[i])
                    if i == 1:
                        new = min(max(new, limits[2]), limits[3])
                    following[d, m, i] = new
                    moved = abs(new - old) / np.sqrt(variance[d, 2 * m + i] + spread[2 * m + i])
                    change = moved if moved > change or np.isnan(moved) else change  # stays not a number
        converged = bool(change < tolerance) and count > 1
        converged = converged or (is_search and is_decided(rss[:count], sigma2, target_rss))
        if converged or count == iterations:
            return theta, fit, step, sigma2, converged
        theta = following


@kernel
def iterate_common(
    mean: np.ndarray,
    rate: float,
    decays: np.ndarray,
    columns: np.ndarray,
    power_sums: np.ndarray,
    dof: int,
    omitted_power: float,
    iterations: int,
    tolerance: float,
    limits: tuple[float, float, float, float],
) -> tuple:
    """Iterations of :func:`turnout.modal.mixed_effects.fit_common`.

    Parameters
    ----------
    mean : (n_mode, 2) array of float
        Modes at the start.
    rate : float
        Sampling rate. [Hz]
    decays : (1, n_decay, n) array of float
        All decays.
    columns, power_sums : (n_column, n) array of float, (3, n_term) array of float
        As in :func:`~turnout.modal.wave_kernels.fit_waves`.
    dof : int
        Degrees of freedom of the residual.
    omitted_power : float
        Sum of squares that is not in the decays.
    iterations : int
        Largest number of iterations.
    tolerance : float
        Step in standard errors at which the fit has converged.
    limits : (float, float, float, float)
        Largest steps of ln f and zeta, smallest and largest damping ratio.

    Returns
    -------
    tuple
        Modes, what ``fit_waves`` returns at them, and convergence.
    """
    n_mode = len(mean)
    p = 2 * n_mode
    result, factor = np.empty((p, p)), np.empty((p, p))
    fit = fit_waves(mean.reshape(1, n_mode, 2), rate, decays, columns, power_sums)
    for _ in range(iterations):
        information, score = fit[5][0].sum(axis=0), fit[4][0].sum(axis=0)
        inverse(information, result, factor)
        step = result @ score
        gain, scale = 0.0, 1.0
        for i in range(p):
            gain += step[i] * score[i]
            scale = min(scale, limits[i % 2] / max(abs(step[i]), SMALLEST))
        rss = fit[3].sum()
        size = np.sqrt(max(0.0, gain) / max((rss + omitted_power) / dof, SMALLEST))
        is_better = False
        trial, moved, candidate = mean, 0.0, fit
        for _ in range(MAX_REDUCTIONS):
            trial, moved = np.empty_like(mean), 0.0
            for m in range(n_mode):
                trial[m, 0] = mean[m, 0] + scale * step[2 * m]
                trial[m, 1] = min(max(mean[m, 1] + scale * step[2 * m + 1], limits[2]), limits[3])
                moved = max(moved, abs(trial[m, 0] - mean[m, 0]), abs(trial[m, 1] - mean[m, 1]))
            candidate = fit_waves(trial.reshape(1, n_mode, 2), rate, decays, columns, power_sums)
            if candidate[3].sum() <= rss:
                is_better = True
                break
            scale *= REDUCTION
        if not is_better:
            return mean, fit, True
        mean, fit = trial, candidate
        if moved < NO_STEP or size < tolerance:
            return mean, fit, True
    return mean, fit, False
