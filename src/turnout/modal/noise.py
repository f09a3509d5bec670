"""Model what decays contain besides modes: coloured noise, a slow zero drift, and hum of mains or traction current.

The noise is an autoregressive model of the residual; decays are whitened with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from scipy.special import chdtrc

from turnout.modal.least_squares import drift_columns, linearise
from turnout.modal.mixed_effects import degrees_of_freedom
from turnout.modal.mode_tests import columns_chi_squared

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.stabilization import Stabilisation


def noise_filter(residual: np.ndarray, order_maximum: int) -> np.ndarray:
    r"""Whitening filter of residuals, its order by the Bayesian information criterion.

    .. math:: e_k = \sum_{j=0}^p a_j r_{k-j}, \quad a_0 = 1

    Parameters
    ----------
    residual : (n_decay, n) array of float
        Residuals of the fit.
    order_maximum : int
        Highest order p.

    Returns
    -------
    (p + 1,) array of float
        Coefficients, [1.] for white noise.

    References
    ----------
    Yule-Walker equations on the pooled autocovariance, by the recursion of Levinson 1947; Schwarz 1978.

    Examples
    --------
    >>> white = np.random.default_rng(1).standard_normal((5, 400))
    >>> noise_filter(white, 6)
    array([1.])
    """
    n = residual.size
    length = residual.shape[1]
    lags = np.array([_product(residual[:, : length - k], residual[:, k:]) for k in range(order_maximum + 1)]) / n
    lowest_criterion, coefficients = n * np.log(max(lags[0], 1e-300)), np.ones(1)
    a, variance = np.empty(0), lags[0]
    for order in range(1, order_maximum + 1):
        if not variance > 0.0:
            break
        # Levinson's recursion: the coefficients of an order from those of the one before
        reflection = (lags[order] - a @ lags[order - 1 : 0 : -1]) / variance
        a = np.append(a - reflection * a[::-1], reflection)
        variance *= 1.0 - reflection**2
        criterion = n * np.log(max(variance, 1e-300)) + order * np.log(n)
        if criterion < lowest_criterion:
            lowest_criterion, coefficients = criterion, np.concatenate(([1.0], -a))
    return coefficients


def _product(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.einsum("ij,ij->", first, second))


def whiten(decays: np.ndarray, whitening: np.ndarray) -> np.ndarray:
    """Decays through the whitening filter, without its first samples; the poles stay the same.

    A sum of exponentials through a finite filter is the same sum with other amplitudes.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    whitening : (p + 1,) array of float
        Coefficients of ``noise_filter``.

    Returns
    -------
    (n_decay, n - p) array of float
        Filtered decays.

    Examples
    --------
    >>> whiten(np.array([[1.0, 0.5, 0.25]]), np.array([1.0, -0.5]))
    array([[0., 0.]])
    """
    order = len(whitening) - 1
    return scipy.signal.lfilter(whitening, 1.0, decays, axis=-1)[:, order:] if order else decays


BACKGROUND_SIGNIFICANCE = 1e-3  # significance level of a drift or a hum
PHASE_SIGNIFICANCE = 1e-2  # significance level of equal phases in all impacts
HARMONIC_TOLERANCE = 0.06  # relative distance from a harmonic
N_HARMONICS = 5  # harmonics of each source


@dataclass(frozen=True)
class Background:
    """A polynomial of ``drift_degree`` (-1: none) and sines at the ``hum`` frequencies [Hz], free in each decay."""

    drift_degree: int = -1
    hum: tuple[float, ...] = ()

    def columns(self, n: int, rate: float) -> np.ndarray:
        """Columns of the model: cosine and sine of each hum, then the polynomials.

        Parameters
        ----------
        n : int
            Samples of a decay.
        rate : float
            Sampling rate. [Hz]

        Returns
        -------
        (n_column, n) array of float
            Columns, of unit norm.
        """
        phase = 2.0 * np.pi * np.array(self.hum)[:, None] * np.arange(n) / rate
        scale = np.sqrt(2.0 / n)
        return np.vstack([scale * np.cos(phase), scale * np.sin(phase), drift_columns(n, self.drift_degree)])


def max_drift_degree(n: int, rate: float, settings: IdentifySettings) -> int:
    """Highest degree of a drift below the ballast band, at most ``settings.drift_maximum``.

    A polynomial of degree d over a record of length T holds frequencies up to (d + 1) / (2 T).

    Parameters
    ----------
    n : int
        Samples of a decay.
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    int
        Degree; -1 for a record too short for a constant.
    """
    return min(settings.drift_maximum, int(2.0 * settings.ballast_low * n / rate) - 1)


def hum_frequencies(table: Stabilisation, n: int, rate: float, settings: IdentifySettings) -> tuple[float, ...]:
    """Harmonics of ``settings.hum_sources`` at which an undamped pole recurs over orders and starts.

    Undamped: it decays or grows by less than a factor of two over the ``n`` samples.

    Parameters
    ----------
    table : Stabilisation
        Poles over orders and starts.
    n : int
        Samples of a decay.
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    tuple of float
        Frequencies of the hum. [Hz]
    """
    hum: list[float] = []
    for source in settings.hum_sources:
        for harmonic in source * np.arange(1, N_HARMONICS + 1):
            near = np.abs(table.frequency / harmonic - 1.0) < HARMONIC_TOLERANCE
            steady = np.abs(table.damping) * 2.0 * np.pi * table.frequency * n / rate < np.log(2.0)
            cells = np.unique(table.start[near & steady] * 1000 + table.order[near & steady])
            if len(cells) >= settings.presence_minimum * table.n_cell and not np.any(
                np.abs(np.array(hum) / harmonic - 1.0) < HARMONIC_TOLERANCE
            ):
                hum.append(float(harmonic))
    return tuple(hum)


def is_locked_to_impact(frequency: float, theta: np.ndarray, decays: np.ndarray, rate: float) -> bool:
    """Whether an oscillation beside the modes starts with every impact.

    The phases of hum are random, those of a lightly damped mode agree between impacts. This is Rayleigh's test at
    ``PHASE_SIGNIFICANCE``; three impacts or fewer are not enough for it.

    Parameters
    ----------
    frequency : float
        Frequency of the oscillation. [Hz]
    theta : (n_mode, 2) array of float
        Ln f [Hz] and zeta of the modes; those near ``frequency`` do not count.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    bool
        False also where there are too few impacts to tell.

    References
    ----------
    Zar 1999, Biostatistical Analysis, eq. 27.4: probability of the mean resultant length by chance.
    """
    n_decay, n = decays.shape
    theta = theta[np.abs(np.exp(theta[:, 0]) / frequency - 1.0) > HARMONIC_TOLERANCE]
    if n_decay < 4 or not len(theta):
        return False
    linearisation = linearise(theta[None], decays, rate, Background(0, (frequency,)).columns(n, rate))
    cosine, sine = linearisation.coefficient[:, 2 * len(theta) : 2 * len(theta) + 2].T
    resultant = abs(np.sum(np.exp(1j * np.arctan2(sine, cosine))))
    probability = np.exp(np.sqrt(1 + 4 * n_decay + 4 * (n_decay**2 - resultant**2)) - (1 + 2 * n_decay))
    return bool(probability < PHASE_SIGNIFICANCE)


def significant_background(theta: np.ndarray, decays: np.ndarray, rate: float, largest: Background) -> Background:
    """The part of ``largest`` that is significant beside the modes.

    First each hum is tested. The drift gets the lowest degree above which no term is significant.

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) array of float
        Ln f [Hz] and zeta of each decay.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]
    largest : Background
        Background with all terms that may be there.

    Returns
    -------
    Background
        Its hum and degree are those of ``largest`` or less.
    """
    n_decay, n = decays.shape
    n_mode = theta.shape[1]

    def probability(background: Background, columns: Iterable[int]) -> float:
        linearisation = linearise(theta, decays, rate, background.columns(n, rate))
        drift = linearisation.gram.shape[-1] - 2 * n_mode
        sigma2 = linearisation.rss.sum() / degrees_of_freedom(decays, n_mode, drift)
        index = 2 * n_mode + np.asarray(columns)
        return chdtrc(n_decay * len(index), columns_chi_squared(linearisation, sigma2, index))

    n_hum = len(largest.hum)
    hum = tuple(h for i, h in enumerate(largest.hum) if probability(largest, [i, n_hum + i]) < BACKGROUND_SIGNIFICANCE)
    largest, n_hum = Background(largest.drift_degree, hum), len(hum)
    for lowest in range(largest.drift_degree + 1):
        if (
            probability(largest, range(2 * n_hum + lowest, 2 * n_hum + largest.drift_degree + 1))
            > BACKGROUND_SIGNIFICANCE
        ):
            return Background(lowest - 1, hum)
    return largest
