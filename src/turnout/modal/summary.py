"""Summarise a mode over the impacts: mean with interval, spread between impacts, Cramér-Rao bound."""

from dataclasses import dataclass, field

import numpy as np
import scipy

from turnout.modal.least_squares import Linearisation, drift_columns, linearise
from turnout.modal.mixed_effects import between_variance
from turnout.records import Mode


@dataclass(frozen=True)
class Summary:
    """``mean`` ± ``se``, interval ``low`` to ``high``, standard deviation ``spread`` between ``n`` impacts.

    ``se`` has two parts, added in squares: ``repeatability`` from the scatter of the estimates, and ``systematic``, the
    error that all of them share.
    """

    mean: float
    se: float
    low: float
    high: float
    spread: float
    n: int
    repeatability: float
    systematic: float = 0.0


def summarise(value: np.ndarray, se: np.ndarray, confidence: float = 0.95, shared_se: float = 0.0) -> Summary:
    r"""Random-effects mean of estimates that each have a standard error.

    .. math:: m = \frac{\sum w_i x_i}{\sum w_i}, \quad w_i = \frac{1}{s_i^2 + \tau^2}, \quad
              \mathrm{se}^2 = \frac{\sum w_i (x_i - m)^2}{(n-1) \sum w_i}, \quad m \pm t_{n-1}\,\mathrm{se}

    The standard error comes from the spread of the estimates, not from their stated errors. So it is right even if
    those are wrong by a common factor. With equal errors this is the t interval. A single estimate has its stated
    error and a normal interval. The shared error has many degrees of freedom, so the interval adds the t interval of
    the scatter and the normal interval of the shared error in squares.

    Parameters
    ----------
    value, se : (n,) array of float
        Estimates and standard errors, same unit; ValueError if there are none.
    confidence : float
        Probability of the interval.
    shared_se : float
        Standard error that all estimates share, such as that of the choice of a model. The spread does not show it.

    Returns
    -------
    Summary
        Mean with error, interval and spread.

    Raises
    ------
    ValueError
        If there are no estimates.

    References
    ----------
    Hartung and Knapp 2001; Sidik and Jonkman 2002.

    Examples
    --------
    >>> s = summarise(np.array([9.0, 11.0]), np.array([0.1, 0.1]))
    >>> print(f"{s.mean:.1f} ± {s.se:.1f}, {s.high - s.mean:.2f}")
    10.0 ± 1.0, 12.71
    """
    value, se = np.asarray(value, float), np.asarray(se, float)
    n = len(value)
    if n == 0:
        raise ValueError("no estimates to summarise")
    normal = scipy.stats.norm.ppf(0.5 + confidence / 2.0)
    if n == 1:
        mean, spread2, repeatability, quantile = float(value[0]), 0.0, float(se[0]), normal
    else:
        spread2 = float(between_variance(value, np.maximum(se**2, 1e-300)))
        weight = 1.0 / (np.maximum(se**2, 1e-300) + spread2)
        mean = float(np.sum(weight * value) / weight.sum())
        repeatability = float(np.sqrt(np.sum(weight * (value - mean) ** 2) / ((n - 1) * weight.sum())))
        quantile = scipy.stats.t.ppf(0.5 + confidence / 2.0, n - 1)
    half = float(np.hypot(quantile * repeatability, normal * shared_se))
    error = float(np.hypot(repeatability, shared_se))
    return Summary(mean, error, mean - half, mean + half, float(np.sqrt(spread2)), n, repeatability, float(shared_se))


MIN_ERROR = 1e-12  # stands for an unknown standard error: the spread between impacts then is all the error


@dataclass(frozen=True)
class ImpactEstimates:
    """One mode in several impacts: ``impact`` (n,) numbers, ``estimate`` and ``error`` (n, 2) of ln f [Hz] and zeta.

    An error of nan is unknown and becomes None; the whole difference between impacts then counts as spread.
    ``strength`` (n,) is the norm of each decay, ``bound`` (2,) the Cramér-Rao bound, None where unknown.
    ``shared_se`` (2,) is the error of the choice between explanations, common to all impacts.
    """

    band: str
    impact: np.ndarray
    estimate: np.ndarray
    error: np.ndarray
    strength: np.ndarray
    energy: float | None = None
    bound: np.ndarray | None = None
    shared_se: np.ndarray = field(default_factory=lambda: np.zeros(2))

    def rows(self) -> list[dict]:
        """The table ``per_impact`` of a modal model."""
        frequency = np.exp(self.estimate[:, 0])
        return [
            {
                "impact": int(self.impact[i]),
                "band": self.band,
                "frequency": float(frequency[i]),
                "damping": float(self.estimate[i, 1]),
                "frequency_se": _none_if_nan(frequency[i] * self.error[i, 0]),
                "damping_se": _none_if_nan(self.error[i, 1]),
            }
            for i in range(len(self.impact))
        ]

    def mode(self, confidence: float) -> Mode:
        """Random-effects mean over the impacts; for the frequency that of its logarithm.

        The weights follow the strength of each impact, not its stated error. The error of a noisy impact depends on
        its estimate, so weighting by it would bias the mean.

        Parameters
        ----------
        confidence : float
            Probability of the intervals.

        Returns
        -------
        Mode
            The mode with errors and intervals.
        """
        error = np.median(self.error * self.strength[:, None], axis=0) / self.strength[:, None]
        error = np.nan_to_num(error, nan=MIN_ERROR) if len(error) > 1 else error
        log_f = summarise(self.estimate[:, 0], error[:, 0], confidence, self.shared_se[0])
        zeta = summarise(self.estimate[:, 1], error[:, 1], confidence, self.shared_se[1])
        f = float(np.exp(log_f.mean))
        return Mode(
            band=self.band,
            frequency=f,
            damping=zeta.mean,
            frequency_se=_none_if_nan(f * log_f.se),
            damping_se=_none_if_nan(zeta.se),
            frequency_sd=f * log_f.spread,
            damping_sd=zeta.spread,
            frequency_low=_none_if_nan(np.exp(log_f.low)),
            frequency_high=_none_if_nan(np.exp(log_f.high)),
            damping_low=_none_if_nan(np.maximum(zeta.low, 0.0)),
            damping_high=_none_if_nan(np.minimum(zeta.high, 1.0)),
            frequency_repeatability=_none_if_nan(f * log_f.repeatability),
            damping_repeatability=_none_if_nan(zeta.repeatability),
            frequency_systematic=f * log_f.systematic,
            damping_systematic=zeta.systematic,
            frequency_crb=None if self.bound is None else f * float(self.bound[0]),
            damping_crb=None if self.bound is None else float(self.bound[1]),
            energy=self.energy,
            n=log_f.n,
        )


def _none_if_nan(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def cramer_rao_bound(
    theta: np.ndarray, decays: np.ndarray, rate: float, sigma2: float | np.ndarray, columns: np.ndarray | None = None
) -> np.ndarray:
    r"""Smallest standard errors that any unbiased estimator can have: poles shared, amplitudes free in each decay.

    .. math:: \mathrm{cov} \ge \sigma^2 \left(\sum_i J_i^T J_i\right)^{-1}

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) array of float
        True (or estimated) ln f [Hz] and zeta of each decay. The bound is for their common mean if they agree.
    decays : (n_decay, n) array of float
        They set the amplitudes only.
    rate : float
        [Hz]
    sigma2 : float or (n_decay,) array
        Variance of the white noise of each decay.
    columns : (n_column, n) array of float, optional
        Drift and hum that are estimated too, free in each decay.

    Returns
    -------
    (n_mode, 2) array of float
        Standard errors of ln f (relative) and of zeta.

    References
    ----------
    Rao 1945; for damped sinusoids Yao and Pandit 1995.
    """
    columns = drift_columns(decays.shape[1], -1) if columns is None else columns
    return shared_bound(linearise(theta, decays, rate, columns), sigma2)


def shared_bound(linearisation: Linearisation, sigma2: float | np.ndarray) -> np.ndarray:
    """The same bound from the sums of a fit.

    Parameters
    ----------
    linearisation : Linearisation
        Sums of all decays at their modes.
    sigma2 : float or (n_decay,) array
        Variance of the white noise of each decay.

    Returns
    -------
    (n_mode, 2) array of float
        Standard errors of ln f (relative) and of zeta.
    """
    weight = 1.0 / np.broadcast_to(sigma2, len(linearisation.information))
    information = np.einsum("i,ijk->jk", weight, linearisation.information)
    scale = np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return np.sqrt(np.diag(covariance)).reshape(-1, 2)
