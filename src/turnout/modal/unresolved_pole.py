"""Error of a mode from a second pole so close to it that the decays do not resolve the two."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.least_squares import powers
from turnout.modal.mixed_effects import MAX_DAMPING, MIN_DAMPING
from turnout.modal.poles import continuous_pole
from turnout.modal.systematic_error import noise_near

if TYPE_CHECKING:
    from turnout.modal.mixed_effects import MixedFit

PRIOR_PROBABILITY = 0.5  # that a second pole is there: indifference
PRIOR_SCALE = 0.3  # standard deviation of the real and imaginary part of kappa if it is; chosen on simulated sections
VARIANCE_RATIO = 0.5 * 4.0 * 2.0 * 1.5 / 0.5  # of ln f or zeta over zeta squared to that of a part of kappa, see below


def second_order_term(fit: MixedFit, columns: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    r"""What the decays say on a second pole near each mode.

    Two poles at a distance d and a ratio r of their amplitudes act as one, as long as d is small:

    .. math:: e^{s_1 t} + r e^{s_2 t} = (1 + r) e^{\bar s t} \left(1 + \kappa (\zeta\omega t)^2 + \dots\right), \quad
              \bar s = s_1 + \frac{r d}{1 + r}, \quad \kappa = \frac{r d^2}{2 (1 + r)^2 (\zeta\omega)^2}

    A fit of one pole finds :math:`\bar s`. The two unknowns of :math:`\kappa` are the same in all impacts. They are
    estimated by least squares from the residuals, with the amplitudes, the poles and the background eliminated.

    Parameters
    ----------
    fit : MixedFit
        Fit of whitened decays.
    columns : (n_column, n) array of float
        Columns of the background.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    kappa : (n_mode,) array of complex
    variance : (n_mode,) array of float
        Mean variance of its real and imaginary part, for the noise in the neighbourhood of the mode.
    """
    frequency, damping = np.exp(fit.mean[:, 0]), np.clip(fit.mean[:, 1], MIN_DAMPING, MAX_DAMPING)
    pole = continuous_pole(frequency, damping)
    residual, amplitude = fit.linearisation.residual, fit.linearisation.amplitude
    n = residual.shape[1]
    wave = powers(np.exp(pole / rate), n)
    scaled_time = -pole.real[:, None] * np.arange(n) / rate
    linear_terms = np.vstack([wave, scaled_time * wave])
    basis = np.linalg.qr(np.vstack([linear_terms.real, linear_terms.imag, columns]).T)[0]
    second = scaled_time**2 * wave
    second = np.stack([second.real, second.imag], axis=1)  # (n_mode, 2, n)
    second = second - (second @ basis) @ basis.T
    a, b = amplitude.real.T, amplitude.imag.T  # Re(kappa alpha w) = Re kappa (a u - b v) - Im kappa (b u + a v)
    turn = np.moveaxis(np.array([[a, -b], [-b, -a]]), (0, 1), (-2, -1))  # (n_mode, n_decay, 2, 2)
    score = np.einsum("midk,mki->md", turn, second @ residual.T)
    gram = second @ np.swapaxes(second, 1, 2)
    covariance = np.linalg.pinv(np.einsum("midk,mkl,miel->mde", turn, gram, turn), hermitian=True)
    kappa = np.einsum("mde,me->md", covariance, score)
    return kappa[:, 0] + 1j * kappa[:, 1], 0.5 * np.einsum("mdd->m", covariance) * noise_near(fit, rate)


def unresolved_pole_error(fit: MixedFit, columns: np.ndarray, rate: float) -> np.ndarray:
    r"""Standard error of ln f and zeta from a second pole that the decays do not resolve.

    With the closed forms of ``second_order_term`` the fitted pole lies beside that of the stronger mode by

    .. math:: \frac{\bar s - s_1}{\zeta\omega} = 2 \kappa\, \frac{(1 + r)\,\zeta\omega}{d}

    A priori there is a second pole or none, with equal probability. If there is, r lies anywhere within the unit circle
    and d within one half-power half-width, so that the mean square of 1 + r is 3/2 and the median square of d is 1/2.
    The error is what the decays leave open: the probability of a second pole times the variance of :math:`\kappa`
    if it is there, half of it in each of ln f and zeta,

    .. math:: s^2 = 12\, \zeta^2\, P\, \mathrm{var}(\kappa)

    Decays with little noise determine :math:`\kappa`, and the error vanishes. What two resolved poles leave of a fit of
    one is not in it but in ``common_error``.

    Parameters
    ----------
    fit : MixedFit
        Fit of whitened decays.
    columns : (n_column, n) array of float
        Columns of the background.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (n_mode, 2) array of float
        Of ln f and zeta.

    References
    ----------
    Mitchell and Beauchamp 1988, Bayesian variable selection in linear regression: a prior of a spike and a slab.
    """
    kappa, variance = second_order_term(fit, columns, rate)
    probability, open_variance = second_pole_posterior(np.abs(kappa), variance)
    error = np.abs(fit.mean[:, 1]) * np.sqrt(VARIANCE_RATIO * probability * open_variance)
    return np.repeat(error[:, None], 2, axis=1)


def second_pole_posterior(size: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r"""Probability of a second pole, and the variance of the real and imaginary part of kappa if it is there.

    Parameters
    ----------
    size : (n_mode,) array of float
        Magnitude of the estimated kappa.
    variance : (n_mode,) array of float
        Variance of its real and imaginary part.

    Returns
    -------
    probability, open_variance : (n_mode,) arrays of float

    Examples
    --------
    >>> no_information, exact = second_pole_posterior(np.array([0.0, 0.0, 0.1]), np.array([1e6, 1e-6, 1e-6]))
    >>> print(no_information.round(3), exact.round(3))
    [0.5 0.  1. ] [0.09 0.   0.  ]
    """
    total = variance + PRIOR_SCALE**2
    exponent = 0.5 * size**2 * (1.0 / np.maximum(variance, 1e-300) - 1.0 / total)
    odds = PRIOR_PROBABILITY / (1.0 - PRIOR_PROBABILITY) * variance / total * np.exp(np.minimum(exponent, 500.0))
    return odds / (1.0 + odds), PRIOR_SCALE**2 * variance / total
