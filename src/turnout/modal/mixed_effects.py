"""Estimate the modes of each impact and their mean together: maximum likelihood with a spread between impacts."""

from dataclasses import dataclass

import numpy as np

from turnout.modal.least_squares import Linearisation, contiguous, group_decays, linearisation_of, power_sums

MAX_STEP = (0.2, 0.15)  # of ln f and of zeta in one iteration
MAX_COMMON_STEPS = 12  # iterations of a fit with common modes
COMMON_TOLERANCE = 1e-3  # standard errors; a smaller step is the last one of such a fit
MAX_PRINCIPAL = 8  # combinations of the decays that hold the signal
MIN_DAMPING, MAX_DAMPING = 1e-5, 0.95  # damping ratios during the fit
LIMITS = (*MAX_STEP, MIN_DAMPING, MAX_DAMPING)
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


def fit_common(start: np.ndarray, decays: np.ndarray, rate: float, drift: np.ndarray) -> tuple[np.ndarray, bool]:
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

    Returns
    -------
    (n_mode, 2) array of float, bool
        Ln f [Hz] and zeta of each mode; whether the fit converged.
    """
    dof = degrees_of_freedom(decays, len(start), len(drift))
    decays, omitted_power = _principal_decays(decays)
    # At the first use, since numba takes a third of a second to import.
    from turnout.modal.fit_kernels import iterate_common

    theta, group = group_decays(np.asarray(start, dtype=float)[None], decays)
    terms = power_sums(group.shape[-1])
    mean, _, converged = iterate_common(
        theta[0], rate, group, contiguous(drift), terms, dof, omitted_power, MAX_COMMON_STEPS, COMMON_TOLERANCE, LIMITS
    )
    return mean, converged


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
    from turnout.modal.fit_kernels import iterate_mixed

    n_decay, n_mode = theta.shape[:2]
    dof = degrees_of_freedom(decays, n_mode, len(drift))
    theta, group = group_decays(theta, decays)
    terms, target = power_sums(group.shape[-1]), -np.inf if target_rss is None else float(target_rss)
    theta, waves, step, sigma2, converged = iterate_mixed(
        theta, rate, group, contiguous(drift), terms, dof, iterations, tolerance, is_search, target, LIMITS
    )
    free, covariance, _, spread, centre, _ = step
    # The steps are free, as the modes that they lead to are limited. What is reported is in its domain.
    unshrunken, is_limited = _limit_to_domain(free.reshape(theta.shape), theta)
    mean, _ = _limit_to_domain(centre.reshape(n_mode, 2), np.median(unshrunken, axis=0))
    converged = converged or n_decay == 1
    linearisation = linearisation_of(waves)
    return MixedFit(mean, theta, unshrunken, covariance, spread, sigma2, linearisation, converged, is_limited)


def _limit_to_domain(free: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values in the domain of an underdamped mode near ``theta``, (..., 2) each; where they were limited.

    A damping below zero is an estimate of a small damping, and stays. One beyond ``MAX_DAMPING`` in magnitude, a
    frequency an octave away or a value that is not finite comes from an impact that holds no information on the mode.
    """
    limited = np.where(np.isfinite(free), free, theta)
    limited[..., 0] = np.clip(limited[..., 0], theta[..., 0] - MAX_FREQUENCY_STEP, theta[..., 0] + MAX_FREQUENCY_STEP)
    limited[..., 1] = np.clip(limited[..., 1], -MAX_DAMPING, MAX_DAMPING)
    return limited, (limited != free).any(axis=-1)
