"""Conversion between the poles of a sampled system and frequencies and damping ratios."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def modal_parameters(pole: ArrayLike, rate: float) -> tuple[np.ndarray, np.ndarray]:
    r"""Undamped natural frequency and damping ratio of discrete poles.

    .. math:: s = f_s \ln z, \quad f_n = |s| / 2\pi, \quad \zeta = -\mathrm{Re}(s) / |s|

    Parameters
    ----------
    pole : (...) array of complex
        Eigenvalues z of the state matrix, any shape.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    frequency, damping : (...) arrays of float
        Undamped natural frequency [Hz] and damping ratio [-], of the shape of ``pole``.

    References
    ----------
    Barkhordari et al., eq. 16, which calls the frequency in Hz an angular one.

    Examples
    --------
    An undamped pole a quarter turn per sample is at a quarter of the sampling rate.

    >>> frequency, damping = modal_parameters(1j, 20e3)
    >>> print(f"{frequency:.0f} Hz, {abs(damping):.0f}")
    5000 Hz, 0
    """
    s = np.log(np.asarray(pole, dtype=complex)) * rate
    magnitude = np.abs(s)
    with np.errstate(invalid="ignore", divide="ignore"):
        damping = np.where(magnitude > 0.0, -s.real / magnitude, np.nan)
    return magnitude / (2.0 * np.pi), damping


def continuous_pole(frequency: ArrayLike, damping: ArrayLike) -> np.ndarray:
    r"""Pole in the upper half plane of an underdamped mode.

    .. math:: s = 2\pi f_n (-\zeta + i\sqrt{1-\zeta^2})

    Parameters
    ----------
    frequency : float or (...) array
        Undamped natural frequency. [Hz]
    damping : float or (...) array
        Damping ratio, below 1 in magnitude, broadcast against ``frequency``.

    Returns
    -------
    (...) array of complex
        Pole s. [1/s]

    Raises
    ------
    ValueError
        For a damping ratio of 1 or more.

    Examples
    --------
    >>> s = continuous_pole(1.0 / (2.0 * np.pi), 0.6)
    >>> print(f"{s:.1f}")
    -0.6+0.8j
    """
    damping = np.asarray(damping, dtype=float)
    if np.any(np.abs(damping) >= 1.0):
        raise ValueError(f"need damping ratios below 1, the highest is {np.max(np.abs(damping)):.3g}")
    return 2.0 * np.pi * np.asarray(frequency) * (-damping + 1j * np.sqrt(1.0 - damping**2))


def discrete_pole(frequency: ArrayLike, damping: ArrayLike, rate: float) -> np.ndarray:
    r"""Pole of the sampled mode, :math:`z = \exp(s / f_s)`; the inverse of :func:`modal_parameters`.

    Parameters
    ----------
    frequency : float or (...) array
        Undamped natural frequency. [Hz]
    damping : float or (...) array
        Damping ratio, below 1 in magnitude.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (...) array of complex
        Pole z.

    Raises
    ------
    ValueError
        For a damping ratio of 1 or more.

    Examples
    --------
    >>> f, zeta = modal_parameters(discrete_pole(99.45, 0.2912, 20e3), 20e3)
    >>> print(f"{f:.2f} Hz, {zeta:.4f}")
    99.45 Hz, 0.2912
    """
    return np.exp(continuous_pole(frequency, damping) / rate)
