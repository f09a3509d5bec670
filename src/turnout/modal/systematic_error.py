"""Error of the modes that all impacts of a test share: what the model leaves of them, and the choice of the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.mixed_effects import MIN_DAMPING
from turnout.modal.summary import shared_bound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.modal.mixed_effects import MixedFit

HALF_WIDTHS = 2.0  # half-power half-widths on each side of a mode within which a residual moves it


def common_residual(fit: MixedFit) -> np.ndarray:
    """What the residuals of all impacts have in common: their combination with the weights of the signal.

    Parameters
    ----------
    fit : MixedFit
        Fit of the decays.

    Returns
    -------
    (n,) array of float
        As large as the root of the sum of squares over the impacts, with the noise of one impact. [m/s²]
    """
    amplitude = fit.linearisation.amplitude
    weight = np.linalg.svd(np.hstack([amplitude.real, amplitude.imag]), full_matrices=False)[0][:, 0]
    return weight @ fit.linearisation.residual


def common_error(fit: MixedFit, rate: float) -> np.ndarray:
    r"""Standard error of ln f and zeta from what the modes leave of all impacts alike.

    .. math:: s^2 = b^2 \max\left(0, \frac{P_c - \bar P}{\sigma^2}\right)

    with the Cramér-Rao bound b of all impacts for white noise of variance :math:`\sigma^2`. :math:`P_c` is the mean
    power density of the common residual within two half-widths of the mode, :math:`\bar P` that of the single
    residuals. Noise of single impacts gives both the same expectation. A part of the track that the model does not
    contain is the same in all impacts. It shows in the combination with the power of all of them, does not average out,
    and the scatter between the impacts does not contain it. It is a lower limit: a fit absorbs a part of what is
    missing into its modes and amplitudes, the more the closer and the broader it is.

    Parameters
    ----------
    fit : MixedFit
        Fit of whitened decays, of all impacts or of combinations of them.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (n_mode, 2) array of float
        0 where nothing is left in the neighbourhood of a mode.

    References
    ----------
    White 1982, Maximum likelihood estimation of misspecified models: covariance from the residuals, not the model.
    """
    residual = fit.linearisation.residual
    excess = np.abs(np.fft.rfft(common_residual(fit))) ** 2 - _single_power(residual)
    ratio = _mean_near(excess, fit, rate) / (residual.shape[1] * fit.sigma2)
    return shared_bound(fit.linearisation, fit.sigma2) * np.sqrt(np.maximum(ratio, 0.0))[:, None]


def noise_near(fit: MixedFit, rate: float) -> np.ndarray:
    """Variance of white noise as strong as the noise of single impacts near each mode.

    The residuals without their combination that all impacts share; of one impact they are all there is.

    Parameters
    ----------
    fit : MixedFit
        Fit of whitened decays.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (n_mode,) array of float
        Mean power density within two half-widths of the mode, over that of white noise of unit variance.
    """
    residual = fit.linearisation.residual
    n_decay, n = residual.shape
    power = _single_power(residual)
    if n_decay > 1:
        power = (n_decay * power - np.abs(np.fft.rfft(common_residual(fit))) ** 2) / (n_decay - 1)
    return _mean_near(power, fit, rate) / n


def _single_power(residual: np.ndarray) -> np.ndarray:
    """Power of each line, mean over the impacts."""
    return np.mean(np.abs(np.fft.rfft(residual, axis=1)) ** 2, axis=0)


def _mean_near(power: np.ndarray, fit: MixedFit, rate: float) -> np.ndarray:
    """(n_mode,) mean of the lines within ``HALF_WIDTHS`` of each mode, at least one line on each side."""
    n = fit.linearisation.residual.shape[1]
    frequency = np.exp(fit.mean[:, 0])
    half = HALF_WIDTHS * np.maximum(fit.mean[:, 1], MIN_DAMPING) * frequency + rate / n
    near = np.abs(np.fft.rfftfreq(n, 1.0 / rate) - frequency[:, None]) <= half[:, None]
    # a pole above the Nyquist frequency has no line
    return near @ power / np.maximum(near.sum(axis=1), 1)


@dataclass(frozen=True)
class OwnEstimates:
    """Modes of one explanation: ``mean`` (n_mode, 2) of ln f [Hz] and zeta, with errors of the same shape.

    ``common`` is that of ``common_error``; ``variance`` adds that of the noise to its square.
    """

    mean: np.ndarray
    common: np.ndarray
    variance: np.ndarray


def own_estimates(fit: MixedFit, rate: float) -> OwnEstimates:
    """Modes of a fit with the errors that follow from this fit alone.

    Parameters
    ----------
    fit : MixedFit
        Fit of whitened decays.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    OwnEstimates
        Its modes.
    """
    common = common_error(fit, rate)
    return OwnEstimates(fit.mean, common, common**2 + shared_bound(fit.linearisation, fit.sigma2) ** 2)


def choice_variance(mode: np.ndarray, variance: np.ndarray, rivals: Sequence[OwnEstimates]) -> np.ndarray:
    r"""Variance of a mode from the choice among explanations, each weighted by how well it determines the mode.

    .. math:: \frac{\sum_j w_j (\theta_j - \theta)^2}{2 \sum_j w_j}, \quad
              w_j = \zeta_j^2 / s_j^2, \quad \theta_1 = \theta

    The distance of two estimates contains the error of both, hence the factor 2. The weights do not come from a
    criterion of the fit as a whole: 18,000 samples distinguish two wrong models with certainty, but do not show which
    of them has this mode right. An explanation that leaves much in the neighbourhood of the mode has a large error
    there, and says little about it. Errors count in half-power half-widths: in them the error of a mode depends on its
    energy alone, while in ln f and zeta a pole that is too narrow looks better determined than the broad one that it
    stands for. A mode whose half-power band overlaps may be another explanation of the same resonance.

    Parameters
    ----------
    mode, variance : (2,) arrays of float
        ln f [Hz] and zeta in the chosen explanation, with their own variances :math:`s_1^2`.
    rivals : sequence of OwnEstimates
        Modes of the other explanations. One in which no mode overlaps does not count.

    Returns
    -------
    (2,) array of float
        Of ln f and zeta; 0 without other explanations.

    References
    ----------
    Buckland, Burnham and Augustin 1997, Model selection: an integral part of inference, eq. 9, with other weights.

    Examples
    --------
    >>> mode, one = np.array([4.60, 0.20]), np.array([1e-4, 1e-4])
    >>> near, far = np.array([4.64, 0.20]), np.array([6.0, 0.05])
    >>> rival = OwnEstimates(np.array([near, far]), np.zeros((2, 2)), np.array([one, one]))
    >>> choice_variance(mode, one, [rival]), choice_variance(mode, one, [])
    (array([0.0004, 0.    ]), array([0., 0.]))
    """
    total = _determination(mode, variance)
    weighted = np.zeros(2)
    for rival in rivals:
        distance = np.abs(rival.mean - mode)
        nearest = int(np.argmin(distance @ [1.0, 0.5]))
        if distance[nearest, 0] < mode[1] + rival.mean[nearest, 1]:
            weight = _determination(rival.mean[nearest], rival.variance[nearest])
            total = total + weight
            weighted += weight * distance[nearest] ** 2
    return 0.5 * weighted / total


def _determination(mode: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """(2,) squared half-width of a mode over the variances of its ln f and zeta."""
    return max(float(mode[1]), MIN_DAMPING) ** 2 / np.maximum(variance, 1e-300)


def systematic_error(chosen: OwnEstimates, rivals: Sequence[OwnEstimates]) -> np.ndarray:
    """Standard error that all impacts share: of what the chosen explanation leaves of them, and of its choice.

    Parameters
    ----------
    chosen : OwnEstimates
        Modes of the chosen explanation.
    rivals : sequence of OwnEstimates
        Those of the others.

    Returns
    -------
    (n_mode, 2) array of float
        Of ln f and zeta.
    """
    choice = [choice_variance(m, v, rivals) for m, v in zip(chosen.mean, chosen.variance, strict=True)]
    return np.sqrt(chosen.common**2 + np.reshape(choice, chosen.mean.shape))
