"""Estimate the modes of each impact and their mean together: maximum likelihood with a spread between impacts."""

from dataclasses import dataclass

import numpy as np

from turnout.modal.least_squares import Linearisation, linearise

MAX_STEP = np.array([0.2, 0.15])  # of ln f and of zeta in one iteration
SEARCH_RSS_STEPS = 4  # iterations over which an improvement is measured: steps may alternate between two values
SEARCH_RSS_STEP = 1.0  # improvement in variances of the noise that no choice depends on: limits are chi-squared of 2 n
SEARCH_EXCURSION = 0.002  # share of the sum of squares above its smallest value, of the order of a test's limit
SEARCH_RSS_SHARE = 0.1  # improvement in shares of the distance to go
MAX_PRINCIPAL = 8  # combinations of the decays that hold the signal
RIDGE = 1e-10  # keeps matrices of two nearly equal modes invertible; distinct modes differ by 1e-6 and more
MIN_DAMPING, MAX_DAMPING = 1e-5, 0.95  # damping ratios during the fit
MAX_FREQUENCY_STEP = np.log(2.0)  # of ln f in a single impact: an octave away it is another resonance


@dataclass(frozen=True)
class MixedFit:
    """Common modes, modes of each impact, and their covariance.

    ``mean`` (n_mode, 2) of ln f and zeta. ``theta`` (n_decay, n_mode, 2) are the modes of each impact, shrunken towards
    the mean according to their noise. ``unshrunken`` are these modes without shrinkage, linearised at ``theta``, with
    ``covariance`` (n_decay, p, p) from the noise alone. ``spread`` (p,) is the variance between impacts, ``sigma2``
    that of the noise. ``converged`` is False if the iteration was stopped.
    """

    mean: np.ndarray
    theta: np.ndarray
    unshrunken: np.ndarray
    covariance: np.ndarray
    spread: np.ndarray
    sigma2: float
    linearisation: Linearisation
    converged: bool
    is_limited: np.ndarray

    @property
    def shrunken_mean(self) -> np.ndarray:
        """(n_mode, 2) mean of the shrunken modes: a safe start, as its damping is always above zero."""
        return self.theta.mean(axis=0)

    @property
    def rss(self) -> float:
        """Sum of squared residuals over all decays."""
        return float(self.linearisation.rss.sum())


def degrees_of_freedom(decays: np.ndarray, n_mode: int, n_drift: int) -> int:
    """Number of samples minus amplitudes, drift and (shared) poles; at least one.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    n_mode : int
        Number of modes.
    n_drift : int
        Number of further columns of the model.

    Returns
    -------
    int
        Degrees of freedom of the residual.
    """
    return max(1, decays.size - len(decays) * (2 * n_mode + n_drift) - 2 * n_mode)


def between_variance(value: np.ndarray, variance: np.ndarray) -> np.ndarray:
    r"""Variance between estimates in excess of their own variance, by the method of moments.

    .. math:: \tau^2 = \max\left(0, \frac{Q - (n-1)}{\sum w - \sum w^2 / \sum w}\right), \quad w = 1/s^2

    Parameters
    ----------
    value : (n, ...) array of float
        Estimates.
    variance : (n, ...) array of float
        Variance of each estimate.

    Returns
    -------
    (...) array of float
        Variance between the estimates; 0 for a single one.

    References
    ----------
    DerSimonian and Laird 1986.

    >>> print(between_variance(np.array([1.0, 3.0]), np.array([0.5, 0.5])))
    1.5
    """
    n = len(value)
    if n < 2:
        return np.zeros(np.shape(value)[1:])
    weight = 1.0 / variance
    total = weight.sum(axis=0)
    mean = (weight * value).sum(axis=0) / total
    q = (weight * (value - mean) ** 2).sum(axis=0)
    return np.maximum(0.0, (q - (n - 1)) / (total - (weight**2).sum(axis=0) / total))


def fit_common(
    start: np.ndarray, decays: np.ndarray, rate: float, drift: np.ndarray, iterations: int = 12, tolerance: float = 1e-3
) -> tuple[np.ndarray, bool]:
    """Shared modes by Gauss-Newton with reduced steps.

    All sums over decays are invariant to a rotation of the decays. So the decays are replaced by their principal
    combinations, of which ``MAX_PRINCIPAL`` hold the signal.

    Parameters
    ----------
    start : (n_mode, 2) array of float
        Ln f [Hz] and zeta at the start.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]
    drift : (n_drift, n) array of float
        Further columns of the model.
    iterations : int
        Largest number of iterations.
    tolerance : float
        Step in standard errors at which the fit has converged.

    Returns
    -------
    (n_mode, 2) array of float, bool
        Ln f [Hz] and zeta of each mode; whether the fit converged.
    """
    n_mode = len(start)
    mean = np.array(start, dtype=float)
    dof = degrees_of_freedom(decays, n_mode, len(drift))
    decays, dropped_power = _principal_decays(decays)

    def linearise_at(theta: np.ndarray) -> Linearisation:
        return linearise(theta[None], decays, rate, drift)

    current = linearise_at(mean)
    for _ in range(iterations):
        information = current.information.sum(axis=0)
        step = _solve(information, current.score.sum(axis=0)).reshape(n_mode, 2)
        scale = min(1.0, *(MAX_STEP / np.maximum(np.abs(step).max(axis=0), 1e-300)))
        sigma2 = (current.rss.sum() + dropped_power) / dof
        size = np.sqrt(max(0.0, step.ravel() @ information @ step.ravel()) / max(sigma2, 1e-300))
        for _ in range(8):
            trial = mean + scale * step
            trial[:, 1] = np.clip(trial[:, 1], MIN_DAMPING, MAX_DAMPING)
            candidate = linearise_at(trial)
            if candidate.rss.sum() <= current.rss.sum():
                break
            scale *= 0.4
        else:
            return mean, True
        converged = np.max(np.abs(trial - mean)) < 1e-12 or size < tolerance
        mean, current = trial, candidate
        if converged:
            return mean, True
    return mean, False


def _principal_decays(decays: np.ndarray) -> tuple[np.ndarray, float]:
    """The decays' principal combinations (at most ``MAX_PRINCIPAL``, n), and the power of the others."""
    if len(decays) <= MAX_PRINCIPAL:
        return decays, 0.0
    power, turn = np.linalg.eigh(decays @ decays.T)
    return turn[:, -MAX_PRINCIPAL:].T @ decays, float(np.sum(np.maximum(power[:-MAX_PRINCIPAL], 0.0)))


def fit_mixed(
    start: np.ndarray | None,
    decays: np.ndarray,
    rate: float,
    drift: np.ndarray,
    theta: np.ndarray | None = None,
    iterations: int = 12,
    tolerance: float = 0.01,
    target_rss: float | None = None,
    is_search: bool = False,
) -> MixedFit:
    r"""Modes of every impact, shrunken towards their common mean according to the spread in the data.

    .. math:: z_i = \theta_i + (J^T J)^{-1} J^T r, \quad
              \mu = \left(\sum W_i\right)^{-1} \sum W_i z_i, \quad
              \theta_i \leftarrow \mu + T W_i (z_i - \mu), \quad W_i = (\sigma^2 (J^T J)^{-1} + T)^{-1}

    With no spread (T = 0) this is maximum likelihood with shared poles. With a large spread every impact is fitted
    alone. In between, linearising at the shrunken modes keeps the bias of a single noisy impact out of the mean.

    Parameters
    ----------
    start : (n_mode, 2) array of float
        ln of the frequency in Hz, damping ratio.
    decays : (n_decay, n) array of float
    rate : float
        [Hz]
    drift : (n_drift, n) array of float
        Further columns of the model.
    theta : (n_decay, n_mode, 2) array of float, optional
        Modes of each decay from an earlier fit; ``start`` is then not used. With fewer rows than ``decays``, the decays
        of an impact (its responses) follow each other and share their modes; "decay" below then means impact.
    iterations : int
        Largest number of iterations.
    tolerance : float
        Step in errors of single impacts at which the fit has converged.
    target_rss : float or None
        Sum of squared residuals that matters to the caller: the fit ends when it is clear that it stays above.
    is_search : bool
        The fit ends, too, when it no longer improves by what matters to a choice of modes.

    Returns
    -------
    MixedFit
        Modes of each impact and their mean.

    References
    ----------
    Lindstrom and Bates 1990, Nonlinear mixed effects models for repeated measures data.
    """
    if theta is None:  # do not fit shared modes first: the spread between impacts would look like a second mode
        theta = np.repeat(np.asarray(start, dtype=float)[None], len(decays), axis=0)
    # At the first use, since numba takes a third of a second to import.
    from turnout.modal.mixed_kernels import shrink

    n_decay, n_mode = theta.shape[:2]
    dof = degrees_of_freedom(decays, n_mode, len(drift))
    rss: list[float] = []
    for count in range(1, iterations + 1):
        linearisation = linearise(theta, decays, rate, drift)
        sigma2 = max(linearisation.rss.sum() / dof, 1e-300)
        rss.append(float(linearisation.rss.sum()))
        free, covariance, variance, spread, centre, shrunken = shrink(
            theta.reshape(n_decay, -1),
            linearisation.information.reshape(n_decay, -1, 2 * n_mode, 2 * n_mode).sum(axis=1),
            linearisation.score.reshape(n_decay, -1, 2 * n_mode).sum(axis=1),
            sigma2,
        )
        shrunken = _limit_step(shrunken.reshape(theta.shape), theta)
        change = np.max(np.abs((shrunken - theta).reshape(n_decay, -1)) / np.sqrt(variance + spread))
        converged = bool(change < tolerance) and count > 1
        if converged or (is_search and _is_decided(rss, sigma2, target_rss)):
            converged = True
            break
        if count < iterations:
            theta = shrunken
    # The steps are free, as the modes that they lead to are limited. What is reported is in its domain.
    unshrunken, is_limited = _limit_to_domain(free.reshape(theta.shape), theta)
    mean, _ = _limit_to_domain(centre.reshape(n_mode, 2), np.median(unshrunken, axis=0))
    converged = converged or n_decay == 1
    return MixedFit(mean, theta, unshrunken, covariance, spread, sigma2, linearisation, converged, is_limited)


def _is_decided(rss: list[float], sigma2: float, target_rss: float | None) -> bool:
    """Whether more iterations cannot change a choice of modes.

    The smallest sum of squares either no longer falls by ``SEARCH_RSS_STEP`` variances of the noise, or it falls by
    less than ``SEARCH_RSS_SHARE`` of its distance from ``target_rss``: a sequence whose improvements each are at most
    nine tenths of the one before never arrives there. A step that leads away from it says nothing yet.

    >>> rss = [2000.0, 1012.0, 1010.0, 1009.5, 1008.5]
    >>> [_is_decided([*rss, 1008.2], 1.0, target) for target in (None, 950.0)]  # 3.8 is less than a tenth of 58.2
    [False, True]
    >>> plateau = [2000.0, 1008.5, 1008.4, 1008.3, 1008.2]
    >>> _is_decided([*plateau, 1008.1], 1.0, None), _is_decided([*plateau, 1020.0], 1.0, None)
    (True, False)
    """
    if len(rss) < 2 + SEARCH_RSS_STEPS:
        return False
    lowest = min(rss)
    if max(rss[-SEARCH_RSS_STEPS:]) > (1.0 + SEARCH_EXCURSION) * lowest:
        return False
    improvement = min(rss[:-SEARCH_RSS_STEPS]) - lowest
    if improvement < SEARCH_RSS_STEP * sigma2:
        return True
    return target_rss is not None and improvement < SEARCH_RSS_SHARE * (lowest - target_rss)


def _limit_to_domain(free: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values in the domain of an underdamped mode near ``theta``, (..., 2) each; where they were limited.

    A damping below zero is an estimate of a small damping, and stays. One beyond ``MAX_DAMPING`` in magnitude, a
    frequency an octave away or a value that is not finite comes from an impact that holds no information on the mode.
    """
    limited = np.where(np.isfinite(free), free, theta)
    limited[..., 0] = np.clip(limited[..., 0], theta[..., 0] - MAX_FREQUENCY_STEP, theta[..., 0] + MAX_FREQUENCY_STEP)
    limited[..., 1] = np.clip(limited[..., 1], -MAX_DAMPING, MAX_DAMPING)
    return limited, (limited != free).any(axis=-1)


def _limit_step(theta: np.ndarray, previous: np.ndarray) -> np.ndarray:
    """The new modes, with the step limited and the damping between its limits."""
    theta = previous + np.clip(theta - previous, -MAX_STEP, MAX_STEP)
    theta[..., 1] = np.clip(theta[..., 1], MIN_DAMPING, MAX_DAMPING)
    return theta


def _normalise(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    diagonal = np.sqrt(np.maximum(np.einsum("...jj->...j", matrix), 1e-300))
    return diagonal, matrix / (diagonal[..., :, None] * diagonal[..., None, :])


def _inverse(matrix: np.ndarray) -> np.ndarray:
    diagonal, scaled = _normalise(matrix)
    size = matrix.shape[-1]
    return np.linalg.inv(scaled + RIDGE * np.eye(size)) / (diagonal[..., :, None] * diagonal[..., None, :])


def _solve(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return _inverse(matrix) @ vector
